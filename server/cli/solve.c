/* SPDX-License-Identifier: GPL-3.0-or-later */
/* ischia solve: one case in, the result object out. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "api/result_doc.h"
#include "server/cli/options.h"
#include "server/cli/run.h"
#include "server/cli/section_words.h"
#include "server/cli/summary.h"

struct solve_options {
    const char *vtu, *svg, *resolution;
    bool summary;
};

static enum ischia_code print_json(const struct ischia_case *c, const struct ischia_result *result,
                                   struct ischia_error *err)
{
    char *text;
    TRY(result_doc_text(&text, c, result, 2, err));
    const int printed = printf("%s\n", text);
    free(text);
    CHECK(printed >= 0 && fflush(stdout) == 0, err, ISCHIA_E_IO, "cannot write standard output: %s",
          strerror(errno));
    return ISCHIA_OK;
}

static enum ischia_code print_result(const struct solve_options *options,
                                     const struct ischia_request *request,
                                     const struct ischia_result *result, struct ischia_error *err)
{
    if (!options->summary) return print_json(&request->values, result, err);
    summary_print(stdout, request, result);
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

static int solve(const struct solve_options *options, const struct ischia_request *request)
{
    struct ischia_result result;
    struct ischia_field field;
    struct ischia_error err;
    const struct ischia_case *c = &request->values;
    if (solve_with_bar(c, &result, &field, &err) != ISCHIA_OK) return report_error("solve", &err);
    const bool converged = ischia_result_converged(&result);
    enum ischia_code code = print_result(options, request, &result, &err);
    if (code == ISCHIA_OK && converged) code = write_fields(options, c, &field, &err);
    ischia_field_finish(&field);
    if (!converged) report_divergence("solve", c, &result);
    if (code != ISCHIA_OK) return report_error("solve", &err);
    return converged ? EXIT_DONE : EXIT_SOLVE_FAILED;
}

int command_solve(int argc, char **argv)
{
    struct solve_options options = {0};
    const struct cli_option table[] = {
        {"--resolution", 0, "NAME", "standard, fine or coarse, instead of the case's own",
         &options.resolution, NULL},
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
                 "output; a result that did not converge has null for what is not known.",
        .options = table,
        .operands_max = 1,
    };
    const char *path = "-";
    struct ischia_request request;
    const enum cli_parse parsed = cli_parse_options(&usage, argc, argv, &path);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    const int read = read_request("solve", path, options.resolution, &request);
    return read == EXIT_DONE ? solve(&options, &request) : read;
}
