/* SPDX-License-Identifier: GPL-3.0-or-later */
/* ischia export: the model of a case for other programs. */
#include "server/cli/files.h"
#include "server/cli/options.h"
#include "server/cli/run.h"
#include "server/cli/section_words.h"

static enum ischia_code write_inp(FILE *out, const struct ischia_case *c,
                                  const struct ischia_field *field, struct ischia_error *err)
{
    (void)field; /* the deck is the unsolved model */
    return ischia_write_inp(out, c, err);
}

enum format { FORMAT_INP, FORMAT_VTU, FORMAT_SVG, FORMAT_COUNT };
static const struct {
    field_writer *write;
    bool needs_solve;
} formats[FORMAT_COUNT] = {
    [FORMAT_INP] = {write_inp, false},
    [FORMAT_VTU] = {ischia_write_vtu, true},
    [FORMAT_SVG] = {section_write_english, true},
};

static int export_case(enum format format, const char *input, const char *path,
                       const struct ischia_case *c)
{
    struct ischia_result result;
    struct ischia_field field = {0};
    struct ischia_error err;
    if (file_out_check(path, &input, 1, &err) != ISCHIA_OK) return report_error("export", &err);
    if (formats[format].needs_solve) {
        if (solve_with_bar(c, &result, &field, &err) != ISCHIA_OK)
            return report_error("export", &err);
        if (!ischia_result_converged(&result)) {
            report_divergence("export", c, &result);
            ischia_field_finish(&field);
            return EXIT_SOLVE_FAILED;
        }
    }
    const enum ischia_code code = write_file(path, formats[format].write, c, &field, &err);
    ischia_field_finish(&field);
    return code == ISCHIA_OK ? EXIT_DONE : report_error("export", &err);
}

int command_export(int argc, char **argv)
{
    const char *output = "-", *resolution = NULL, *path = "-";
    bool wanted[FORMAT_COUNT] = {false};
    const struct cli_option table[] = {
        {"--inp", 0, NULL, "the unsolved model as a CalculiX/Abaqus input deck", NULL,
         &wanted[FORMAT_INP]},
        {"--vtu", 0, NULL, "the solved, deformed model for ParaView", NULL, &wanted[FORMAT_VTU]},
        {"--svg", 0, NULL, "the solved symmetry section as a drawing", NULL, &wanted[FORMAT_SVG]},
        {"--output", 'o', "OUT", "where to (default: standard output)", &output, NULL},
        {"--resolution", 0, "NAME", "standard, fine or coarse, instead of the case's own",
         &resolution, NULL},
        {0},
    };
    const struct cli_usage usage = {
        .command = "export",
        .synopsis = "--inp|--vtu|--svg [FILE|-]",
        .about = "Writes the model of one case for other programs.",
        .options = table,
        .operands_max = 1,
    };
    struct ischia_request request;
    enum format format = FORMAT_INP;
    int formats_wanted = 0;
    const enum cli_parse parsed = cli_parse_options(&usage, argc, argv, &path);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    for (int i = 0; i < FORMAT_COUNT; i++) {
        formats_wanted += wanted[i];
        if (wanted[i]) format = (enum format)i;
    }
    if (formats_wanted != 1) {
        (void)fprintf(stderr, "ischia export: give one of --inp, --vtu and --svg\n");
        return EXIT_BAD_INPUT;
    }
    const int read = read_request("export", path, resolution, &request);
    return read == EXIT_DONE ? export_case(format, path, output, &request.values) : read;
}
