/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "server/config.h"
#include "tests/fuzz/fuzz.h"

/* A configuration file. One that is accepted survives being printed and read again. */

static void read_again(const struct config *config)
{
    struct config again = config_default();
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (out == NULL) return;
    config_print(config, out);
    if (fclose(out) == 0) {
        const enum ischia_code code = config_parse(&again, text, size, "printed", NULL);
        MUST(code == ISCHIA_OK);
        MUST(config_check(&again, NULL) == config_check(config, NULL));
    }
    free(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct config config = config_default();
    struct ischia_error err;
    if (config_parse(&config, (const char *)data, size, "fuzz", &err) == ISCHIA_OK)
        read_again(&config);
    else
        MUST(err.message[0] != '\0');
    return 0;
}
