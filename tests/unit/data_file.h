/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_UNIT_DATA_FILE_H
#define ISCHIA_TESTS_UNIT_DATA_FILE_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Reads the committed tables of expected values: plain CSV, no quotes, one header line. */
enum { DATA_COLUMNS_MAX = 24 };

struct data_file {
    FILE *in;
    char line[2048];
    char *word[DATA_COLUMNS_MAX]; /* of the present row */
    int count;
};

static inline bool data_next(struct data_file *file)
{
    file->count = 0;
    if (fgets(file->line, sizeof file->line, file->in) == NULL) return false;
    char *rest = file->line;
    for (char *word; (word = strsep(&rest, ",\n")) != NULL && file->count < DATA_COLUMNS_MAX;)
        file->word[file->count++] = word;
    return true;
}

/* The header is read away: the next row is the first of the data. False: no such file. */
static inline bool data_open(struct data_file *file, const char *name)
{
    char path[1024];
    (void)snprintf(path, sizeof path, "%s/%s", UNIT_DATA, name);
    file->in = fopen(path, "r");
    return file->in != NULL && data_next(file);
}

static inline double data_number(const struct data_file *file, int column)
{
    return strtod(file->word[column], NULL);
}

#endif
