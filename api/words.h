/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_WORDS_H
#define ISCHIA_API_WORDS_H

#include <stdbool.h>
#include <stddef.h>

#include "words/keys.h"

/*
 * The texts of words/LANGUAGE.json. A text may name values in braces, "{min} to {max} {unit}",
 * which words_fill puts in, numbers with the language's decimal mark. English is language 0: what a
 * structure of zeros speaks, and what documents that are kept are written in.
 */

extern const char *const language_tags[LANGUAGE_COUNT + 1]; /* "en", …, NULL at the end */
extern const char *const words_table[LANGUAGE_COUNT][WORD_COUNT];

enum { WORDS_NUMBER_BYTES = 48 };

/* The text of a word, static storage. */
static inline const char *words_get(enum language language, enum word word)
{
    return words_table[language][word];
}

/* True when tag is one of language_tags, which *ret then is. */
bool words_language(const char *tag, enum language *ret);

/* What stands for "{name}". Made by the four functions below; name and text are borrowed. */
struct word_value {
    const char *name; /* NULL: the end of a list                                       */
    const char *text; /* NULL: the number                                              */
    double number;
    int digits;
    bool fixed; /* digits are decimals, otherwise significant digits                   */
};
#define WORDS(...) ((const struct word_value[]){__VA_ARGS__, {0}})

static inline struct word_value word_text(const char *name, const char *text)
{
    return (struct word_value){.name = name, .text = text};
}

/* Up to so many significant digits, as printf's %g has them. */
static inline struct word_value word_number(const char *name, double number, int digits)
{
    return (struct word_value){.name = name, .number = number, .digits = digits};
}

static inline struct word_value word_fixed(const char *name, double number, int decimals)
{
    return (struct word_value){.name = name, .number = number, .digits = decimals, .fixed = true};
}

static inline struct word_value word_count(const char *name, long long count)
{
    return word_fixed(name, (double)count, 0);
}

/* Writes the text with its values (ended by one without a name, see WORDS; NULL: none), cut to size
 * between characters. A placeholder without a value stays as it stands. Returns ret. */
const char *words_fill(char *ret, size_t size, enum language language, enum word word,
                       const struct word_value *values);

/* A number as people of that language write it. Returns ret. */
const char *words_fixed(char ret[WORDS_NUMBER_BYTES], enum language language, double number,
                        int decimals);
const char *words_number(char ret[WORDS_NUMBER_BYTES], enum language language, double number,
                         int digits);

#endif
