/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Rows go to the journal as they finish, in any order; the result file is put together from it at
 * the end, in the order of the design. Everything in it comes from the design and the solver, so an
 * interrupted and resumed study ends with the same bytes as one that ran through.
 */
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "api/study_plan.h"
#include "server/cli/bar.h"
#include "server/cli/crew.h"
#include "server/cli/files.h"
#include "server/cli/study.h"
#include "server/cli/study_journal.h"
#include "server/cli/study_sides.h"

struct arguments {
    const char *design;
    const char *output;
    struct case_doc_defaults defaults;
    int jobs;
    size_t shard, shards; /* shard: 0 ... shards - 1 */
    bool points, quiet;
};

/* What a process is to solve next: the rest of a side, positions in study.sides. */
struct lane {
    size_t next, end;
};

struct study {
    const struct arguments *arguments;
    struct study_plan plan;
    struct study_journal journal;
    struct crew crew;
    bool *mine; /* [points.count] this shard's rows                                */
    bool *died; /* [points.count] the process that solved this row died once */
    struct study_sides sides;
    size_t next_side; /* position of the first side that nobody has taken */
    struct lane lane[CREW_MEMBERS_MAX];
    size_t total, done, failed; /* of this shard                  */
    size_t before;              /* done by an earlier run         */
    struct bar bar;
    double start_s, shown_s;
};

static int processors(void)
{
    const long online = sysconf(_SC_NPROCESSORS_ONLN);
    if (online < 1) return 1;
    return online > CREW_MEMBERS_MAX ? CREW_MEMBERS_MAX : (int)online;
}

static bool parse_whole(const char *text, long min, long max, char stop, const char **ret_end,
                        long *ret)
{
    char *end;
    const long value = strtol(text, &end, 10);
    if (end == text || *end != stop || value < min || value > max) return false;
    *ret = value;
    *ret_end = end;
    return true;
}

static bool parse_shard(const char *text, struct arguments *a)
{
    const char *end;
    long shard, shards;
    if (!parse_whole(text, 1, INT_MAX, '/', &end, &shard)) return false;
    if (!parse_whole(end + 1, shard, INT_MAX, '\0', &end, &shards)) return false;
    a->shard = (size_t)shard - 1;
    a->shards = (size_t)shards;
    return true;
}

/* What the texts of the options say; a message names the one that is wrong. */
static bool read_numbers(const struct cli_usage *usage, const char *jobs, const char *shard,
                         struct arguments *a)
{
    if (jobs != NULL && !cli_whole_number(usage, "--jobs", jobs, 1, CREW_MEMBERS_MAX, &a->jobs))
        return false;
    if (shard == NULL || parse_shard(shard, a)) return true;
    (void)fprintf(stderr, "ischia study factorial: --shard is I/N with I from 1 to N, not %.40s\n",
                  shard);
    return false;
}

static enum cli_parse parse_arguments(int argc, char **argv, struct arguments *a)
{
    const char *jobs = NULL, *shard = NULL;
    const struct cli_option table[] = {
        {"--output", 'o', "FILE",
         "the result file; FILE.journal keeps finished rows, so that the\n"
         "                             same command goes on where it was stopped, even by kill -9",
         &a->output, NULL},
        {"--jobs", 'j', "N", "how many rows to solve at once (default: one a processor)", &jobs,
         NULL},
        {"--model", 0, "NAME", "a named set of model options, for a design that does not say",
         &a->defaults.model, NULL},
        {"--resolution", 0, "NAME", "standard, fine or coarse, likewise", &a->defaults.resolution,
         NULL},
        {"--shard", 0, "I/N",
         "every Nth side from side I on, a side being the rows that differ\n"
         "                             in F alone; `ischia study merge` joins shards",
         &shard, NULL},
        {"--points", 0, NULL, "write the points and solve nothing", NULL, &a->points},
        {"--quiet", 'q', NULL, "no progress on stderr", NULL, &a->quiet},
        {0},
    };
    const struct cli_usage usage = {
        .command = "study factorial",
        .synopsis = "DESIGN.json -o OUT.csv",
        .about = "Solves every point of a design: one row of OUT.csv for each, with status and\n"
                 "reason.",
        .options = table,
        .operands_max = 1,
    };
    *a = (struct arguments){.jobs = processors(), .shards = 1};
    const enum cli_parse parsed = study_parse(&usage, 1, argc, argv, &a->design);
    if (parsed != CLI_RUN) return parsed;
    if (!read_numbers(&usage, jobs, shard, a)) return CLI_BAD_USAGE;
    const bool to_file = a->output != NULL && strcmp(a->output, "-") != 0;
    return a->points || to_file ? CLI_RUN : study_lacks(&usage, "--output with a file's name");
}

static void count_row(struct study *s, const char *text)
{
    s->done++;
    if (strncmp(text, "succeeded,", strlen("succeeded,")) != 0) s->failed++;
}

/* ---- progress ---- */

static double now_s(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

/* "1 h 05 min", "3 min 10 s", "8 s". */
static void duration_words(double seconds, char *ret, size_t size)
{
    const long s = lround(seconds);
    if (s >= 3600) {
        (void)snprintf(ret, size, "%ld h %02ld min", s / 3600, s / 60 % 60);
    } else if (s >= 60) {
        (void)snprintf(ret, size, "%ld min %02ld s", s / 60, s % 60);
    } else {
        (void)snprintf(ret, size, "%ld s", s);
    }
}

static void state_words(const struct study *s, char *ret, size_t size)
{
    char time[32] = "", without[48] = "";
    const double elapsed = now_s() - s->start_s;
    const bool finished = s->done == s->total;
    const double left = elapsed / (double)(s->done - s->before + (s->done == s->before)) *
                        (double)(s->total - s->done);
    duration_words(finished ? elapsed : left, time, sizeof time);
    if (s->failed > 0) (void)snprintf(without, sizeof without, ", %zu without result", s->failed);
    (void)snprintf(ret, size, "%zu/%zu rows%s, %s%s%s", s->done, s->total, without,
                   finished ? "took " : "about ", time, finished ? "" : " left");
}

/* A bar on a terminal; elsewhere a line every ten seconds, so that a log stays readable. */
static void show_progress(struct study *s)
{
    char words[160];
    const double now = now_s(), pause = s->bar.shown ? 0.2 : 10;
    if (s->arguments->quiet || s->done == s->total || now - s->shown_s < pause) return;
    s->shown_s = now;
    state_words(s, words, sizeof words);
    if (s->bar.shown) {
        bar_draw(&s->bar, (double)s->done / (double)s->total, words);
    } else {
        (void)fprintf(stderr, "%s\n", words);
    }
}

static void start_progress(struct study *s)
{
    bar_init(&s->bar);
    s->before = s->done;
    s->start_s = s->shown_s = now_s();
    if (s->done > 0 && !s->arguments->quiet)
        (void)fprintf(stderr, "%zu of %zu rows are there from an earlier run\n", s->done, s->total);
}

static void end_progress(struct study *s)
{
    char words[160];
    if (s->arguments->quiet) return;
    bar_clear(&s->bar);
    state_words(s, words, sizeof words);
    (void)fprintf(stderr, "%s\n", words);
}

/* ---- rows ---- */

static enum ischia_code add_row(struct study *s, size_t row, double wall_s, struct text_out *text,
                                struct ischia_error *err)
{
    char *line;
    TRY(text_out_take(text, &line, NULL, err));
    const enum ischia_code code = study_journal_add(&s->journal, row, wall_s, line, err);
    if (code == ISCHIA_OK) count_row(s, line);
    free(line);
    return code;
}

static void put_answer(struct text_out *out, const struct crew_answer *answer,
                       const struct study_plan *plan)
{
    const struct ischia_numerics *numerics = &answer->result.numerics;
    const bool solved = answer->code == ISCHIA_OK;
    study_response_put(
        out, solved ? &answer->result : NULL,
        solved ? ischia_reason_name(numerics->reason) : ischia_code_name(answer->code),
        solved ? numerics->detail : answer->message, plan->response, plan->response_count);
}

/* A row whose process died (killed for memory, say) is solved once more before it fails. */
static enum ischia_code row_answered(struct study *s, const struct crew_answer *answer,
                                     struct ischia_error *err)
{
    const size_t row = (size_t)answer->job;
    struct text_out text;
    CHECK(answer->code != ISCHIA_E_MEMORY, err, ISCHIA_E_MEMORY, "row %zu: %.400s", row + 1,
          answer->message);
    if (answer->code == ISCHIA_E_STATE && !s->died[row]) {
        const struct crew_order order = {.c = design_case(&s->plan.design, &s->plan.points, row)};
        s->died[row] = true;
        return crew_give(&s->crew, answer->member, answer->job, &order, err);
    }
    text_out_init(&text);
    put_answer(&text, answer, &s->plan);
    return add_row(s, row, answer->result.numerics.wall_s, &text, err);
}

/* A point that is not a valid case is a row too: refused, with the reason. */
static enum ischia_code refuse(struct study *s, size_t row, const struct ischia_case *c,
                               struct ischia_error *err)
{
    struct text_out text;
    text_out_init(&text);
    study_response_put_refused(&text, c, s->plan.response_count);
    return add_row(s, row, 0, &text, err);
}

static enum ischia_code give_row(struct study *s, int member, size_t row, struct ischia_error *err)
{
    const struct crew_order order = {.c = design_case(&s->plan.design, &s->plan.points, row)};
    if (!ischia_case_is_valid(&order.c)) return refuse(s, row, &order.c, err);
    return crew_give(&s->crew, member, (long)row, &order, err);
}

/* The next row of the side that a member is at, or the first of the next; false: none is left. */
static bool take_row(struct study *s, int member, size_t *ret)
{
    struct lane *lane = &s->lane[member];
    if (lane->next == lane->end) {
        lane->next = s->next_side;
        lane->end = s->next_side = study_sides_end(&s->sides, s->next_side);
    }
    if (lane->next == lane->end) return false;
    *ret = s->sides.row[lane->next++];
    return true;
}

static enum ischia_code give_rows(struct study *s, struct ischia_error *err)
{
    for (int member = 0; member < s->crew.count; member++) {
        size_t row;
        while (crew_is_idle(&s->crew, member) && take_row(s, member, &row))
            TRY(give_row(s, member, row, err));
    }
    return ISCHIA_OK;
}

static enum ischia_code work_through(struct study *s, struct ischia_error *err)
{
    static struct crew_answer answer; /* large, and there is one study in a process */
    do {
        TRY(give_rows(s, err));
        if (!crew_is_working(&s->crew)) break;
        TRY(crew_wait(&s->crew, &answer, err));
        TRY(row_answered(s, &answer, err));
        show_progress(s);
    } while (true);
    return ISCHIA_OK;
}

static bool is_unsolved(void *context, size_t row)
{
    const struct study *s = context;
    return s->mine[row] && s->journal.text[row] == NULL;
}

static void count_finished(struct study *s)
{
    for (size_t row = 0; row < s->plan.points.count; row++) {
        if (!s->mine[row]) continue;
        s->total++;
        if (s->journal.text[row] != NULL) count_row(s, s->journal.text[row]);
    }
}

static enum ischia_code write_result(struct study *s, struct ischia_error *err)
{
    struct text_out out;
    text_out_init(&out);
    study_plan_put_header(&out, &s->plan);
    for (size_t row = 0; row < s->plan.points.count; row++) {
        if (!s->mine[row]) continue;
        study_plan_put_inputs(&out, &s->plan, row);
        text_put_string(&out, s->journal.text[row]);
        text_put_string(&out, "\n");
    }
    return study_write(&out, s->arguments->output, err);
}

static enum ischia_code solve_rows(struct study *s, struct ischia_error *err)
{
    count_finished(s);
    start_progress(s);
    TRY(study_sides_init(&s->sides, &s->plan.design, &s->plan.points, is_unsolved, s, err));
    if (s->done < s->total) {
        TRY(crew_start(&s->crew, s->arguments->jobs, NULL, err));
        const enum ischia_code code = work_through(s, err);
        crew_stop(&s->crew);
        TRY(code);
    }
    end_progress(s);
    return write_result(s, err);
}

static enum ischia_code run_study(struct study *s, struct ischia_error *err)
{
    char journal[PATH_MAX];
    const int needed = snprintf(journal, sizeof journal, "%s.journal", s->arguments->output);
    CHECK(needed > 0 && (size_t)needed < sizeof journal, err, ISCHIA_E_LIMIT,
          "the path %s is too long", s->arguments->output);
    TRY(study_journal_open(&s->journal, journal, study_plan_fingerprint(&s->plan),
                           s->plan.points.count, err));
    const enum ischia_code code = solve_rows(s, err);
    study_journal_close(&s->journal);
    study_sides_finish(&s->sides);
    return code;
}

/* The same lines as a result file's, cut off after the inputs. */
static enum ischia_code write_points(struct study *s, struct ischia_error *err)
{
    struct text_out out;
    text_out_init(&out);
    s->plan.response_count = 0;
    study_plan_put_header(&out, &s->plan);
    for (size_t row = 0; row < s->plan.points.count; row++) {
        if (!s->mine[row]) continue;
        study_plan_put_inputs(&out, &s->plan, row);
        text_put_string(&out, ",\n");
    }
    return study_write(&out, s->arguments->output, err);
}

static enum ischia_code run(struct study *s, struct ischia_error *err)
{
    const struct arguments *a = s->arguments;
    const size_t rows = s->plan.points.count;
    s->mine = calloc(rows + 1, sizeof *s->mine);
    s->died = calloc(rows + 1, sizeof *s->died);
    CHECK(s->mine && s->died, err, ISCHIA_E_MEMORY, "out of memory for %zu rows", rows);
    TRY(file_out_check(a->output, &a->design, 1, err));
    TRY(study_sides_deal(&s->plan.design, &s->plan.points, a->shard, a->shards, s->mine, err));
    return a->points ? write_points(s, err) : run_study(s, err);
}

static int report(const struct study *s)
{
    if (s->failed == 0) return EXIT_DONE;
    (void)fprintf(stderr, "%zu of %zu rows have no result: their reasons are in %s\n", s->failed,
                  s->total, s->arguments->output);
    return EXIT_SOLVE_FAILED;
}

int study_factorial(int argc, char **argv)
{
    struct arguments arguments;
    struct study study = {.arguments = &arguments};
    struct ischia_error err;
    const enum cli_parse parsed = parse_arguments(argc, argv, &arguments);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    enum ischia_code code =
        study_load_plan(&study.plan, arguments.design, &arguments.defaults, &err);
    if (code == ISCHIA_OK) {
        code = run(&study, &err);
        free(study.mine);
        free(study.died);
        study_plan_finish(&study.plan);
    }
    return code == ISCHIA_OK ? report(&study) : study_failed("factorial", &err);
}
