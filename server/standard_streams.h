/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_STANDARD_STREAMS_H
#define ISCHIA_SERVER_STANDARD_STREAMS_H

#include "solver/error.h"

/* Before anything is opened: a program that was started with standard input, output or error
 * closed would give their numbers to its own files, and print messages into a result. They stay
 * unusable: who reads or writes there is told so. */
void standard_streams_hold(void);

/* ISCHIA_E_IO when what was printed did not all arrive. */
ISCHIA_MUST_CHECK enum ischia_code standard_output_flush(struct ischia_error *err);

#endif
