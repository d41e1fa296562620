/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_CASE_WORDS_H
#define ISCHIA_API_CASE_WORDS_H

#include <stddef.h>

#include "api/faults.h"
#include "api/words.h"
#include "solver/case.h"

/* Words about a case: what its inputs are called, and what is wrong with it. */

struct param_words {
    enum word name; /* two or three words: what a form calls it                               */
    enum word help; /* one plain sentence                                                     */
};
extern const struct param_words param_words[ISCHIA_PARAM_COUNT];
extern const enum word option_words[ISCHIA_OPTION_COUNT]; /* a sentence each */

/* A fault of the case as readers of documents report it: pointer, code, and a detail that names
 * field, value and what is accepted, e.g. "muM is 80 kPa; accepted 0.5 to 30 kPa". */
void case_fault_words(struct ischia_fault *ret, enum language language, const struct ischia_case *c,
                      const struct ischia_case_fault *fault);

/* ischia_case_warnings in words: each is "outside_study_range". Returns how many there are. */
size_t case_warnings(const struct ischia_case *c, enum language language,
                     struct ischia_fault ret_warnings[ISCHIA_PARAM_COUNT]);

/* "" for the unit of a number without one, otherwise a blank and the unit (in buffer). */
const char *case_spaced_unit(const char *unit, char buffer[16]);

#endif
