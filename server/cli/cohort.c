/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * ischia cohort: every row of a CSV file, on several processes.
 *
 * Rows are read ahead, given to whichever process is free, and written in the order of the file: a
 * row waits for those before it, so that the output reads like the input whatever -j was. At most
 * WINDOW rows are held at once, so the length of the file does not matter.
 */
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "api/cohort_rows.h"
#include "api/problem_doc.h"
#include "api/result_csv.h"
#include "api/uncertainty_csv.h"
#include "server/cli/bar.h"
#include "server/cli/crew.h"
#include "server/cli/files.h"
#include "server/cli/options.h"
#include "server/cli/run.h"
#include "server/cli/uncertain.h"

enum { WINDOW = 256, REASON_BYTES = 640 };

enum row_state { ROW_SOLVING, ROW_SUCCEEDED, ROW_FAILED, ROW_REFUSED, ROW_STATE_COUNT };
static const char *const row_state_names[ROW_STATE_COUNT] = {
    [ROW_SOLVING] = "solving",
    [ROW_SUCCEEDED] = "succeeded",
    [ROW_FAILED] = "failed",
    [ROW_REFUSED] = "refused",
};

struct row {
    enum row_state state;
    long line;
    long long end; /* where in the file it ends */
    char *echo;
    char reason[REASON_BYTES];
    struct crew_order order;
    bool has_result;
    struct ischia_result result;
    bool has_uncertainty;
    struct ischia_uncertainty uncertainty;
};

struct cohort {
    const char *path, *emulator; /* NULL: the installed one */
    enum cohort_sd sd;
    struct case_doc_defaults defaults;
    struct cohort_columns columns;
    struct csv_reader reader;
    struct line_out out;
    struct estimator *estimator; /* NULL: there is none, or nobody needs it */
    struct crew crew;
    struct bar bar;
    long long file_bytes; /* 0: not known               */
    long next_read;       /* number of the next row to read, 0 ... */
    long next_written;    /* number of the next row to write       */
    bool all_read;
    long count[ROW_STATE_COUNT];
    struct row window[WINDOW]; /* row n is window[n % WINDOW] */
};

/* ---- reading ---- */

static void say_line(struct cohort *k, long line, const char *what)
{
    char shown[REASON_BYTES];
    bar_clear(&k->bar);
    (void)fprintf(stderr, "ischia cohort: %s: line %ld: %s\n", k->path, line,
                  text_printable(what, shown, sizeof shown));
}

static void refuse_faults(struct cohort *k, struct row *row, const struct doc_faults *faults)
{
    row->state = ROW_REFUSED;
    for (size_t i = 0; i < faults->count; i++) {
        const size_t used = strlen(row->reason);
        (void)snprintf(row->reason + used, sizeof row->reason - used, "%s%s", i > 0 ? "; " : "",
                       faults->item[i].detail);
        say_line(k, row->line, faults->item[i].detail);
    }
}

/* A row that is not CSV: it still gets its line in the output. */
static enum ischia_code refuse_unreadable(struct cohort *k, struct row *row,
                                          const struct ischia_error *reason,
                                          struct ischia_error *err)
{
    const struct csv_row none = {0};
    struct ischia_request unused;
    struct doc_faults faults;
    bar_clear(&k->bar);
    (void)fprintf(stderr, "ischia cohort: %s: %s\n", k->path, reason->message);
    row->state = ROW_REFUSED;
    (void)snprintf(row->reason, sizeof row->reason, "%s", reason->message);
    doc_faults_init(&faults);
    return cohort_row_read(&k->columns, &k->defaults, &none, &row->echo, &unused, &faults, err);
}

/* Reads one row into the window; at the end of the file only notes that. */
static enum ischia_code read_row(struct cohort *k, struct ischia_error *err)
{
    struct csv_row csv;
    struct doc_faults faults;
    struct ischia_request request;
    struct row *row = &k->window[k->next_read % WINDOW];
    const enum ischia_code code = csv_read(&k->reader, &csv, &k->all_read, err);
    if (code == ISCHIA_OK && k->all_read) return ISCHIA_OK;
    if (code == ISCHIA_E_IO) return code;
    memset(row, 0, sizeof *row);
    row->line = csv.line;
    row->end = k->reader.consumed;
    if (code != ISCHIA_OK) {
        const struct ischia_error reason = *err;
        TRY(refuse_unreadable(k, row, &reason, err));
    } else {
        doc_faults_init(&faults);
        ischia_request_init(&request);
        TRY(cohort_row_read(&k->columns, &k->defaults, &csv, &row->echo, &request, &faults, err));
        row->order.c = request.values;
        row->order.has_sd = request.has_sd;
        case_doc_sd(&request, row->order.sd);
        if (faults.count > 0) refuse_faults(k, row, &faults);
    }
    k->next_read++;
    if (row->state == ROW_SOLVING)
        return crew_give(&k->crew, crew_idle(&k->crew), k->next_read - 1, &row->order, err);
    return ISCHIA_OK;
}

/* ---- answers ---- */

static void take_answer(struct cohort *k, const struct crew_answer *answer)
{
    struct row *row = &k->window[answer->job % WINDOW];
    struct problem problem;
    row->has_result = answer->code == ISCHIA_OK;
    row->result = answer->result;
    row->has_uncertainty = answer->has_uncertainty;
    row->uncertainty = answer->uncertainty;
    row->state = ROW_FAILED;
    if (!row->has_result) {
        (void)snprintf(row->reason, sizeof row->reason, "%s", answer->message);
    } else if (ischia_result_converged(&answer->result)) {
        row->state = ROW_SUCCEEDED;
        return;
    } else {
        problem_from_result(&problem, &row->order.c, &answer->result);
        (void)snprintf(row->reason, sizeof row->reason, "%s: %s", problem.reason, problem.detail);
    }
    say_line(k, row->line, row->reason);
}

/* ---- writing ---- */

static enum ischia_code write_row(struct cohort *k, struct row *row, struct ischia_error *err)
{
    struct text_out line;
    char *text;
    size_t length;
    text_out_init(&line);
    text_put_string(&line, row->echo);
    result_csv_put(&line, row_state_names[row->state], row->reason,
                   row->has_result ? &row->result : NULL, false);
    if (k->columns.has_sd)
        uncertainty_csv_put(&line, row->has_uncertainty ? &row->uncertainty : NULL);
    csv_end_row(&line);
    TRY(text_out_take(&line, &text, &length, err));
    bar_clear(&k->bar); /* both may be the same terminal */
    const enum ischia_code code = line_out_write(&k->out, text, length, err);
    free(text);
    return code;
}

static void draw(struct cohort *k, long long position)
{
    char words[80];
    const double fraction = k->file_bytes > 0 ? (double)position / (double)k->file_bytes : -1;
    (void)snprintf(words, sizeof words, "%ld rows, %ld failed, %ld refused", k->next_written,
                   k->count[ROW_FAILED], k->count[ROW_REFUSED]);
    bar_draw(&k->bar, fraction, words);
}

/* Writes the rows that are finished, up to the first that is not. */
static enum ischia_code write_finished(struct cohort *k, struct ischia_error *err)
{
    while (k->next_written < k->next_read) {
        struct row *row = &k->window[k->next_written % WINDOW];
        if (row->state == ROW_SOLVING) break;
        TRY(write_row(k, row, err));
        free(row->echo);
        row->echo = NULL;
        k->count[row->state]++;
        k->next_written++;
        draw(k, row->end);
    }
    return ISCHIA_OK;
}

/* ---- the whole ---- */

static bool may_read(const struct cohort *k)
{
    return !k->all_read && k->next_read - k->next_written < WINDOW &&
           crew_idle(&k->crew) != CREW_NOBODY;
}

static enum ischia_code solve_rows(struct cohort *k, struct ischia_error *err)
{
    struct crew_answer answer;
    for (;;) {
        while (may_read(k)) {
            TRY(read_row(k, err));
            TRY(write_finished(k, err));
        }
        if (!crew_is_working(&k->crew)) return ISCHIA_OK;
        TRY(crew_wait(&k->crew, &answer, err));
        take_answer(k, &answer);
        TRY(write_finished(k, err));
    }
}

static enum ischia_code solve_all(struct cohort *k, int jobs, struct ischia_error *err)
{
    TRY(line_out_write(&k->out, k->columns.header, strlen(k->columns.header), err));
    TRY(crew_start(&k->crew, jobs, k->estimator, err));
    const enum ischia_code code = solve_rows(k, err);
    crew_stop(&k->crew);
    for (int i = 0; i < WINDOW; i++) free(k->window[i].echo);
    bar_clear(&k->bar);
    return code;
}

static enum ischia_code read_header(struct cohort *k, struct ischia_error *err)
{
    struct csv_row row;
    struct doc_faults faults;
    struct ischia_error cause;
    bool end;
    if (csv_read(&k->reader, &row, &end, &cause) != ISCHIA_OK)
        return FAIL(err, cause.code, "%s: %.400s", k->path, cause.message);
    CHECK(!end, err, ISCHIA_E_INPUT, "%s is empty; the first row names the columns", k->path);
    doc_faults_init(&faults);
    const enum ischia_code code = cohort_columns_init(&k->columns, &row, k->sd, &faults, err);
    for (size_t i = 0; i < faults.count; i++) say_line(k, row.line, faults.item[i].detail);
    return code;
}

/* Nobody asks how many rows went well, unless somebody is watching. */
static void say_counts(const struct cohort *k)
{
    if (!k->bar.shown && k->count[ROW_SUCCEEDED] == k->next_written) return;
    (void)fprintf(stderr, "ischia cohort: %ld rows: %ld succeeded, %ld failed, %ld refused\n",
                  k->next_written, k->count[ROW_SUCCEEDED], k->count[ROW_FAILED],
                  k->count[ROW_REFUSED]);
}

static int run(struct cohort *k, FILE *in, const char *output, int jobs)
{
    struct ischia_error err;
    struct stat status;
    csv_reader_init(&k->reader, in);
    bar_init(&k->bar);
    if (fstat(fileno(in), &status) == 0 && S_ISREG(status.st_mode)) k->file_bytes = status.st_size;
    if (read_header(k, &err) != ISCHIA_OK) return report_error("cohort", &err);
    enum ischia_code code = ISCHIA_OK;
    if (k->columns.has_sd) code = uncertain_emulator(&k->estimator, k->emulator, &err);
    if (code == ISCHIA_OK) code = line_out_open(&k->out, output, in, &err);
    if (code == ISCHIA_OK) {
        code = solve_all(k, jobs, &err);
        struct ischia_error *second = code == ISCHIA_OK ? &err : NULL; /* the first one counts */
        const enum ischia_code closed = line_out_close(&k->out, second);
        if (code == ISCHIA_OK) code = closed;
    }
    cohort_columns_finish(&k->columns);
    estimator_destroy(k->estimator);
    if (code != ISCHIA_OK) return report_error("cohort", &err);
    say_counts(k);
    if (k->count[ROW_REFUSED] > 0) return EXIT_BAD_INPUT;
    return k->count[ROW_FAILED] > 0 ? EXIT_SOLVE_FAILED : EXIT_DONE;
}

/* Options whose values a case would refuse row by row are refused once, before anything is read. */
static bool defaults_are_known(const struct case_doc_defaults *defaults)
{
    struct ischia_request request;
    struct case_doc_fields fields;
    struct doc_faults faults;
    doc_faults_init(&faults);
    case_doc_fields_init(&fields, &request, &faults);
    case_doc_fields_set_defaults(&fields, defaults);
    for (size_t i = 0; i < faults.count; i++)
        (void)fprintf(stderr, "ischia cohort: --%s\n", faults.item[i].detail);
    return faults.count == 0;
}

struct cohort_options {
    const char *output, *emulator;
    int jobs;
    enum cohort_sd sd;
    struct case_doc_defaults defaults;
};

static int run_file(const char *path, const struct cohort_options *options)
{
    struct ischia_error err;
    FILE *in;
    if (file_open(path, &in, &err) != ISCHIA_OK) return report_error("cohort", &err);
    struct cohort *k = calloc(1, sizeof *k);
    int status = EXIT_SOLVE_FAILED;
    if (k != NULL) {
        k->path = file_name(path);
        k->emulator = options->emulator;
        k->sd = options->sd;
        k->defaults = options->defaults;
        status = run(k, in, options->output, options->jobs);
    } else {
        (void)fprintf(stderr, "ischia cohort: out of memory\n");
    }
    free(k);
    file_close(in);
    return status;
}

static bool sd_is_known(const struct cli_usage *usage, const char *sd)
{
    if (sd == NULL || strcmp(sd, "typical") == 0) return true;
    (void)fprintf(stderr, "ischia %s: --sd is %s; accepted: typical\n", usage->command, sd);
    return false;
}

int command_cohort(int argc, char **argv)
{
    const char *jobs_text = "1", *path = "-", *sd = NULL;
    struct cohort_options options = {.output = "-"};
    const struct cli_option table[] = {
        {"--output", 'o', "OUT", "where to (default: standard output)", &options.output, NULL},
        {"--jobs", 'j', "N", "how many rows to solve at once (default 1)", &jobs_text, NULL},
        {"--resolution", 0, "NAME", "standard, fine or coarse, for a file without that column",
         &options.defaults.resolution, NULL},
        {"--model", 0, "NAME", "a named set of model options, for a file without that column",
         &options.defaults.model, NULL},
        {"--sd", 0, "typical",
         "intervals, by the usual uncertainty of measurements, for a file\n"
         "                             without that column",
         &sd, NULL},
        {"--emulator", 0, "FILE", "a trained emulator instead of the installed one, for intervals",
         &options.emulator, NULL},
        {0},
    };
    const struct cli_usage usage = {
        .command = "cohort",
        .synopsis = "[FILE.csv|-]",
        .about =
            "Solves every row of a CSV file with the columns R1, R2, eM, eF, muM, muF and F\n"
            "(or R1_mm ... F_N). Other columns are kept; status, reason and the results come\n"
            "behind them, in the order of the file. A bad row is refused and the rest solved.\n"
            "With columns sd.R1 ... sd.F (standard deviations) or sd, intervals come last.",
        .options = table,
        .operands_max = 1,
    };
    const enum cli_parse parsed = cli_parse_options(&usage, argc, argv, &path);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    if (!cli_whole_number(&usage, "--jobs", jobs_text, 1, CREW_MEMBERS_MAX, &options.jobs))
        return EXIT_BAD_INPUT;
    if (!sd_is_known(&usage, sd) || !defaults_are_known(&options.defaults)) return EXIT_BAD_INPUT;
    options.sd = sd != NULL ? COHORT_SD_TYPICAL : COHORT_SD_READ;
    return run_file(path, &options);
}
