/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_WORKER_SANDBOX_H
#define ISCHIA_SERVER_CLI_WORKER_SANDBOX_H

#include "solver/error.h"

/*
 * What a worker gives up once it is ready, for good: opening or creating files, new descriptors of
 * any kind, writing anywhere but to its socket and standard error. Trying to reach the network or
 * to run a program ends it (SIGSYS); what else it no longer may fails with EPERM. It dies with the
 * daemon. ISCHIA_E_IO when the kernel refuses: a worker that is not shut in must not serve.
 */
ISCHIA_MUST_CHECK enum ischia_code worker_sandbox_enter(int socket, struct ischia_error *err);

#endif
