/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/case_words.h"

#include <stdio.h>
#include <string.h>

#include "api/text.h"

const struct param_words param_words[ISCHIA_PARAM_COUNT] = {
    [ISCHIA_R1] = {WORD_DAEMON_PARAM_R1_NAME, WORD_DAEMON_PARAM_R1_HELP},
    [ISCHIA_R2] = {WORD_DAEMON_PARAM_R2_NAME, WORD_DAEMON_PARAM_R2_HELP},
    [ISCHIA_EM] = {WORD_DAEMON_PARAM_EM_NAME, WORD_DAEMON_PARAM_EM_HELP},
    [ISCHIA_EF] = {WORD_DAEMON_PARAM_EF_NAME, WORD_DAEMON_PARAM_EF_HELP},
    [ISCHIA_MUM] = {WORD_DAEMON_PARAM_MUM_NAME, WORD_DAEMON_PARAM_MUM_HELP},
    [ISCHIA_MUF] = {WORD_DAEMON_PARAM_MUF_NAME, WORD_DAEMON_PARAM_MUF_HELP},
    [ISCHIA_F] = {WORD_DAEMON_PARAM_F_NAME, WORD_DAEMON_PARAM_F_HELP},
};

const enum word option_words[ISCHIA_OPTION_COUNT] = {
    [ISCHIA_SKIN_MU] = WORD_DAEMON_OPTION_SKIN_MU,
    [ISCHIA_SKIN_THICKNESS] = WORD_DAEMON_OPTION_SKIN_THICKNESS,
    [ISCHIA_L_OVER_H] = WORD_DAEMON_OPTION_MODEL_L_OVER_H,
    [ISCHIA_BULK_RATIO] = WORD_DAEMON_OPTION_MODEL_BULK_RATIO,
    [ISCHIA_FRICTION] = WORD_DAEMON_OPTION_MODEL_FRICTION,
    [ISCHIA_R2_SURFACE] = WORD_DAEMON_OPTION_MODEL_R2_SURFACE,
    [ISCHIA_EMBED_OVER_R1] = WORD_DAEMON_OPTION_MODEL_EMBED_OVER_R1,
};

static const char *const codes[ISCHIA_CASE_FAULT_KIND_COUNT] = {
    [ISCHIA_CASE_MISSING] = "missing",
    [ISCHIA_CASE_OUT_OF_RANGE] = "out_of_range",
    [ISCHIA_CASE_ORDER] = "inconsistent",
    [ISCHIA_CASE_UNSTUDIED] = "outside_study_range",
};

const char *case_spaced_unit(const char *unit, char buffer[16])
{
    if (strcmp(unit, "1") == 0) return "";
    (void)snprintf(buffer, 16, " %s", unit);
    return buffer;
}

/* The number that a fault is about, as its table has it. */
struct subject {
    char key[48], pointer[48];
    const char *unit;
    double value, accepted_min, accepted_max, studied_min, studied_max;
};

static void find_subject(struct subject *ret, const struct ischia_case *c, int index)
{
    if (index < ISCHIA_PARAM_COUNT) {
        const struct ischia_param_info *p = &ischia_params[index];
        *ret = (struct subject){.unit = p->unit,
                                .value = c->param[index],
                                .accepted_min = p->accepted_min,
                                .accepted_max = p->accepted_max,
                                .studied_min = p->studied_min,
                                .studied_max = p->studied_max};
        (void)snprintf(ret->key, sizeof ret->key, "%s", p->key);
        (void)snprintf(ret->pointer, sizeof ret->pointer, "/%s", p->key);
        return;
    }
    const struct ischia_option_info *o = &ischia_options[index - ISCHIA_PARAM_COUNT];
    *ret = (struct subject){.unit = o->unit,
                            .value = c->option[index - ISCHIA_PARAM_COUNT],
                            .accepted_min = o->accepted_min,
                            .accepted_max = o->accepted_max};
    (void)snprintf(ret->key, sizeof ret->key, "%s.%s", o->group, o->key);
    (void)snprintf(ret->pointer, sizeof ret->pointer, "/%s/%s", o->group, o->key);
}

void case_fault_words(struct ischia_fault *ret, enum language language, const struct ischia_case *c,
                      const struct ischia_case_fault *fault)
{
    struct subject s;
    char unit[16];
    find_subject(&s, c, fault->index);
    (void)snprintf(ret->pointer, sizeof ret->pointer, "%s", s.pointer);
    (void)snprintf(ret->code, sizeof ret->code, "%s", codes[fault->kind]);
    switch (fault->kind) {
    case ISCHIA_CASE_MISSING:
        (void)words_fill(ret->detail, sizeof ret->detail, language, WORD_DAEMON_FAULT_MISSING,
                         WORDS(word_text("key", s.key), word_number("min", s.accepted_min, 6),
                               word_number("max", s.accepted_max, 6), word_text("unit", s.unit)));
        break;
    case ISCHIA_CASE_ORDER:
        (void)words_fill(
            ret->detail, sizeof ret->detail, language, WORD_DAEMON_FAULT_ORDER,
            WORDS(word_number("R2", c->param[ISCHIA_R2], text_digits(c->param[ISCHIA_R2])),
                  word_number("R1", c->param[ISCHIA_R1], text_digits(c->param[ISCHIA_R1]))));
        break;
    case ISCHIA_CASE_UNSTUDIED:
        (void)words_fill(ret->detail, sizeof ret->detail, language, WORD_DAEMON_FAULT_UNSTUDIED,
                         WORDS(word_text("key", s.key),
                               word_number("value", s.value, text_digits(s.value)),
                               word_number("min", s.studied_min, 6),
                               word_number("max", s.studied_max, 6), word_text("unit", s.unit)));
        break;
    default:
        (void)words_fill(
            ret->detail, sizeof ret->detail, language, WORD_DAEMON_FAULT_RANGE,
            WORDS(word_text("key", s.key), word_number("value", s.value, text_digits(s.value)),
                  word_number("min", s.accepted_min, 6), word_number("max", s.accepted_max, 6),
                  word_text("unit", case_spaced_unit(s.unit, unit))));
    }
}

size_t case_warnings(const struct ischia_case *c, enum language language,
                     struct ischia_fault ret_warnings[ISCHIA_PARAM_COUNT])
{
    struct ischia_case_fault found[ISCHIA_PARAM_COUNT];
    const size_t count = ischia_case_warnings(c, found);
    for (size_t i = 0; i < count; i++) case_fault_words(&ret_warnings[i], language, c, &found[i]);
    return count;
}
