/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_PARAMETERS_DOC_H
#define ISCHIA_API_PARAMETERS_DOC_H

#include "api/words.h"
#include "solver/error.h"

/*
 * GET /v1/parameters, from the tables of solver/case.h and api/risk.h:
 * {
 *   "model": { "name", "version" },
 *   "parameters": [ { "key", "aliases": ["..."], "unit", "description",
 *                     "accepted": { "min", "max" }, "studied": { "min", "max" } } ],
 *   "options": [ { "group", "key", "pointer", "unit", "description",
 *                  "accepted": { "min", "max" }, "default" } ],
 *   "presets": [ { "name", "description", "skin": { ... }, "model": { ... } } ],
 *   "resolutions": [ { "name", "default": true } ],
 *   "fields": [ { "key", "description", "pattern" (null: none), "max_length" } ], subject, side ...
 *   "thresholds": { "E_shear": 0.75, "E_comp": 0.45, "measure": "green_lagrange" },
 *   "bands": [ { "name", "headline" } ],
 *   "caveats": [ "..." ]
 * }
 * The whole object as one text, the caller's to free. indent as json_out.
 */
ISCHIA_MUST_CHECK enum ischia_code parameters_doc_text(char **ret_text, enum language language,
                                                       int indent, struct ischia_error *err);

#endif
