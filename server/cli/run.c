/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/run.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/case_words.h"
#include "api/problem_doc.h"
#include "server/cli/bar.h"
#include "server/cli/files.h"

int report_error(const char *command, const struct ischia_error *err)
{
    static const char *const advice[ISCHIA_CODE_COUNT] = {
        [ISCHIA_E_MEMORY] = "; free some memory or use fewer processes",
    };
    char shown[ISCHIA_ERROR_MESSAGE_BYTES];
    const char *more = advice[err->code] != NULL ? advice[err->code] : "";
    (void)fprintf(stderr, "ischia %s: %s%s\n", command,
                  text_printable(err->message, shown, sizeof shown), more);
    const bool input = err->code == ISCHIA_E_INPUT || err->code == ISCHIA_E_LIMIT ||
                       err->code == ISCHIA_E_STATE; /* another file, or another moment, will do */
    return input ? EXIT_BAD_INPUT : EXIT_SOLVE_FAILED;
}

static void print_faults(const char *command, const char *path, const struct doc_faults *faults)
{
    char name[FILENAME_MAX], detail[ISCHIA_ERROR_MESSAGE_BYTES];
    text_printable(path, name, sizeof name);
    for (size_t i = 0; i < faults->count; i++)
        (void)fprintf(stderr, "ischia %s: %s: %s\n", command, name,
                      text_printable(faults->item[i].detail, detail, sizeof detail));
    if (faults->dropped > 0)
        (void)fprintf(stderr, "ischia %s: %s: and %zu more\n", command, name, faults->dropped);
}

static void print_warnings(const char *command, const char *path, const struct ischia_case *c)
{
    struct ischia_fault warnings[ISCHIA_PARAM_COUNT];
    const size_t count = case_warnings(c, LANGUAGE_EN, warnings);
    for (size_t i = 0; i < count; i++)
        (void)fprintf(stderr, "ischia %s: %s: warning: %s\n", command, path, warnings[i].detail);
}

static bool set_resolution(struct ischia_request *request, const char *name)
{
    for (int i = 0; i < ISCHIA_RESOLUTION_COUNT; i++)
        if (strcmp(name, ischia_resolution_names[i]) == 0) {
            request->values.resolution = (enum ischia_resolution)i;
            return true;
        }
    return false;
}

int read_request_text(const char *command, const char *name, const char *text, size_t length,
                      const char *resolution, struct ischia_request *ret)
{
    struct doc_faults faults;
    struct ischia_error err;
    doc_faults_init(&faults);
    const enum ischia_code code =
        case_doc_read(ret, text, length, &json_limits_request, &faults, &err);
    if (code == ISCHIA_E_INPUT)
        doc_faults_add(&faults, "", "malformed", "%s", err.message);
    else if (code != ISCHIA_OK)
        return report_error(command, &err);
    else if (resolution != NULL && !set_resolution(ret, resolution))
        doc_faults_add(&faults, "/resolution", "not_allowed",
                       "resolution is %s; accepted standard, fine, coarse", resolution);
    print_faults(command, name, &faults);
    if (faults.count > 0) return EXIT_BAD_INPUT;
    print_warnings(command, name, &ret->values);
    return EXIT_DONE;
}

int read_request(const char *command, const char *path, const char *resolution,
                 struct ischia_request *ret)
{
    struct ischia_error err;
    char *text;
    size_t length;
    if (file_read(path, json_limits_request.bytes_max, &text, &length, &err) != ISCHIA_OK)
        return report_error(command, &err);
    const int read = read_request_text(command, file_name(path), text, length, resolution, ret);
    free(text);
    return read;
}

static double seconds(clockid_t clock)
{
    struct timespec t = {0};
    (void)clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

enum ischia_code timed_solve(struct ischia_solver *solver, const struct ischia_case *c,
                             const struct ischia_observer *observer,
                             struct ischia_result *ret_result, struct ischia_field *ret_field,
                             struct ischia_error *err)
{
    const double wall = seconds(CLOCK_MONOTONIC), cpu = seconds(CLOCK_THREAD_CPUTIME_ID);
    TRY(ischia_solve(solver, c, observer, ret_result, ret_field, err));
    ret_result->numerics.wall_s = seconds(CLOCK_MONOTONIC) - wall;
    ret_result->numerics.cpu_s = seconds(CLOCK_THREAD_CPUTIME_ID) - cpu;
    return ISCHIA_OK;
}

static bool draw_progress(void *context, const struct ischia_progress *progress)
{
    char words[80];
    (void)snprintf(words, sizeof words, "%.0f N, load step %d, iteration %d", progress->F_N,
                   progress->load_step, progress->newton_iteration);
    bar_draw(context, progress->fraction, words);
    return true;
}

struct ischia_observer observe_with_bar(struct bar *bar)
{
    bar_init(bar);
    return (struct ischia_observer){.on_progress = draw_progress, .context = bar};
}

enum ischia_code solve_with_bar(const struct ischia_case *c, struct ischia_result *ret_result,
                                struct ischia_field *ret_field, struct ischia_error *err)
{
    struct ischia_solver *solver;
    struct bar bar;
    const struct ischia_observer observer = observe_with_bar(&bar);
    TRY(ischia_solver_create(&solver, err));
    const enum ischia_code code = timed_solve(solver, c, &observer, ret_result, ret_field, err);
    ischia_solver_destroy(solver);
    bar_clear(&bar);
    return code;
}

enum ischia_code write_file(const char *path, field_writer *writer, const struct ischia_case *c,
                            const struct ischia_field *field, struct ischia_error *err)
{
    struct file_out out;
    TRY(file_out_open(&out, path, err));
    return file_out_close(&out, writer(out.stream, c, field, err), err);
}

void report_divergence(const char *command, const struct ischia_case *c,
                       const struct ischia_result *result)
{
    struct problem problem;
    problem_from_result(&problem, c, result);
    (void)fprintf(stderr, "ischia %s: the solve failed (%s): %s\n", command, problem.reason,
                  problem.detail);
}
