/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_HTTP_ESTIMATE_DOC_H
#define ISCHIA_SERVER_HTTP_ESTIMATE_DOC_H

#include "api/json.h"
#include "api/words.h"
#include "server/estimator.h"
#include "solver/case.h"

/* What documents of estimates are made of: numbers with their bands, whose they are, and why there
 * are none. Each writes members into the object that is open in out. */

/* strain, clusters, seat and threshold_force_N; c NULL: there is no estimate, and all are null. */
void estimate_put_values(struct json_out *out, const struct predictor *p,
                         const struct ischia_case *c);

/* Only threshold_force_N, under another name; a force above the case's own is not left out. */
void estimate_put_forces(struct json_out *out, const char *key, const struct predictor *p,
                         const struct ischia_case *c);

/* threshold - strain of both criteria, {"shear": value, "compression": value}: how far below. */
void estimate_put_margins(struct json_out *out, const char *key, const struct predictor *p,
                          const struct ischia_case *c);

/* Of which training the numbers are. */
void estimate_put_emulator(struct json_out *out, const struct estimator *estimator);
/* Of the case, and why there is no estimate for it. */
void estimate_put_warnings(struct json_out *out, const struct predictor *p,
                           const struct ischia_case *c, enum language language);

#endif
