/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_CASE_DOC_H
#define ISCHIA_API_CASE_DOC_H

#include <stdbool.h>
#include <stddef.h>

#include "api/faults.h"
#include "api/json.h"
#include "solver/case.h"
#include "solver/error.h"

/*
 * What a client asks for: one side's numbers, and who, which side and when. As flat JSON, as an
 * HTML form's body, and as a row of a CSV file: the same keys, the same faults.
 */

enum ischia_side { ISCHIA_SIDE_NONE, ISCHIA_SIDE_LEFT, ISCHIA_SIDE_RIGHT, ISCHIA_SIDE_COUNT };
extern const char *const ischia_side_names[ISCHIA_SIDE_COUNT]; /* "", "left", "right" */

enum {
    ISCHIA_SUBJECT_BYTES = 65,         /* 64 ASCII characters                    */
    ISCHIA_LABEL_CHARACTERS_MAX = 200, /* Unicode characters, no control characters */
    ISCHIA_LABEL_BYTES = 4 * 200 + 1,
    ISCHIA_MEASURED_AT_BYTES = 40,
    ISCHIA_PRESET_BYTES = 32
};

struct ischia_request {
    struct ischia_case values;          /* the seven inputs, options, resolution */
    char subject[ISCHIA_SUBJECT_BYTES]; /* "": not given                          */
    enum ischia_side side;
    char label[ISCHIA_LABEL_BYTES];             /* UTF-8; "": not given                   */
    char measured_at[ISCHIA_MEASURED_AT_BYTES]; /* RFC 3339 date or time; "": not given   */
    char preset[ISCHIA_PRESET_BYTES];           /* name of the set of options started from */
    bool has_sd;                                /* the inputs are known up to these:       */
    bool sd_typical;                            /* sampling_sd_typical's, or               */
    double sd[ISCHIA_PARAM_COUNT];              /* in the unit of the input; 0: exactly    */
};

/* The standard deviations of a good request; all 0 when none were given. */
void case_doc_sd(const struct ischia_request *request, double ret[ISCHIA_PARAM_COUNT]);

/* Everything at its default, all seven inputs missing (NaN). */
void ischia_request_init(struct ischia_request *ret);

/*
 * Readers. Each fills *ret as far as it can and adds every fault it finds to *faults, so the
 * request is good when the code is ISCHIA_OK and faults->count is 0, and only then.
 * Errors: as json_parse (ISCHIA_E_INPUT is "not JSON at all": HTTP 400; faults: 422).
 */
ISCHIA_MUST_CHECK enum ischia_code case_doc_read(struct ischia_request *ret, const char *json,
                                                 size_t length, const struct json_limits *limits,
                                                 struct doc_faults *faults,
                                                 struct ischia_error *err);

/* The same from a parsed value; never fails, only adds faults. */
void case_doc_read_value(struct ischia_request *ret, const struct json *value,
                         struct doc_faults *faults);

/* What holds for many cases at once, unless one says otherwise; NULL: the usual default. */
struct case_doc_defaults {
    const char *resolution;
    const char *model; /* name of a set of options */
};
/* The same over such defaults; a value that names what they name is a fault ("duplicate"). value
 * NULL: an empty object. */
void case_doc_read_value_over(struct ischia_request *ret, const struct case_doc_defaults *defaults,
                              const struct json *value, struct doc_faults *faults);

/*
 * application/x-www-form-urlencoded. Keys as in JSON; options of the groups as "skin.mu" and
 * "model.friction", standard deviations as "sd.R2"; a number may be typed as people type it, with
 * a decimal comma or point (see text_to_typed_number); an empty value is the same as none.
 * ISCHIA_E_INPUT: a broken escape, invalid UTF-8, a NUL.
 */
ISCHIA_MUST_CHECK enum ischia_code
case_doc_read_form(struct ischia_request *ret, const char *body, size_t length, size_t bytes_max,
                   struct doc_faults *faults, struct ischia_error *err);

/*
 * Field by field, for forms and CSV rows: init, set each, end. The key is one of JSON's keys in
 * any accepted spelling or "group.key" or "sd.key"; space around a value is ignored and an empty
 * value is none.
 */
struct case_doc_fields {
    struct ischia_request *request;
    struct doc_faults *faults;
    unsigned seen;                      /* bit k: key k of the table was given             */
    bool typed;                         /* a person typed the numbers; off: as in JSON     */
    double option[ISCHIA_OPTION_COUNT]; /* NaN: not given; applied over the preset at the end */
    double sd[ISCHIA_PARAM_COUNT];      /* NaN: not given; over "typical" at the end        */
};
void case_doc_fields_init(struct case_doc_fields *ret, struct ischia_request *request,
                          struct doc_faults *faults); /* not typed */
void case_doc_fields_set(struct case_doc_fields *fields, const char *key, const char *value);
void case_doc_fields_set_defaults(struct case_doc_fields *fields,
                                  const struct case_doc_defaults *defaults);
void case_doc_fields_end(struct case_doc_fields *fields); /* options, limits, what is missing */

/* The canonical spelling of a key that fields_set knows ("muM" for U+00B5 M, "skin.mu"), static;
 * NULL when there is no such key. */
const char *case_doc_canonical_key(const char *key);

/* The canonical key that a CSV column stands for: as above, or with its unit behind it, as in
 * "R1_mm" and "muM_kPa"; NULL when it is some other column. */
const char *case_doc_column_key(const char *column);

/* The known key that a mistyped one probably means, static; NULL when none is near. */
const char *case_doc_nearest_key(const char *key);

/* Writers, into the object that is open in out; reading back gives the same request bit by bit. */
void case_doc_write(struct json_out *out, const struct ischia_request *request); /* all keys      */
void case_doc_write_parameters(struct json_out *out, const struct ischia_case *c); /* the seven   */
void case_doc_write_sd(struct json_out *out,
                       const struct ischia_request *request); /* nothing when not given */
void case_doc_write_options(struct json_out *out,
                            const struct ischia_request *request); /* skin, resolution, model */

#endif
