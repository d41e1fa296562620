/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/cohort_rows.h"

#include <stdlib.h>
#include <string.h>

#include "api/result_csv.h"
#include "api/uncertainty_csv.h"

/* Who, which and when are kept, not judged: a cohort's own columns may use these words freely. */
static bool is_kept_only(const char *key)
{
    static const char *const kept[] = {"subject", "side", "measured_at", "label", "skin"};
    for (size_t i = 0; i < sizeof kept / sizeof kept[0]; i++)
        if (strcmp(key, kept[i]) == 0) return true;
    return false;
}

static bool is_sd(const char *key) { return strcmp(key, "sd") == 0 || strncmp(key, "sd.", 3) == 0; }

static const char *meaning_of(const char *column, enum cohort_sd sd)
{
    const char *key = case_doc_column_key(column);
    if (key == NULL || is_kept_only(key)) return NULL;
    return is_sd(key) && sd == COHORT_SD_KEPT ? NULL : key;
}

static bool is_result_column(const char *column, bool has_sd)
{
    for (int i = 0; i < RESULT_CSV_COLUMN_COUNT; i++)
        if (strcmp(column, result_csv_columns[i]) == 0) return true;
    return has_sd && uncertainty_csv_has_column(column);
}

/* The column's name without the space around it, which a spreadsheet may have left. */
static const char *trimmed(const char *name, char buffer[64])
{
    name += strspn(name, " \t");
    size_t length = strlen(name);
    while (length > 0 && strchr(" \t", name[length - 1]) != NULL) length--;
    if (length >= 64) return name;
    (void)snprintf(buffer, 64, "%.*s", (int)length, name);
    return buffer;
}

static int column_of(const struct cohort_columns *columns, const char *key)
{
    for (int i = 0; i < columns->count; i++)
        if (columns->key[i] != NULL && strcmp(columns->key[i], key) == 0) return i;
    return -1;
}

static void take_column(struct cohort_columns *columns, const char *name, struct doc_faults *faults)
{
    char buffer[64], pointer[DOC_POINTER_BYTES];
    const char *plain = trimmed(name, buffer);
    const char *key = meaning_of(plain, columns->sd);
    (void)doc_pointer(pointer, sizeof pointer, "", plain);
    if (key != NULL && column_of(columns, key) >= 0)
        doc_faults_add(faults, pointer, "duplicate", "column %s: %s is there more than once", plain,
                       key);
    columns->has_sd = columns->has_sd || (key != NULL && is_sd(key));
    columns->key[columns->count++] = key;
}

static void find_result_columns(const struct cohort_columns *columns, const struct csv_row *row,
                                struct doc_faults *faults)
{
    char buffer[64], pointer[DOC_POINTER_BYTES];
    for (int i = 0; i < row->count; i++) {
        const char *plain = trimmed(row->field[i], buffer);
        (void)doc_pointer(pointer, sizeof pointer, "", plain);
        if (is_result_column(plain, columns->has_sd))
            doc_faults_add(faults, pointer, "not_allowed",
                           "column %s is the name of a result column; rename or remove it", plain);
    }
}

static void find_missing(const struct cohort_columns *columns, const struct csv_row *row,
                         struct doc_faults *faults)
{
    char pointer[DOC_POINTER_BYTES];
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct ischia_param_info *p = &ischia_params[i];
        (void)doc_pointer(pointer, sizeof pointer, "", p->key);
        if (column_of(columns, p->key) < 0)
            doc_faults_add(faults, pointer, "missing", "column %s is missing (or %s_%s)", p->key,
                           p->key, p->unit);
    }
    if (row->count == 1 && strpbrk(row->field[0], ";\t") != NULL)
        doc_faults_add(faults, "", "malformed",
                       "there is one column only; separate columns by commas");
}

/* The fields as CSV, as many as the header has. */
static void echo(struct text_out *out, const struct csv_row *row, int count)
{
    for (int i = 0; i < count; i++) csv_put_text(out, i < row->count ? row->field[i] : "", i == 0);
}

enum ischia_code cohort_columns_init(struct cohort_columns *ret, const struct csv_row *row,
                                     enum cohort_sd sd, struct doc_faults *faults,
                                     struct ischia_error *err)
{
    struct text_out header;
    ret->sd = sd;
    ret->has_sd = sd == COHORT_SD_TYPICAL;
    ret->count = 0;
    ret->header = NULL;
    for (int i = 0; i < row->count; i++) take_column(ret, row->field[i], faults);
    find_result_columns(ret, row, faults);
    find_missing(ret, row, faults);
    CHECK(faults->count == 0, err, ISCHIA_E_INPUT, "the header cannot be used");
    text_out_init(&header);
    echo(&header, row, row->count);
    result_csv_put_header(&header, false);
    if (ret->has_sd) uncertainty_csv_put_header(&header);
    csv_end_row(&header);
    return text_out_take(&header, &ret->header, NULL, err);
}

void cohort_columns_finish(struct cohort_columns *columns)
{
    free(columns->header);
    columns->header = NULL;
}

static void read_case(const struct cohort_columns *columns,
                      const struct case_doc_defaults *defaults, const struct csv_row *row,
                      struct ischia_request *ret, struct doc_faults *faults)
{
    struct case_doc_fields fields;
    const struct case_doc_defaults missing = {
        column_of(columns, "resolution") < 0 ? defaults->resolution : NULL,
        column_of(columns, "model") < 0 ? defaults->model : NULL,
    };
    case_doc_fields_init(&fields, ret, faults);
    case_doc_fields_set_defaults(&fields, &missing);
    if (columns->sd == COHORT_SD_TYPICAL && column_of(columns, "sd") < 0)
        case_doc_fields_set(&fields, "sd", "typical");
    for (int i = 0; i < columns->count && i < row->count; i++)
        if (columns->key[i] != NULL) case_doc_fields_set(&fields, columns->key[i], row->field[i]);
    case_doc_fields_end(&fields);
}

enum ischia_code
cohort_row_read(const struct cohort_columns *columns, const struct case_doc_defaults *defaults,
                const struct csv_row *row, char **ret_echo, struct ischia_request *ret,
                struct doc_faults *faults, struct ischia_error *err)
{
    struct text_out out;
    text_out_init(&out);
    echo(&out, row, columns->count);
    TRY(text_out_take(&out, ret_echo, NULL, err));
    if (row->count != columns->count && row->count > 0)
        doc_faults_add(faults, "", "malformed", "the row has %d fields and the header %d",
                       row->count, columns->count);
    else
        read_case(columns, defaults, row, ret, faults);
    return ISCHIA_OK;
}
