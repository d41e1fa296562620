/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Fits the polynomials of degree 1 and 2 to a result file and says what they mean: as JSON, and as
 * tables to read, beside published coefficients when there are some.
 *
 * Distance to a published table, over the terms it prints (a table prints the large ones only):
 *   distance = sqrt(mean (ours - printed)^2), in units of the response;
 *   relative = sqrt(sum (ours - printed)^2 / sum printed^2): 0 is equal, 1 is as far as zero.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "api/study_plan.h"
#include "server/cli/files.h"
#include "server/cli/study.h"
#include "server/cli/study_published.h"
#include "server/cli/study_table.h"
#include "solver/study/emulator.h"
#include "solver/study/statistics.h"

enum { TERM_NAME_BYTES = 2 * DESIGN_NAME_BYTES + 4, DEGREES = 2 };

struct arguments {
    const char *results, *design, *response, *published, *output;
};

struct against {
    int terms, same_sign;
    double distance, relative, rank; /* rank: Spearman's rho of the magnitudes */
};

struct emulation {
    const struct arguments *arguments;
    struct study_table table;
    int factor_count;
    struct design_factor factor[EMULATOR_PARAMS_MAX]; /* its first and last level are -1 and 1 */
    size_t used;
    double *x, *y; /* [used][factor_count], [used] */
    struct emulator fit[DEGREES];
    bool has_fit[DEGREES];
    char why_not[DEGREES][ISCHIA_ERROR_MESSAGE_BYTES];
    bool has_published;
    struct study_published published;
};

/* ---- the rows ---- */

static double column_extent(const struct study_table *t, int column, double sign)
{
    double best = (double)NAN;
    for (size_t row = 0; row < t->rows; row++) {
        const double value = sign * study_table_number(t, row, column);
        if (isnan(best) || value > best) best = value;
    }
    return sign * best;
}

static enum ischia_code factors_from_columns(struct emulation *e, struct ischia_error *err)
{
    for (int column = 0; column < e->table.columns; column++) {
        struct design_factor factor = {.level_count = 2};
        if (!design_factor_find(e->table.cell[column], &factor)) continue;
        factor.level[0] = column_extent(&e->table, column, -1);
        factor.level[1] = column_extent(&e->table, column, 1);
        if (factor.level[1] > factor.level[0]) e->factor[e->factor_count++] = factor;
    }
    CHECK(e->factor_count > 0, err, ISCHIA_E_INPUT, "no input varies in %s",
          file_name(e->arguments->results));
    return ISCHIA_OK;
}

static enum ischia_code factors_from_design(struct emulation *e, struct ischia_error *err)
{
    const struct case_doc_defaults defaults = {NULL, NULL};
    struct study_plan plan;
    TRY(study_load_plan(&plan, e->arguments->design, &defaults, err));
    e->factor_count = plan.design.factor_count;
    memcpy(e->factor, plan.design.factor, sizeof e->factor);
    study_plan_finish(&plan);
    return ISCHIA_OK;
}

static enum ischia_code find_columns(const struct emulation *e, int *ret_column, int *ret_response,
                                     struct ischia_error *err)
{
    char name[DESIGN_NAME_BYTES];
    *ret_response = study_table_column(&e->table, e->arguments->response);
    CHECK(*ret_response >= 0, err, ISCHIA_E_INPUT, "%s has no column %s", e->arguments->results,
          e->arguments->response);
    for (int f = 0; f < e->factor_count; f++) {
        ret_column[f] = study_table_column(&e->table, design_factor_name(&e->factor[f], name));
        CHECK(ret_column[f] >= 0, err, ISCHIA_E_INPUT, "%s has no column %s", e->arguments->results,
              name);
    }
    return ISCHIA_OK;
}

/* A row without a response is left out; a row with one but without inputs is an error. */
static enum ischia_code take_rows(struct emulation *e, struct ischia_error *err)
{
    int column[EMULATOR_PARAMS_MAX], response;
    const size_t k = (size_t)e->factor_count;
    TRY(find_columns(e, column, &response, err));
    e->x = calloc(e->table.rows * k + 1, sizeof *e->x);
    e->y = calloc(e->table.rows + 1, sizeof *e->y);
    CHECK(e->x != NULL && e->y != NULL, err, ISCHIA_E_MEMORY, "out of memory for %zu rows",
          e->table.rows);
    for (size_t row = 0; row < e->table.rows; row++) {
        const double y = study_table_number(&e->table, row, response);
        if (isnan(y) || !study_table_succeeded(&e->table, row)) continue;
        for (int f = 0; f < e->factor_count; f++) {
            const double value = study_table_number(&e->table, row, column[f]);
            CHECK(!isnan(value), err, ISCHIA_E_INPUT, "%s, row %zu: an input is not a number",
                  e->arguments->results, row + 1);
            e->x[e->used * k + (size_t)f] = design_normalised(&e->factor[f], value);
        }
        e->y[e->used++] = y;
    }
    return ISCHIA_OK;
}

/* ---- names and published values ---- */

static void term_name(const struct emulation *e, struct emulator_term term, bool swapped,
                      char ret[TERM_NAME_BYTES])
{
    char a[DESIGN_NAME_BYTES], b[DESIGN_NAME_BYTES];
    if (term.i < 0) {
        (void)snprintf(ret, TERM_NAME_BYTES, "1");
        return;
    }
    (void)design_factor_name(&e->factor[swapped && term.j >= 0 ? term.j : term.i], a);
    if (term.j < 0) {
        (void)snprintf(ret, TERM_NAME_BYTES, "%s", a);
    } else if (term.j == term.i) {
        (void)snprintf(ret, TERM_NAME_BYTES, "%s^2", a);
    } else {
        (void)design_factor_name(&e->factor[swapped ? term.i : term.j], b);
        (void)snprintf(ret, TERM_NAME_BYTES, "%s*%s", a, b);
    }
}

/* NULL when the term was not printed. Products are found in either order. */
static const struct study_published_term *printed(const struct emulation *e, int degree,
                                                  struct emulator_term term)
{
    const struct study_published_degree *d = &e->published.degree[degree - 1];
    char name[TERM_NAME_BYTES];
    for (int order = 0; e->has_published && order < 2; order++) {
        term_name(e, term, order == 1, name);
        for (int i = 0; i < d->count; i++)
            if (strcmp(d->term[i].name, name) == 0) return &d->term[i];
    }
    return NULL;
}

static bool same_sign(double a, double b) { return (a < 0) == (b < 0); }

/* False when nothing was printed for this degree. */
static bool against_published(const struct emulation *e, int degree, struct against *ret)
{
    const struct emulator *fit = &e->fit[degree - 1];
    double ours[EMULATOR_TERMS_MAX], theirs[EMULATOR_TERMS_MAX], squares = 0, size = 0;
    struct statistics_pair pair;
    struct against a = {.rank = (double)NAN};
    for (int t = 0; t < fit->terms; t++) {
        const struct study_published_term *p = printed(e, degree, fit->term[t]);
        if (p == NULL) continue;
        const double theta = fit->fit.beta[t];
        a.same_sign += same_sign(theta, p->theta);
        squares += (theta - p->theta) * (theta - p->theta);
        size += p->theta * p->theta;
        ours[a.terms] = fabs(theta);
        theirs[a.terms++] = fabs(p->theta);
    }
    if (a.terms == 0) return false;
    a.distance = sqrt(squares / a.terms);
    a.relative = sqrt(squares / size);
    if (statistics_compare(ours, theirs, (size_t)a.terms, &pair, NULL) == ISCHIA_OK)
        a.rank = pair.spearman_rho;
    *ret = a;
    return true;
}

/* ---- JSON ---- */

static void json_coefficients(struct json_out *out, const struct emulation *e, int degree)
{
    const struct emulator *fit = &e->fit[degree - 1];
    char name[TERM_NAME_BYTES];
    json_open_array(out, "coefficients");
    for (int t = 0; t < fit->terms; t++) {
        const struct study_published_term *p = printed(e, degree, fit->term[t]);
        term_name(e, fit->term[t], false, name);
        json_open_object(out, NULL);
        json_put_string(out, "term", name);
        json_put_number(out, "theta", fit->fit.beta[t]);
        json_put_number_or_null(out, "standard_error", fit->fit.se[t]);
        json_put_number(out, "share_percent", 100 * fit->sensitivity.share[t]);
        json_put_number_or_null(out, "published_theta", p != NULL ? p->theta : (double)NAN);
        json_put_number_or_null(out, "published_S_percent", p != NULL ? p->S_percent : (double)NAN);
        json_close_object(out);
    }
    json_close_array(out);
}

static void json_parameters(struct json_out *out, const struct emulation *e, int degree)
{
    const struct emulator *fit = &e->fit[degree - 1];
    char name[DESIGN_NAME_BYTES];
    json_open_array(out, "parameters");
    for (int f = 0; f < e->factor_count; f++) {
        json_open_object(out, NULL);
        json_put_string(out, "key", design_factor_name(&e->factor[f], name));
        json_put_number(out, "S_percent", 100 * fit->sensitivity.first_order[f]);
        json_put_number(out, "sobol_first_order", fit->sensitivity.first_order[f]);
        json_put_number(out, "sobol_total", fit->sensitivity.total[f]);
        json_close_object(out);
    }
    json_close_array(out);
}

static void json_against(struct json_out *out, const struct emulation *e, int degree)
{
    struct against a;
    if (!against_published(e, degree, &a)) return;
    json_open_object(out, "against_published");
    json_put_string(out, "source", e->published.source);
    json_put_integer(out, "terms", a.terms);
    json_put_integer(out, "same_sign", a.same_sign);
    json_put_number(out, "distance", a.distance);
    json_put_number_or_null(out, "relative_distance", a.relative);
    json_put_number_or_null(out, "rank_correlation", a.rank);
    json_put_number_or_null(out, "published_mean_squared_residuals",
                            e->published.degree[degree - 1].mean_square);
    json_close_object(out);
}

static void json_fit(struct json_out *out, const struct emulation *e, int degree)
{
    const struct least_squares *fit = &e->fit[degree - 1].fit;
    json_open_object(out, NULL);
    json_put_integer(out, "degree", degree);
    json_put_integer(out, "terms", (long long)fit->k);
    json_put_number(out, "mean_squared_residuals", fit->mean_square);
    json_put_number_or_null(out, "leave_one_out_mean_square", fit->loo_mean_square);
    json_put_number_or_null(out, "r2", fit->r2);
    json_put_number_or_null(out, "r2_adjusted", fit->r2_adjusted);
    json_put_number(out, "reciprocal_condition", fit->rcond);
    json_coefficients(out, e, degree);
    json_parameters(out, e, degree);
    json_against(out, e, degree);
    json_close_object(out);
}

static void json_factors(struct json_out *out, const struct emulation *e)
{
    char name[DESIGN_NAME_BYTES];
    json_open_array(out, "factors");
    for (int f = 0; f < e->factor_count; f++) {
        const struct design_factor *factor = &e->factor[f];
        json_open_object(out, NULL);
        json_put_string(out, "key", design_factor_name(factor, name));
        json_put_number(out, "minus_one", factor->level[0]);
        json_put_number(out, "plus_one", factor->level[factor->level_count - 1]);
        json_close_object(out);
    }
    json_close_array(out);
}

static enum ischia_code write_json(const struct emulation *e, struct ischia_error *err)
{
    struct json_out out;
    json_out_init(&out, 2);
    json_open_object(&out, NULL);
    json_put_string(&out, "response", e->arguments->response);
    json_put_integer(&out, "rows", (long long)e->table.rows);
    json_put_integer(&out, "rows_used", (long long)e->used);
    json_factors(&out, e);
    json_open_array(&out, "fits");
    for (int degree = 1; degree <= DEGREES; degree++)
        if (e->has_fit[degree - 1]) json_fit(&out, e, degree);
    json_close_array(&out);
    json_close_object(&out);
    text_put_string(&out.text, "\n");
    struct text_out text = out.text;
    return study_write(&text, e->arguments->output, err);
}

/* ---- tables to read ---- */

static void print_row(const struct emulation *e, int degree, int t)
{
    const struct emulator *fit = &e->fit[degree - 1];
    const struct study_published_term *p = printed(e, degree, fit->term[t]);
    char name[TERM_NAME_BYTES];
    term_name(e, fit->term[t], false, name);
    (void)printf("  %-16s %+9.4f  %8.4f  %6.2f", name, fit->fit.beta[t], fit->fit.se[t],
                 100 * fit->sensitivity.share[t]);
    if (p != NULL)
        (void)printf("  %+9.4f  %s", p->theta, same_sign(p->theta, fit->fit.beta[t]) ? "" : "sign");
    (void)printf("\n");
}

/* Every linear term and square, and products above 1 % or printed: the paper's own choice. */
static bool worth_printing(const struct emulation *e, int degree, int t)
{
    const struct emulator *fit = &e->fit[degree - 1];
    const struct emulator_term term = fit->term[t];
    return term.j < 0 || term.i == term.j || fit->sensitivity.share[t] >= 0.01 ||
           printed(e, degree, term) != NULL;
}

/* What was printed for the parameter as a whole, or NaN. */
static double printed_percent(const struct emulation *e, int degree, int f)
{
    const struct study_published_term *p = printed(e, degree, (struct emulator_term){f, -1});
    return p != NULL ? p->S_percent : (double)NAN;
}

static void print_parameters(const struct emulation *e, int degree)
{
    const struct emulator *fit = &e->fit[degree - 1];
    char name[DESIGN_NAME_BYTES];
    (void)printf("\n  %-16s %9s  %9s%s\n", "parameter", "S_i %", "total %",
                 e->has_published ? "  printed %" : "");
    for (int f = 0; f < e->factor_count; f++) {
        const double percent = printed_percent(e, degree, f);
        (void)printf("  %-16s %9.2f  %9.2f", design_factor_name(&e->factor[f], name),
                     100 * fit->sensitivity.first_order[f], 100 * fit->sensitivity.total[f]);
        if (!isnan(percent)) (void)printf("  %9.2g", percent);
        (void)printf("\n");
    }
}

static void print_fit(const struct emulation *e, int degree)
{
    const struct emulator *fit = &e->fit[degree - 1];
    struct against a;
    (void)printf("\nDegree %d: mean squared residual %.3g (leave-one-out %.3g), R2 %.4f\n", degree,
                 fit->fit.mean_square, fit->fit.loo_mean_square, fit->fit.r2);
    (void)printf("  %-16s %9s  %8s  %6s%s\n", "term", "theta", "se", "S %",
                 e->has_published ? "    printed" : "");
    for (int t = 0; t < fit->terms; t++)
        if (worth_printing(e, degree, t)) print_row(e, degree, t);
    print_parameters(e, degree);
    if (!against_published(e, degree, &a)) return;
    (void)printf(
        "\n  Of %d printed terms %d have the same sign; RMS difference %.4f (%.0f %% of the "
        "printed size);\n  rank correlation of the magnitudes %.2f.\n",
        a.terms, a.same_sign, a.distance, 100 * a.relative, a.rank);
}

static void print_tables(const struct emulation *e)
{
    (void)printf("%s: %zu of %zu rows have %s\n", e->arguments->results, e->used, e->table.rows,
                 e->arguments->response);
    if (e->has_published) (void)printf("printed: %s\n", e->published.source);
    for (int degree = 1; degree <= DEGREES; degree++) {
        if (e->has_fit[degree - 1]) {
            print_fit(e, degree);
        } else {
            (void)printf("\nDegree %d: %s\n", degree, e->why_not[degree - 1]);
        }
    }
}

/* ---- the command ---- */

/* A design that carries degree 1 but not 2 is not an error; one that carries neither is. */
static enum ischia_code fit_degrees(struct emulation *e, struct ischia_error *err)
{
    for (int degree = 1; degree <= DEGREES; degree++) {
        const enum ischia_code code =
            emulator_init(&e->fit[degree - 1], e->factor_count, degree, e->x, e->y, e->used, err);
        e->has_fit[degree - 1] = code == ISCHIA_OK;
        if (code == ISCHIA_OK) continue;
        if (code != ISCHIA_E_INPUT || degree == 1) return code;
        (void)snprintf(e->why_not[degree - 1], sizeof e->why_not[0], "%s", err->message);
    }
    return ISCHIA_OK;
}

static enum ischia_code run_emulation(struct emulation *e, struct ischia_error *err)
{
    const struct arguments *a = e->arguments;
    const char *const inputs[] = {a->results, a->design, a->published};
    TRY(file_out_check(a->output, inputs, sizeof inputs / sizeof inputs[0], err));
    TRY(study_table_read(&e->table, a->results, err));
    TRY(a->design != NULL ? factors_from_design(e, err) : factors_from_columns(e, err));
    e->has_published = a->published != NULL;
    if (e->has_published) TRY(study_published_read(&e->published, a->published, err));
    TRY(take_rows(e, err));
    TRY(fit_degrees(e, err));
    if (a->output != NULL) TRY(write_json(e, err));
    if (a->output == NULL || strcmp(a->output, "-") != 0) print_tables(e);
    return ISCHIA_OK;
}

static void emulation_finish(struct emulation *e)
{
    for (int d = 0; d < DEGREES; d++) emulator_finish(&e->fit[d]);
    free(e->x);
    free(e->y);
    study_table_finish(&e->table);
}

static enum cli_parse parse_arguments(int argc, char **argv, struct arguments *a)
{
    const struct cli_option table[] = {
        {"--design", 0, "FILE", "normalise by a design's levels (default: by each column's extent)",
         &a->design, NULL},
        {"--response", 0, "NAME", "the column to fit (default: eps_max)", &a->response, NULL},
        {"--published", 0, "FILE", "coefficients to set beside ours", &a->published, NULL},
        {"--output", 'o', "FILE", "everything as JSON (\"-\": to stdout, without the tables)",
         &a->output, NULL},
        {0},
    };
    const struct cli_usage usage = {
        .command = "study emulate",
        .synopsis = "RESULTS.csv",
        .about =
            "Fits polynomials of degree 1 and 2 by least squares, in parameters normalised to\n"
            "[-1, 1]: coefficients with standard errors, sensitivities, Sobol' indices.",
        .options = table,
        .operands_max = 1,
    };
    *a = (struct arguments){.response = "eps_max"};
    return study_parse(&usage, 1, argc, argv, &a->results);
}

int study_emulate(int argc, char **argv)
{
    struct arguments arguments;
    struct ischia_error err;
    const enum cli_parse parsed = parse_arguments(argc, argv, &arguments);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    struct emulation *e = calloc(1, sizeof *e);
    if (e == NULL) {
        (void)FAIL(&err, ISCHIA_E_MEMORY, "out of memory");
        return study_failed("emulate", &err);
    }
    e->arguments = &arguments;
    const enum ischia_code code = run_emulation(e, &err);
    emulation_finish(e);
    free(e);
    return code == ISCHIA_OK ? EXIT_DONE : study_failed("emulate", &err);
}
