/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_FIELDS_H
#define ISCHIA_API_FIELDS_H

#include <stdbool.h>
#include <stddef.h>

#include "api/json.h"

/*
 * One table describes a document: the same rows write a struct as JSON and read it back.
 * A table ends with a row whose key is NULL.
 */
enum field_kind {
    FIELD_NUMBER,         /* double, finite                                             */
    FIELD_NUMBER_OR_NULL, /* double; NaN <-> null                                       */
    FIELD_NUMBER_OR_NONE, /* double; NaN: the member is left out                        */
    FIELD_NUMBERS,        /* double[count] <-> array of exactly count numbers           */
    FIELD_CONSTANT,       /* constant: written, not read                                */
    FIELD_INTEGER,        /* int                                                        */
    FIELD_BOOL,           /* bool                                                       */
    FIELD_TEXT,           /* char[size]                                                 */
    FIELD_TEXT_OR_NULL,   /* char[size]; "" <-> null                                    */
    FIELD_TEXT_OR_NONE,   /* char[size]; "": the member is left out */
    FIELD_WORD,           /* int (an enum), one of words[count]                         */
    FIELD_WORD_OR_NULL,   /* the same; 0 <-> null, words[0] is never written            */
    FIELD_OBJECT,         /* a struct described by fields                               */
    FIELD_LIST,           /* an array of at most count structs of size bytes described by fields;
                             an int at length_offset says how many                      */
    FIELD_CUSTOM          /* custom_write; custom_read, NULL: not read                  */
};

struct field {
    const char *key;
    enum field_kind kind;
    size_t offset; /* of the member within its struct */
    size_t size;
    int count;
    size_t length_offset;
    double constant;
    const char *const *words;
    const struct field *fields;
    /* FIELD_OBJECT only, NULL allowed. present: asked with the struct that holds the member; false
     * writes null. set_present: told whether an object (true) or null (false) was read; without it,
     * null is accepted only if present is given. */
    bool (*present)(const void *base);
    void (*set_present)(void *base, bool present);
    void (*custom_write)(struct json_out *out, const char *key, const void *base);
    bool (*custom_read)(const struct json *value, void *base); /* false: of the wrong kind */
    bool optional; /* may be missing when read: the member keeps its value */
};

/* Writes the members of the struct at base into the object that is open in out. */
void fields_write(struct json_out *out, const struct field *fields, const void *base);

/* Reads an object into the struct at base; keys that the table does not name are ignored. Adds a
 * fault for each member that is missing or of the wrong kind; those keep their value. pointer is
 * that of the object. */
void fields_read(const struct json *object, const struct field *fields, void *ret_base,
                 const char *pointer, struct doc_faults *faults);

#endif
