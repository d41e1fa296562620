/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/faults.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "api/case_words.h"
#include "api/text.h"

void doc_faults_init(struct doc_faults *ret)
{
    ret->count = 0;
    ret->dropped = 0;
    ret->language = LANGUAGE_EN;
}

/* The next free item, NULL (and one more dropped) when there is none. */
static struct ischia_fault *next_item(struct doc_faults *faults)
{
    if (faults->count == DOC_FAULTS_MAX) {
        faults->dropped++;
        return NULL;
    }
    return &faults->item[faults->count++];
}

void doc_faults_add(struct doc_faults *faults, const char *pointer, const char *code,
                    const char *format, ...)
{
    char detail[512]; /* longer than the room, so that the cut is text_printable's */
    va_list arguments;
    struct ischia_fault *item = next_item(faults);
    if (item == NULL) return;
    va_start(arguments, format);
    (void)vsnprintf(detail, sizeof detail, format, arguments);
    va_end(arguments);
    (void)text_printable(pointer, item->pointer, sizeof item->pointer);
    (void)snprintf(item->code, sizeof item->code, "%s", code);
    (void)text_printable(detail, item->detail, sizeof item->detail);
}

void doc_faults_say(struct doc_faults *faults, const char *pointer, const char *code,
                    enum word word, const struct word_value *values)
{
    char detail[512];
    doc_faults_add(faults, pointer, code, "%s",
                   words_fill(detail, sizeof detail, faults->language, word, values));
}

bool doc_faults_has(const struct doc_faults *faults, const char *pointer)
{
    for (size_t i = 0; i < faults->count; i++)
        if (strcmp(faults->item[i].pointer, pointer) == 0) return true;
    return false;
}

void doc_faults_add_case(struct doc_faults *faults, const struct ischia_case *c)
{
    struct ischia_case_fault found[ISCHIA_CASE_FAULTS_MAX];
    const size_t count = ischia_case_faults(c, found);
    for (size_t i = 0; i < count; i++) {
        struct ischia_fault fault;
        case_fault_words(&fault, faults->language, c, &found[i]);
        if (doc_faults_has(faults, fault.pointer)) continue;
        struct ischia_fault *item = next_item(faults);
        if (item != NULL) *item = fault;
    }
}

const char *doc_pointer(char *buffer, size_t size, const char *parent, const char *token)
{
    size_t used = strlen(parent);
    if (buffer != parent) (void)snprintf(buffer, size, "%s", parent);
    if (used + 2 > size) return buffer;
    buffer[used++] = '/';
    for (const char *c = token; *c != '\0' && used + 3 < size; c++) {
        const char *escape = *c == '~' ? "~0" : *c == '/' ? "~1" : NULL;
        buffer[used++] = escape != NULL ? escape[0] : *c;
        if (escape != NULL) buffer[used++] = escape[1];
    }
    buffer[used] = '\0';
    return buffer;
}
