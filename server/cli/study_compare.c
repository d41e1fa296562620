/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One file: how well pressures and the analytic baseline predict the strain. Two files: how far B
 * (the reference, as a rule) agrees with A (the model under test), and the same for each of them.
 * Correlations join any two quantities; errors and Bland-Altman limits only two readings of one.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/csv.h"
#include "api/json.h"
#include "server/cli/files.h"
#include "server/cli/study.h"
#include "server/cli/study_table.h"
#include "solver/case.h"
#include "solver/study/hertz.h"
#include "solver/study/statistics.h"

enum { KEYS_MAX = 4, SERIES_MAX = 8, PAIRS_MAX = 8, NAME_BYTES = 96 };

struct arguments {
    const char *file[2];
    int files;
    const char *column[2];
    const char *key_list, *output, *joined;
};

/* One quantity over the joined rows; NaN where a row has none. */
struct series {
    char name[NAME_BYTES];
    double *value; /* [rows] */
};

struct pair {
    int a, b;      /* series */
    bool readings; /* two readings of one quantity: errors and limits make sense */
    struct statistics_pair statistics;
    char why_not[128]; /* "" when there are statistics */
};

struct comparison {
    const struct arguments *arguments;
    struct study_table table[2];
    char *key_list; /* a copy, cut into the keys */
    int key_count;
    const char *key[KEYS_MAX];
    size_t rows;       /* joined */
    size_t *row_of[2]; /* [rows] */
    size_t unmatched;
    int series_count, pair_count;
    struct series series[SERIES_MAX];
    struct pair pair[PAIRS_MAX];
    bool *hertz_valid; /* [rows], of file A */
    size_t hertz_valid_count;
};

/* ---- joining ---- */

static bool both_have(const struct comparison *c, const char *name)
{
    for (int f = 0; f < c->arguments->files; f++)
        if (study_table_column(&c->table[f], name) < 0) return false;
    return true;
}

static enum ischia_code choose_keys(struct comparison *c, struct ischia_error *err)
{
    if (c->arguments->key_list != NULL) {
        char *rest = c->key_list = strdup(c->arguments->key_list);
        CHECK(rest != NULL, err, ISCHIA_E_MEMORY, "out of memory for the keys");
        for (char *name; (name = strsep(&rest, ",")) != NULL;) {
            CHECK(c->key_count < KEYS_MAX && both_have(c, name), err, ISCHIA_E_INPUT,
                  "not every file has the key column \"%s\"", name);
            c->key[c->key_count++] = name;
        }
    } else if (both_have(c, "subject") && both_have(c, "side")) {
        c->key[c->key_count++] = "subject";
        c->key[c->key_count++] = "side";
    } else if (both_have(c, "row")) {
        c->key[c->key_count++] = "row";
    }
    return ISCHIA_OK;
}

static bool same_keys(const struct comparison *c, size_t a, size_t b)
{
    for (int k = 0; k < c->key_count; k++) {
        const int ca = study_table_column(&c->table[0], c->key[k]);
        const int cb = study_table_column(&c->table[1], c->key[k]);
        if (strcmp(study_table_text(&c->table[0], a, ca), study_table_text(&c->table[1], b, cb)) !=
            0)
            return false;
    }
    return true;
}

/* The row of B for a row of A, or B's row count. Without keys: the same place. Files are usually in
 * the same order, so the search starts there. */
static size_t partner(const struct comparison *c, size_t a)
{
    const size_t rows = c->table[1].rows;
    if (c->key_count == 0) return a < rows ? a : rows;
    for (size_t i = 0; i < rows; i++) {
        const size_t b = (a + i) % rows;
        if (same_keys(c, a, b)) return b;
    }
    return rows;
}

static enum ischia_code join(struct comparison *c, struct ischia_error *err)
{
    const size_t rows = c->table[0].rows;
    TRY(choose_keys(c, err));
    for (int f = 0; f < 2; f++) {
        c->row_of[f] = calloc(rows + 1, sizeof(size_t));
        CHECK(c->row_of[f] != NULL, err, ISCHIA_E_MEMORY, "out of memory for %zu rows", rows);
    }
    for (size_t a = 0; a < rows; a++) {
        const size_t b = c->arguments->files == 2 ? partner(c, a) : 0;
        const bool matched = c->arguments->files == 1 || b < c->table[1].rows;
        if (!matched) {
            c->unmatched++;
            continue;
        }
        c->row_of[0][c->rows] = a;
        c->row_of[1][c->rows++] = b;
    }
    return ISCHIA_OK;
}

/* ---- series ---- */

static enum ischia_code add_series(struct comparison *c, int file, const char *name, int *ret,
                                   struct ischia_error *err)
{
    struct series *s = &c->series[c->series_count];
    (void)snprintf(s->name, sizeof s->name, "%s%s",
                   c->arguments->files == 1 ? "" : (file == 0 ? "A " : "B "), name);
    s->value = calloc(c->rows + 1, sizeof *s->value);
    CHECK(s->value != NULL, err, ISCHIA_E_MEMORY, "out of memory for %zu rows", c->rows);
    *ret = c->series_count++;
    return ISCHIA_OK;
}

/* *ret is -1 when the file has no such column. */
static enum ischia_code column_series(struct comparison *c, int file, const char *name, int *ret,
                                      struct ischia_error *err)
{
    const int column = study_table_column(&c->table[file], name);
    *ret = -1;
    if (column < 0) return ISCHIA_OK;
    TRY(add_series(c, file, name, ret, err));
    for (size_t i = 0; i < c->rows; i++) {
        const size_t row = c->row_of[file][i];
        const bool good = study_table_succeeded(&c->table[file], row);
        c->series[*ret].value[i] =
            good ? study_table_number(&c->table[file], row, column) : (double)NAN;
    }
    return ISCHIA_OK;
}

/* Cohort files may name their columns with the unit: R1 or R1_mm. */
static int input_column(const struct study_table *t, const struct ischia_param_info *info)
{
    char with_unit[32];
    const int column = study_table_column(t, info->key);
    (void)snprintf(with_unit, sizeof with_unit, "%s_%s", info->key, info->unit);
    return column >= 0 ? column : study_table_column(t, with_unit);
}

/* The case that a row states; false when it does not state a valid one. */
static bool case_of_row(const struct study_table *t, size_t row, struct ischia_case *ret)
{
    *ret = ischia_case_default();
    for (int p = 0; p < ISCHIA_PARAM_COUNT; p++) {
        const int column = input_column(t, &ischia_params[p]);
        if (column < 0) return false;
        ret->param[p] = study_table_number(t, row, column);
    }
    const int surface = study_table_column(t, "model.R2_surface");
    if (surface >= 0) ret->option[ISCHIA_R2_SURFACE] = study_table_number(t, row, surface);
    return ischia_case_is_valid(ret);
}

static enum ischia_code hertz_series(struct comparison *c, int *ret, struct ischia_error *err)
{
    bool any = false;
    c->hertz_valid = calloc(c->rows + 1, sizeof *c->hertz_valid);
    CHECK(c->hertz_valid != NULL, err, ISCHIA_E_MEMORY, "out of memory for %zu rows", c->rows);
    TRY(add_series(c, 0, "eps_hertz", ret, err));
    for (size_t i = 0; i < c->rows; i++) {
        struct ischia_case values;
        c->series[*ret].value[i] = (double)NAN;
        if (!case_of_row(&c->table[0], c->row_of[0][i], &values)) continue;
        const struct hertz_baseline hertz = hertz_baseline_of(&values);
        c->series[*ret].value[i] = hertz.eps_max;
        c->hertz_valid[i] = hertz.valid;
        c->hertz_valid_count += hertz.valid;
        any = true;
    }
    if (any) return ISCHIA_OK;
    free(c->series[--c->series_count].value);
    *ret = -1;
    return ISCHIA_OK;
}

/* ---- pairs ---- */

static enum ischia_code add_pair(struct comparison *c, int a, int b, bool readings,
                                 struct ischia_error *err)
{
    struct pair *pair = &c->pair[c->pair_count];
    struct ischia_error cause;
    size_t n = 0;
    if (a < 0 || b < 0) return ISCHIA_OK;
    double *x = calloc(2 * c->rows + 1, sizeof *x), *y = x + c->rows;
    CHECK(x != NULL, err, ISCHIA_E_MEMORY, "out of memory for %zu pairs", c->rows);
    for (size_t i = 0; i < c->rows; i++) {
        if (isnan(c->series[a].value[i]) || isnan(c->series[b].value[i])) continue;
        x[n] = c->series[a].value[i];
        y[n++] = c->series[b].value[i];
    }
    *pair = (struct pair){.a = a, .b = b, .readings = readings};
    const enum ischia_code code = statistics_compare(x, y, n, &pair->statistics, &cause);
    free(x);
    if (code != ISCHIA_OK)
        (void)snprintf(pair->why_not, sizeof pair->why_not, "%.120s", cause.message);
    c->pair_count++;
    return ISCHIA_OK;
}

/* Every predictor that A has, against the strain of the last file: the reference when there is one.
 */
static enum ischia_code compare_all(struct comparison *c, struct ischia_error *err)
{
    const int last = c->arguments->files - 1;
    int strain[2] = {-1, -1}, mean = -1, peak = -1, hertz = -1;
    for (int f = 0; f <= last; f++) {
        TRY(column_series(c, f, c->arguments->column[f], &strain[f], err));
        CHECK(strain[f] >= 0, err, ISCHIA_E_INPUT, "%s has no column %s", c->arguments->file[f],
              c->arguments->column[f]);
    }
    TRY(column_series(c, 0, "mean_pressure_kPa", &mean, err));
    TRY(column_series(c, 0, "peak_pressure_kPa", &peak, err));
    TRY(hertz_series(c, &hertz, err));
    if (last == 1) TRY(add_pair(c, strain[0], strain[1], true, err));
    for (int f = 0; f <= last; f++) {
        TRY(add_pair(c, mean, strain[f], false, err));
        TRY(add_pair(c, peak, strain[f], false, err));
        TRY(add_pair(c, hertz, strain[f], true, err));
    }
    return ISCHIA_OK;
}

/* ---- output ---- */

static void json_interval(struct json_out *out, const char *key, struct statistics_interval i)
{
    json_open_array(out, key);
    json_put_number_or_null(out, NULL, i.low);
    json_put_number_or_null(out, NULL, i.high);
    json_close_array(out);
}

static void json_summary(struct json_out *out, const char *key, const struct statistics_summary *s)
{
    json_open_object(out, key);
    json_put_number(out, "mean", s->mean);
    json_put_number(out, "sd", s->sd);
    json_put_number(out, "min", s->min);
    json_put_number(out, "max", s->max);
    json_close_object(out);
}

static void json_agreement(struct json_out *out, const struct statistics_pair *s)
{
    json_put_number(out, "mean_squared_error", s->mean_square);
    json_put_number_or_null(out, "corrected_mean_squared_error", s->corrected_mean_square);
    json_put_number(out, "constant_mean_squared_error", s->constant_mean_square);
    json_open_object(out, "bland_altman");
    json_put_number(out, "bias", s->bias);
    json_interval(out, "bias_ci95", s->bias_ci);
    json_put_number(out, "sd", s->bias_sd);
    json_interval(out, "limits_of_agreement", s->limits);
    json_put_number(out, "limits_half_ci95", s->limits_half_ci);
    json_close_object(out);
}

static void json_pair(struct json_out *out, const struct comparison *c, const struct pair *pair)
{
    const struct statistics_pair *s = &pair->statistics;
    json_open_object(out, NULL);
    json_put_string(out, "a", c->series[pair->a].name);
    json_put_string(out, "b", c->series[pair->b].name);
    json_put_string(out, "problem", pair->why_not[0] != '\0' ? pair->why_not : NULL);
    if (pair->why_not[0] == '\0') {
        json_put_integer(out, "n", (long long)s->n);
        json_summary(out, "summary_a", &s->a);
        json_summary(out, "summary_b", &s->b);
        json_put_number_or_null(out, "pearson_r", s->pearson_r);
        json_put_number_or_null(out, "pearson_p", s->pearson_p);
        json_interval(out, "pearson_ci95", s->pearson_ci);
        json_put_number_or_null(out, "spearman_rho", s->spearman_rho);
        json_put_number_or_null(out, "spearman_p", s->spearman_p);
        json_put_number_or_null(out, "slope", s->slope);
        json_put_number_or_null(out, "intercept", s->intercept);
        if (pair->readings) json_agreement(out, s);
    }
    json_close_object(out);
}

static enum ischia_code write_json(const struct comparison *c, struct ischia_error *err)
{
    struct json_out out;
    json_out_init(&out, 2);
    json_open_object(&out, NULL);
    json_put_integer(&out, "rows", (long long)c->rows);
    json_put_integer(&out, "rows_without_partner", (long long)c->unmatched);
    json_put_integer(&out, "hertz_valid_rows", (long long)c->hertz_valid_count);
    json_open_array(&out, "pairs");
    for (int p = 0; p < c->pair_count; p++) json_pair(&out, c, &c->pair[p]);
    json_close_array(&out);
    json_close_object(&out);
    text_put_string(&out.text, "\n");
    struct text_out text = out.text;
    return study_write(&text, c->arguments->output, err);
}

static void put_joined_row(struct text_out *out, const struct comparison *c, size_t i)
{
    for (int k = 0; k < c->key_count; k++) {
        const int column = study_table_column(&c->table[0], c->key[k]);
        csv_put_text(out, study_table_text(&c->table[0], c->row_of[0][i], column), k == 0);
    }
    for (int s = 0; s < c->series_count; s++)
        csv_put_number(out, c->series[s].value[i], c->key_count == 0 && s == 0);
    csv_put_text(out, c->hertz_valid[i] ? "yes" : "no", false);
    csv_end_row(out);
}

static enum ischia_code write_joined(const struct comparison *c, struct ischia_error *err)
{
    struct text_out out;
    text_out_init(&out);
    for (int k = 0; k < c->key_count; k++) csv_put_text(&out, c->key[k], k == 0);
    for (int s = 0; s < c->series_count; s++)
        csv_put_text(&out, c->series[s].name, c->key_count == 0 && s == 0);
    csv_put_text(&out, "hertz_valid", false);
    csv_end_row(&out);
    for (size_t i = 0; i < c->rows; i++) put_joined_row(&out, c, i);
    return study_write(&out, c->arguments->joined, err);
}

static void print_pair(const struct comparison *c, const struct pair *pair)
{
    const struct statistics_pair *s = &pair->statistics;
    (void)printf("\n%s -> %s\n", c->series[pair->a].name, c->series[pair->b].name);
    if (pair->why_not[0] != '\0') {
        (void)printf("  %s\n", pair->why_not);
        return;
    }
    (void)printf("  n %zu; Pearson r %.3f, p %.2g, 95 %% %.3f to %.3f; Spearman %.3f, p %.2g\n",
                 s->n, s->pearson_r, s->pearson_p, s->pearson_ci.low, s->pearson_ci.high,
                 s->spearman_rho, s->spearman_p);
    (void)printf("  line: %.4g + %.4g a\n", s->intercept, s->slope);
    if (!pair->readings) return;
    (void)printf("  mean squared error %.3g; after regression %.3g; of the mean alone %.3g\n",
                 s->mean_square, s->corrected_mean_square, s->constant_mean_square);
    (void)printf("  bias %.4f (95 %% %.4f to %.4f); limits of agreement %.4f to %.4f\n", s->bias,
                 s->bias_ci.low, s->bias_ci.high, s->limits.low, s->limits.high);
}

static void print_text(const struct comparison *c)
{
    (void)printf("%zu rows joined, %zu without a partner\n", c->rows, c->unmatched);
    for (int p = 0; p < c->pair_count; p++) print_pair(c, &c->pair[p]);
    (void)printf("\nThe analytic baseline is within its range of validity for %zu of %zu rows.\n",
                 c->hertz_valid_count, c->rows);
}

/* ---- the command ---- */

static enum ischia_code run_comparison(struct comparison *c, struct ischia_error *err)
{
    const struct arguments *a = c->arguments;
    TRY(file_out_check(a->output, a->file, 2, err));
    TRY(file_out_check(a->joined, a->file, 2, err));
    CHECK(a->output == NULL || a->joined == NULL || strcmp(a->output, a->joined) != 0, err,
          ISCHIA_E_INPUT, "--output and --table both name %s", a->output);
    for (int f = 0; f < a->files; f++) TRY(study_table_read(&c->table[f], a->file[f], err));
    TRY(join(c, err));
    TRY(compare_all(c, err));
    if (a->output != NULL) TRY(write_json(c, err));
    if (a->joined != NULL) TRY(write_joined(c, err));
    if (a->output == NULL || strcmp(a->output, "-") != 0) print_text(c);
    return ISCHIA_OK;
}

static void comparison_finish(struct comparison *c)
{
    for (int s = 0; s < c->series_count; s++) free(c->series[s].value);
    for (int f = 0; f < 2; f++) {
        free(c->row_of[f]);
        study_table_finish(&c->table[f]);
    }
    free(c->hertz_valid);
    free(c->key_list);
}

static enum cli_parse parse_arguments(int argc, char **argv, struct arguments *a)
{
    const struct cli_option table[] = {
        {"--column", 0, "NAME", "the column to compare (default: eps_max)", &a->column[0], NULL},
        {"--b-column", 0, "NAME", "its name in B, when it differs", &a->column[1], NULL},
        {"--key", 0, "NAMES",
         "columns that join rows, with commas between (default: subject,side\n"
         "                             or row, whichever both have; else the order)",
         &a->key_list, NULL},
        {"--table", 0, "FILE", "the joined rows, with the analytic baseline, as CSV", &a->joined,
         NULL},
        {"--output", 'o', "FILE", "the statistics as JSON (\"-\": to stdout, without the text)",
         &a->output, NULL},
        {0},
    };
    const struct cli_usage usage = {
        .command = "study compare",
        .synopsis = "A.csv [B.csv]",
        .about =
            "Compares columns of result files (`ischia cohort`, `ischia study factorial`, your\n"
            "own). With two files, B is the reference: it is regressed on A, and differences\n"
            "are B - A. eps_hertz is a small-strain Hertz contact of a rigid ellipsoid on a\n"
            "layer, valid for indentations up to a tenth of the tissue, which sitting exceeds\n"
            "by far: a yardstick only.",
        .options = table,
        .operands_max = 2,
    };
    *a = (struct arguments){.column = {"eps_max", NULL}};
    const enum cli_parse parsed = study_parse(&usage, 1, argc, argv, a->file);
    a->files = a->file[1] != NULL ? 2 : 1;
    if (a->column[1] == NULL) a->column[1] = a->column[0];
    return parsed;
}

int study_compare(int argc, char **argv)
{
    struct arguments arguments;
    struct comparison comparison = {.arguments = &arguments};
    struct ischia_error err;
    const enum cli_parse parsed = parse_arguments(argc, argv, &arguments);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    const enum ischia_code code = run_comparison(&comparison, &err);
    comparison_finish(&comparison);
    return code == ISCHIA_OK ? EXIT_DONE : study_failed("compare", &err);
}
