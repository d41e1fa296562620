/* SPDX-License-Identifier: GPL-3.0-or-later */
/* ischia version. */
#include "api/json.h"
#include "server/cli/command.h"
#include "server/cli/options.h"
#include "solver/case.h"

/* Declared here, not included: only solver/linear.c may see cholmod.h. Weak, as the BLAS may be
 * another one and a test build may have neither. */
__attribute__((weak)) int cholmod_version(int version[3]);
__attribute__((weak)) char *openblas_get_config(void);

int command_version(int argc, char **argv)
{
    const struct cli_option none[] = {{0}};
    const struct cli_usage usage = {
        .command = "version",
        .synopsis = "",
        .about = "Shows the versions of the program, the model and the libraries in use.",
        .options = none,
        .operands_max = 0,
    };
    int cholmod[3] = {0};
    const enum cli_parse parsed = cli_parse_options(&usage, argc, argv, NULL);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    printf("ischia %s\n", ISCHIA_VERSION);
    printf("model %s %d\n", ISCHIA_MODEL_NAME, ISCHIA_MODEL_VERSION);
    printf("cJSON %s\n", json_library_version());
    if (cholmod_version != NULL) {
        (void)cholmod_version(cholmod);
        printf("CHOLMOD %d.%d.%d\n", cholmod[0], cholmod[1], cholmod[2]);
    }
    if (openblas_get_config != NULL) printf("BLAS %s\n", openblas_get_config());
    return EXIT_DONE;
}
