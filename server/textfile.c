/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/textfile.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FILE_BYTES_MAX = 4 * 1024 * 1024 };

enum ischia_code textfile_read(const char *path, char **ret, struct ischia_error *err)
{
    char *text = calloc(1, FILE_BYTES_MAX);
    CHECK(text != NULL, err, ISCHIA_E_MEMORY, "no memory for %s", path);
    FILE *file = fopen(path, "re");
    if (file == NULL) {
        free(text);
        return FAIL(err, ISCHIA_E_INPUT, "cannot open %s: %s", path, strerror(errno));
    }
    const size_t size = fread(text, 1, FILE_BYTES_MAX, file);
    const bool good = ferror(file) == 0 && size > 0 && size < FILE_BYTES_MAX;
    (void)fclose(file);
    if (!good) free(text);
    CHECK(good, err, ISCHIA_E_IO, "cannot read %s", path);
    *ret = text;
    return ISCHIA_OK;
}
