/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_SECTION_WORDS_H
#define ISCHIA_SERVER_CLI_SECTION_WORDS_H

#include <stdio.h>

#include "api/words.h"
#include "solver/solver.h"

/* ischia_write_section_svg with the words of a language. */
ISCHIA_MUST_CHECK enum ischia_code section_write(FILE *out, const struct ischia_case *c,
                                                 const struct ischia_field *field,
                                                 enum language language, struct ischia_error *err);

/* The same in English, as the command line writes it (field_writer). */
ISCHIA_MUST_CHECK enum ischia_code section_write_english(FILE *out, const struct ischia_case *c,
                                                         const struct ischia_field *field,
                                                         struct ischia_error *err);

#endif
