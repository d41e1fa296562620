/* SPDX-License-Identifier: GPL-3.0-or-later */
/* ischia solve: one case in, the result object out. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "api/result_doc.h"
#include "server/cli/files.h"
#include "server/cli/options.h"
#include "server/cli/run.h"
#include "server/cli/section_words.h"
#include "server/cli/summary.h"
#include "server/cli/uncertain.h"

struct solve_options {
    const char *vtu, *svg, *resolution, *emulator;
    bool summary;
};

static enum ischia_code print_json(const struct ischia_case *c,
                                   const struct uncertain_solution *solved,
                                   struct ischia_error *err)
{
    char *text;
    TRY(result_doc_text(&text, c, &solved->result, uncertain_of(solved), 2, err));
    const int printed = printf("%s\n", text);
    free(text);
    CHECK(printed >= 0 && fflush(stdout) == 0, err, ISCHIA_E_IO, "cannot write standard output: %s",
          strerror(errno));
    return ISCHIA_OK;
}

static enum ischia_code
print_result(const struct solve_options *options, const struct ischia_request *request,
             const struct uncertain_solution *solved, struct ischia_error *err)
{
    if (!options->summary) return print_json(&request->values, solved, err);
    summary_print(stdout, request, &solved->result, uncertain_of(solved));
    CHECK(fflush(stdout) == 0 && !ferror(stdout), err, ISCHIA_E_IO,
          "cannot write standard output: %s", strerror(errno));
    return ISCHIA_OK;
}

static enum ischia_code write_fields(const struct solve_options *options,
                                     const struct ischia_case *c, const struct ischia_field *field,
                                     struct ischia_error *err)
{
    if (options->vtu != NULL) TRY(write_file(options->vtu, ischia_write_vtu, c, field, err));
    if (options->svg != NULL) TRY(write_file(options->svg, section_write_english, c, field, err));
    return ISCHIA_OK;
}

static enum ischia_code compute(const struct solve_options *options,
                                const struct ischia_request *request,
                                struct uncertain_solution *ret, struct ischia_error *err)
{
    struct ischia_solver *solver = NULL;
    struct estimator *estimator = NULL;
    struct bar bar;
    const struct ischia_observer observer = observe_with_bar(&bar);
    enum ischia_code code = ISCHIA_OK;
    if (request->has_sd) code = uncertain_emulator(&estimator, options->emulator, err);
    if (code == ISCHIA_OK) code = ischia_solver_create(&solver, err);
    if (code == ISCHIA_OK) code = uncertain_solve(solver, estimator, request, &observer, ret, err);
    ischia_solver_destroy(solver);
    estimator_destroy(estimator);
    bar_clear(&bar);
    return code;
}

/* Standard output has the result already. */
static enum ischia_code check_drawing(const char *option, const char *path,
                                      const char *const inputs[2], struct ischia_error *err)
{
    if (path == NULL) return ISCHIA_OK;
    CHECK(strcmp(path, "-") != 0, err, ISCHIA_E_INPUT,
          "%s needs the name of a file: the result goes to standard output", option);
    CHECK(inputs[1] == NULL || strcmp(path, inputs[1]) != 0, err, ISCHIA_E_INPUT,
          "--vtu and --svg both name %s", path);
    return file_out_check(path, inputs, 2, err);
}

static enum ischia_code check_outputs(const struct solve_options *options, const char *input,
                                      struct ischia_error *err)
{
    TRY(check_drawing("--vtu", options->vtu, (const char *const[]){input, NULL}, err));
    return check_drawing("--svg", options->svg, (const char *const[]){input, options->vtu}, err);
}

static int solve(const struct solve_options *options, const char *input,
                 const struct ischia_request *request)
{
    struct uncertain_solution solved;
    struct ischia_error err;
    const struct ischia_case *c = &request->values;
    if (check_outputs(options, input, &err) != ISCHIA_OK) return report_error("solve", &err);
    if (compute(options, request, &solved, &err) != ISCHIA_OK) return report_error("solve", &err);
    const bool converged = ischia_result_converged(&solved.result);
    enum ischia_code code = print_result(options, request, &solved, &err);
    if (code == ISCHIA_OK && converged) code = write_fields(options, c, &solved.field, &err);
    ischia_field_finish(&solved.field);
    if (!converged) report_divergence("solve", c, &solved.result);
    if (code != ISCHIA_OK) return report_error("solve", &err);
    return converged ? EXIT_DONE : EXIT_SOLVE_FAILED;
}

int command_solve(int argc, char **argv)
{
    struct solve_options options = {0};
    const struct cli_option table[] = {
        {"--resolution", 0, "NAME", "standard, fine or coarse, instead of the case's own",
         &options.resolution, NULL},
        {"--emulator", 0, "FILE", "a trained emulator instead of the installed one, for \"sd\"",
         &options.emulator, NULL},
        {"--vtu", 0, "OUT", "also write the deformed model for ParaView", &options.vtu, NULL},
        {"--svg", 0, "OUT", "also draw the symmetry section", &options.svg, NULL},
        {"--summary", 0, NULL, "print a summary with units instead of JSON", NULL,
         &options.summary},
        {0},
    };
    const struct cli_usage usage = {
        .command = "solve",
        .synopsis = "[FILE|-]",
        .about = "Solves one side. FILE is a JSON object with R1, R2, eM, eF, muM, muF and F\n"
                 "(standard input when it is - or left out). The result object goes to standard\n"
                 "output; a result that did not converge has null for what is not known. With\n"
                 "\"sd\" (an object of standard deviations, or \"typical\") it says how uncertain\n"
                 "it is.",
        .options = table,
        .operands_max = 1,
    };
    const char *path = "-";
    struct ischia_request request;
    const enum cli_parse parsed = cli_parse_options(&usage, argc, argv, &path);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    const int read = read_request("solve", path, options.resolution, &request);
    return read == EXIT_DONE ? solve(&options, path, &request) : read;
}
