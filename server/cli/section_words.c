/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/section_words.h"

enum ischia_code section_write(FILE *out, const struct ischia_case *c,
                               const struct ischia_field *field, enum language language,
                               struct ischia_error *err)
{
    char description[640];
    const struct ischia_section_labels labels = {
        .language = language_tags[language],
        .title = words_get(language, WORD_DAEMON_SECTION_TITLE),
        .heading = words_get(language, WORD_DAEMON_SECTION_HEADING),
        .description =
            words_fill(description, sizeof description, language, WORD_DAEMON_SECTION_DESCRIPTION,
                       WORDS(word_fixed("max", ISCHIA_SECTION_E_SHEAR_MAX, 2),
                             word_fixed("threshold", ISCHIA_E_SHEAR_THRESHOLD, 2))),
        .plane = {words_get(language, WORD_DAEMON_SECTION_Y0),
                  words_get(language, WORD_DAEMON_SECTION_X0)},
        .strain = words_get(language, WORD_DAEMON_SECTION_STRAIN),
        .index = words_get(language, WORD_DAEMON_SECTION_INDEX),
        .threshold = words_get(language, WORD_DAEMON_SECTION_THRESHOLD),
        .bone = words_get(language, WORD_DRAWING_BONE),
        .fat = words_get(language, WORD_DRAWING_FAT),
        .skin = words_get(language, WORD_DRAWING_SKIN),
        .seat = words_get(language, WORD_DRAWING_SEAT),
        .decimal_mark = words_get(language, WORD_NUMBER_DECIMAL)[0],
    };
    return ischia_write_section_svg(out, c, field, &labels, err);
}

enum ischia_code section_write_english(FILE *out, const struct ischia_case *c,
                                       const struct ischia_field *field, struct ischia_error *err)
{
    return section_write(out, c, field, LANGUAGE_EN, err);
}
