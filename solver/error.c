/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/error.h"

#include <stdarg.h>
#include <stdio.h>

static const char *const code_names[ISCHIA_CODE_COUNT] = {
    [ISCHIA_OK] = "ok",         [ISCHIA_E_INPUT] = "input",     [ISCHIA_E_MEMORY] = "memory",
    [ISCHIA_E_IO] = "io",       [ISCHIA_E_NUMERIC] = "numeric", [ISCHIA_E_CANCELLED] = "cancelled",
    [ISCHIA_E_LIMIT] = "limit", [ISCHIA_E_STATE] = "state",
};

const char *ischia_code_name(enum ischia_code code)
{
    if ((unsigned)code >= ISCHIA_CODE_COUNT) return "unknown";
    return code_names[code];
}

void ischia_fail(struct ischia_error *err, enum ischia_code code, const char *file, int line,
                 const char *format, ...)
{
    if (err == NULL) return;
    va_list arguments;
    err->code = code;
    err->file = file;
    err->line = line;
    va_start(arguments, format);
    (void)vsnprintf(err->message, sizeof err->message, format, arguments);
    va_end(arguments);
}
