/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_CASE_KEYS_H
#define ISCHIA_API_CASE_KEYS_H

#include "api/case_doc.h"

/* What the readers of a case share: the keys and what is done with each. For api/case_*.c only. */

/* Keys 0 ... ISCHIA_PARAM_COUNT - 1 are the seven inputs, then these, then one for each option,
 * then one for the standard deviation of each input. */
enum case_key {
    KEY_SUBJECT = ISCHIA_PARAM_COUNT,
    KEY_SIDE,
    KEY_MEASURED_AT,
    KEY_LABEL,
    KEY_RESOLUTION,
    KEY_MODEL,
    KEY_SKIN,
    KEY_SD,
    KEY_FIRST_OPTION,
    KEY_FIRST_SD = KEY_FIRST_OPTION + ISCHIA_OPTION_COUNT,
    KEY_COUNT = KEY_FIRST_SD + ISCHIA_PARAM_COUNT,
    KEY_NONE = -1
};

/* The key with this spelling, KEY_NONE when there is none. */
int case_key_find(const char *spelling);
const char *case_key_name(int key); /* canonical: "muM", "skin.mu" */

/* Notes that a key was given; false, with a fault at /spelling, when it was before. */
bool case_key_first_time(struct case_doc_fields *fields, int key, const char *spelling);

/* Faults with what was given and what is accepted. `given` is how the value was written. */
void case_key_refuse(struct case_doc_fields *fields, int key, const char *code, const char *given);
void case_key_unknown(struct case_doc_fields *fields, const char *pointer, const char *spelling);

/* A number for an input, an option or a standard deviation; a text for one of the others. */
void case_key_set_number(struct case_doc_fields *fields, int key, double value);
void case_key_set_text(struct case_doc_fields *fields, int key, const char *value);

#endif
