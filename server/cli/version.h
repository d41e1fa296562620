/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_VERSION_H
#define ISCHIA_SERVER_CLI_VERSION_H

#include <stddef.h>

/* "0.1.0, CHOLMOD 3.0.14, OpenBLAS 0.3.21": this program and what it computes with, cut to fit. */
void version_of_worker(char *ret, size_t size);

#endif
