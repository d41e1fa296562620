/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/words.h"

#include <stdio.h>
#include <string.h>

bool words_language(const char *tag, enum language *ret)
{
    for (int l = 0; l < LANGUAGE_COUNT; l++)
        if (strcmp(tag, language_tags[l]) == 0) {
            *ret = (enum language)l;
            return true;
        }
    return false;
}

/* ---- numbers ---- */

static const char *with_mark(char *number, enum language language)
{
    char *point = strchr(number, '.');
    if (point != NULL) *point = words_get(language, WORD_NUMBER_DECIMAL)[0];
    return number;
}

const char *words_fixed(char ret[WORDS_NUMBER_BYTES], enum language language, double number,
                        int decimals)
{
    (void)snprintf(ret, WORDS_NUMBER_BYTES, "%.*f", decimals, number);
    return with_mark(ret, language);
}

const char *words_number(char ret[WORDS_NUMBER_BYTES], enum language language, double number,
                         int digits)
{
    (void)snprintf(ret, WORDS_NUMBER_BYTES, "%.*g", digits, number);
    return with_mark(ret, language);
}

/* ---- texts with values ---- */

static const char *value_text(const struct word_value *value, enum language language,
                              char buffer[WORDS_NUMBER_BYTES])
{
    if (value->text != NULL) return value->text;
    return value->fixed ? words_fixed(buffer, language, value->number, value->digits)
                        : words_number(buffer, language, value->number, value->digits);
}

static const struct word_value *find(const struct word_value *values, const char *name,
                                     size_t length)
{
    for (; values != NULL && values->name != NULL; values++)
        if (strlen(values->name) == length && memcmp(values->name, name, length) == 0)
            return values;
    return NULL;
}

/* The length of the "{name}" that text begins with, 0 when it begins with none. */
static size_t placeholder(const char *text)
{
    const size_t length = text[0] == '{' ? strcspn(text, "}") : 0;
    return length > 1 && text[length] == '}' ? length + 1 : 0;
}

struct cut {
    char *text;
    size_t used, size;
};

/* All of it that fits, whole characters only; nothing fits after a cut. */
static void append(struct cut *out, const char *text, size_t length)
{
    const size_t room = out->size - 1 - out->used;
    size_t taken = length <= room ? length : room;
    while (taken < length && taken > 0 && ((unsigned char)text[taken] & 0xC0) == 0x80) taken--;
    memcpy(out->text + out->used, text, taken);
    out->used += taken;
    if (taken < length) out->size = out->used + 1;
}

const char *words_fill(char *ret, size_t size, enum language language, enum word word,
                       const struct word_value *values)
{
    char number[WORDS_NUMBER_BYTES];
    struct cut out = {ret, 0, size};
    for (const char *text = words_get(language, word); *text != '\0';) {
        const size_t named = placeholder(text);
        const struct word_value *value = named > 0 ? find(values, text + 1, named - 2) : NULL;
        const size_t plain = value != NULL ? named : 1 + strcspn(text + 1, "{");
        const char *shown = value != NULL ? value_text(value, language, number) : text;
        append(&out, shown, value != NULL ? strlen(shown) : plain);
        text += plain;
    }
    ret[out.used] = '\0';
    return ret;
}
