/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_SUMMARY_H
#define ISCHIA_SERVER_CLI_SUMMARY_H

#include <stdio.h>

#include "api/case_doc.h"
#include "solver/result.h"
#include "solver/study/uncertainty.h"

/* A result for people: values with their units and strain measures, one thing a line. Of a result
 * that did not converge only the inputs and how far it came. */
void summary_print(FILE *out, const struct ischia_request *request,
                   const struct ischia_result *result,
                   const struct ischia_uncertainty *uncertainty);

#endif
