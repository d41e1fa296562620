/* SPDX-License-Identifier: GPL-3.0-or-later */
/* ischia version; and what a worker tells ischiad of itself. */
#include <string.h>

#include "api/json.h"
#include "server/cli/command.h"
#include "server/cli/options.h"
#include "server/cli/version.h"
#include "solver/case.h"

/* Declared here, not included: only solver/linear.c may see cholmod.h. Weak, as the BLAS may be
 * another one and a test build may have neither. */
__attribute__((weak)) int cholmod_version(int version[3]);
__attribute__((weak)) char *openblas_get_config(void);

static void append(char *text, size_t size, const char *word, int length)
{
    const size_t used = strlen(text);
    (void)snprintf(text + used, size - used, "%.*s", length, word);
}

/* OpenBLAS tells its name, its version and then how it was built. */
static int first_two_words(const char *text)
{
    const char *space = strchr(text, ' ');
    const char *end = space == NULL ? NULL : strchr(space + 1, ' ');
    return (int)(end == NULL ? strlen(text) : (size_t)(end - text));
}

void version_of_worker(char *ret, size_t size)
{
    int cholmod[3] = {0};
    (void)snprintf(ret, size, "%s", ISCHIA_VERSION);
    if (cholmod_version != NULL) {
        char word[64];
        (void)cholmod_version(cholmod);
        append(
            ret, size, word,
            snprintf(word, sizeof word, ", CHOLMOD %d.%d.%d", cholmod[0], cholmod[1], cholmod[2]));
    }
    if (openblas_get_config == NULL) return;
    const char *blas = openblas_get_config();
    append(ret, size, ", ", 2);
    append(ret, size, blas, first_two_words(blas));
}

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
