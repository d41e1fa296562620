/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/study.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "server/cli/files.h"
#include "server/cli/run.h"

struct sub_command {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *help;
};

static const struct sub_command sub_commands[] = {
    {"factorial", study_factorial, "solve every point of a design file, resumable, on N processes"},
    {"merge", study_merge, "join the shards of a design into one result file"},
    {"emulate", study_emulate, "fit polynomials to a result file: coefficients, sensitivities"},
    {"compare", study_compare, "how two columns or two files agree: correlation, errors, bias"},
};
enum { SUB_COMMANDS = sizeof sub_commands / sizeof sub_commands[0] };

static void print_help(FILE *out)
{
    (void)fputs("Usage: ischia study COMMAND [OPTION]...\n\nCommands:\n", out);
    for (int i = 0; i < SUB_COMMANDS; i++)
        (void)fprintf(out, "  %-10s %s\n", sub_commands[i].name, sub_commands[i].help);
    (void)fputs("\nischia study COMMAND --help shows its options.\n"
                "Exit status: 0 done, 1 a solve failed, 2 bad input or usage.\n",
                out);
}

static int unknown_command(const char *name)
{
    char shown[60], hint[60] = "";
    int least = TEXT_NO_SLIP;
    for (int i = 0; i < SUB_COMMANDS; i++) {
        const int slips = text_slips(name, sub_commands[i].name);
        if (slips >= least) continue;
        least = slips;
        (void)snprintf(hint, sizeof hint, "; did you mean %s?", sub_commands[i].name);
    }
    (void)fprintf(stderr, "ischia study: %s is not a command%s; see ischia study --help\n",
                  text_printable(name, shown, sizeof shown), hint);
    return EXIT_BAD_INPUT;
}

int command_study(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "";
    if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0) {
        print_help(stdout);
        return EXIT_DONE;
    }
    for (int i = 0; i < SUB_COMMANDS; i++)
        if (strcmp(name, sub_commands[i].name) == 0) return sub_commands[i].run(argc - 1, argv + 1);
    if (argc < 2) print_help(stderr);
    return argc < 2 ? EXIT_BAD_INPUT : unknown_command(name);
}

int study_failed(const char *what, const struct ischia_error *err)
{
    char command[40];
    (void)snprintf(command, sizeof command, "study %s", what);
    return report_error(command, err);
}

enum ischia_code study_load_plan(struct study_plan *ret, const char *path,
                                 const struct case_doc_defaults *defaults, struct ischia_error *err)
{
    struct doc_faults faults;
    char *text, shown[ISCHIA_ERROR_MESSAGE_BYTES];
    size_t length;
    doc_faults_init(&faults);
    struct ischia_error cause;
    TRY(file_read(path, STUDY_PLAN_BYTES_MAX, &text, &length, err));
    const enum ischia_code code =
        study_plan_read(ret, text, length, defaults, DESIGN_ROWS_MAX, &faults, &cause);
    free(text);
    CHECK(code == ISCHIA_OK, err, code, "%s: %.400s", file_name(path), cause.message);
    for (size_t i = 0; i < faults.count; i++)
        (void)fprintf(stderr, "ischia study: %s: %s: %s\n", file_name(path), faults.item[i].pointer,
                      text_printable(faults.item[i].detail, shown, sizeof shown));
    if (faults.dropped > 0)
        (void)fprintf(stderr, "ischia study: %s: and %zu more\n", file_name(path), faults.dropped);
    CHECK(faults.count == 0, err, ISCHIA_E_INPUT, "%s is not a design that can be run",
          file_name(path));
    return ISCHIA_OK;
}

enum cli_parse study_lacks(const struct cli_usage *usage, const char *what)
{
    (void)fprintf(stderr, "ischia %s: it needs %s; see ischia %s --help\n", usage->command, what,
                  usage->command);
    return CLI_BAD_USAGE;
}

enum cli_parse study_parse(const struct cli_usage *usage, int operands_min, int argc, char **argv,
                           const char **ret_operands)
{
    const enum cli_parse parsed = cli_parse_options(usage, argc, argv, ret_operands);
    if (parsed != CLI_RUN || ret_operands[operands_min - 1] != NULL) return parsed;
    return study_lacks(usage, usage->synopsis);
}

enum ischia_code study_write(struct text_out *text, const char *path, struct ischia_error *err)
{
    struct file_out out;
    char *bytes;
    size_t length;
    TRY(text_out_take(text, &bytes, &length, err));
    enum ischia_code code = file_out_open(&out, path != NULL ? path : "-", err);
    if (code == ISCHIA_OK) {
        if (fwrite(bytes, 1, length, out.stream) != length)
            code = FAIL(err, ISCHIA_E_IO, "cannot write %s: %s", out.path, strerror(errno));
        code = file_out_close(&out, code, err);
    }
    free(bytes);
    return code;
}
