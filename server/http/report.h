/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_REPORT_H
#define ISCHIA_SERVER_REPORT_H

#include "server/store/store.h"

/* The report of an assessment that has ended, as one HTML text that refers to nothing outside
 * itself: for attachments. *ret is the caller's to free. */
ISCHIA_MUST_CHECK enum ischia_code report_attachment(char **ret, const struct store_assessment *row,
                                                     struct ischia_error *err);

#endif
