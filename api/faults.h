/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_FAULTS_H
#define ISCHIA_API_FAULTS_H

#include <stdbool.h>
#include <stddef.h>

#include "api/words.h"
#include "solver/case.h"

/*
 * All the bad fields of a document at once: what readers of documents report, what problem
 * documents show as "errors", and what the command line prints one to a line.
 *
 * Codes: missing, unknown, duplicate, wrong_type, not_finite, too_many, out_of_range, inconsistent,
 * not_allowed (a word that is not one of those accepted), malformed (text of the wrong form),
 * unsupported.
 */
struct ischia_fault {
    char pointer[48]; /* RFC 6901: "/muM", "/skin/mu" */
    char code[24];
    char detail[160]; /* in words */
};

enum { DOC_FAULTS_MAX = 32, DOC_POINTER_BYTES = sizeof((struct ischia_fault *)0)->pointer };

struct doc_faults {
    struct ischia_fault item[DOC_FAULTS_MAX];
    size_t count;           /* of item                                          */
    size_t dropped;         /* how many more there were than item has room for  */
    enum language language; /* of the details                                */
};

/* An empty list, in English. */
void doc_faults_init(struct doc_faults *ret);

/* Adds one fault. pointer is cut to its room between characters; the detail is printf-style and is
 * made printable (text_printable). */
__attribute__((format(printf, 4, 5))) void doc_faults_add(struct doc_faults *faults,
                                                          const char *pointer, const char *code,
                                                          const char *format, ...);

/* The same in the words of the list's language. */
void doc_faults_say(struct doc_faults *faults, const char *pointer, const char *code,
                    enum word word, const struct word_value *values);

/* Adds faults that the solver's tables found (ischia_case_faults), except those whose pointer
 * already has one: a value that could not be read is not also missing. */
void doc_faults_add_case(struct doc_faults *faults, const struct ischia_case *c);

/* True when a fault at exactly this pointer is among the items. */
bool doc_faults_has(const struct doc_faults *faults, const char *pointer);

/* Appends "/token" to an RFC 6901 pointer in a buffer of size bytes, with ~ and / escaped; a token
 * that does not fit is cut. Returns buffer. parent may be "" and may be buffer itself. */
const char *doc_pointer(char *buffer, size_t size, const char *parent, const char *token);

#endif
