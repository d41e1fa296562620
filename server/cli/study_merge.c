/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Joins shards. The design is read again, so every row can be checked against the inputs it should
 * have; the merged file is byte for byte the one that a single run would have written.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/study_plan.h"
#include "server/cli/files.h"
#include "server/cli/study.h"

enum { SHARD_BYTES_MAX = 1 << 28 };

struct merge {
    struct study_plan plan;
    char *header; /* with its line end */
    char **line;  /* [points.count] whole lines without line end, NULL while missing */
};

static enum ischia_code take_line(struct merge *m, const char *path, const char *line,
                                  struct ischia_error *err)
{
    struct text_out inputs;
    char *expected;
    const unsigned long long number = strtoull(line, NULL, 10);
    CHECK(number >= 1 && number <= m->plan.points.count, err, ISCHIA_E_INPUT,
          "%s has a line that is no row of the design: %.60s", path, line);
    const size_t row = (size_t)number - 1;
    text_out_init(&inputs);
    study_plan_put_inputs(&inputs, &m->plan, row);
    TRY(text_out_take(&inputs, &expected, NULL, err));
    const bool same = strncmp(line, expected, strlen(expected)) == 0;
    free(expected);
    CHECK(same, err, ISCHIA_E_INPUT, "%s: row %llu does not have the inputs of the design", path,
          number);
    CHECK(m->line[row] == NULL || strcmp(m->line[row], line) == 0, err, ISCHIA_E_INPUT,
          "%s: row %llu is in another shard with another result", path, number);
    if (m->line[row] == NULL) m->line[row] = strdup(line);
    CHECK(m->line[row] != NULL, err, ISCHIA_E_MEMORY, "out of memory for row %llu", number);
    return ISCHIA_OK;
}

/* A spreadsheet or a mail may have changed them. */
static void unix_line_ends(char *text)
{
    char *to = text;
    for (const char *from = text; *from != '\0'; from++)
        if (from[0] != '\r' || from[1] != '\n') *to++ = *from;
    *to = '\0';
}

static enum ischia_code take_lines(struct merge *m, const char *path, char *text, size_t length,
                                   struct ischia_error *err)
{
    const size_t header = strlen(m->header);
    const bool ended = length > 0 && text[length - 1] == '\n';
    unix_line_ends(text);
    CHECK(strncmp(text, m->header, header) == 0, err, ISCHIA_E_INPUT,
          "%s does not have the columns of the design", path);
    /* Half a number is a number too. */
    CHECK(ended, err, ISCHIA_E_INPUT, "%s ends within a line: a part of it is missing", path);
    char *rest = text + header;
    for (char *line; (line = strsep(&rest, "\n")) != NULL;)
        if (line[0] != '\0') TRY(take_line(m, path, line, err));
    return ISCHIA_OK;
}

static enum ischia_code take_shard(struct merge *m, const char *path, struct ischia_error *err)
{
    char *text;
    size_t length;
    TRY(file_read(path, SHARD_BYTES_MAX, &text, &length, err));
    const enum ischia_code code = take_lines(m, path, text, length, err);
    free(text);
    return code;
}

static enum ischia_code write_merged(struct merge *m, const char *path, struct ischia_error *err)
{
    struct text_out out;
    size_t missing = 0, first = 0;
    for (size_t row = m->plan.points.count; row-- > 0;) {
        if (m->line[row] != NULL) continue;
        missing++;
        first = row + 1;
    }
    CHECK(missing == 0, err, ISCHIA_E_INPUT,
          "%zu of %zu rows are in no shard, the first is row %zu", missing, m->plan.points.count,
          first);
    text_out_init(&out);
    text_put_string(&out, m->header);
    for (size_t row = 0; row < m->plan.points.count; row++) {
        text_put_string(&out, m->line[row]);
        text_put_string(&out, "\n");
    }
    return study_write(&out, path, err);
}

/* shards: NULL after the last. */
static enum ischia_code run_merge(struct merge *m, const char *const *shards, const char *output,
                                  struct ischia_error *err)
{
    struct text_out header;
    text_out_init(&header);
    study_plan_put_header(&header, &m->plan);
    TRY(text_out_take(&header, &m->header, NULL, err));
    m->line = calloc(m->plan.points.count + 1, sizeof *m->line);
    CHECK(m->line != NULL, err, ISCHIA_E_MEMORY, "out of memory for %zu rows",
          m->plan.points.count);
    for (; *shards != NULL; shards++) TRY(take_shard(m, *shards, err));
    return write_merged(m, output, err);
}

static void merge_finish(struct merge *m)
{
    for (size_t row = 0; m->line != NULL && row < m->plan.points.count; row++) free(m->line[row]);
    free(m->line);
    free(m->header);
    study_plan_finish(&m->plan);
}

int study_merge(int argc, char **argv)
{
    const struct case_doc_defaults defaults = {NULL, NULL};
    struct merge merge = {.header = NULL};
    struct ischia_error err;
    const char *output = NULL;
    const struct cli_option table[] = {
        {"--output", 'o', "FILE", "the result file", &output, NULL},
        {0},
    };
    const struct cli_usage usage = {
        .command = "study merge",
        .synopsis = "DESIGN.json SHARD.csv... -o OUT.csv",
        .about = "Joins the shards of a design into the file that one run would have written.",
        .options = table,
        .operands_max = argc,
    };
    const char **files = calloc((size_t)argc + 1, sizeof *files);
    if (files == NULL) {
        (void)FAIL(&err, ISCHIA_E_MEMORY, "out of memory");
        return study_failed("merge", &err);
    }
    enum cli_parse parsed = study_parse(&usage, 2, argc, argv, files);
    if (parsed == CLI_RUN && output == NULL) parsed = study_lacks(&usage, "--output");
    if (parsed != CLI_RUN) {
        free(files);
        return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    }
    enum ischia_code code = file_out_check(output, files, (size_t)argc, &err);
    if (code == ISCHIA_OK) code = study_load_plan(&merge.plan, files[0], &defaults, &err);
    if (code == ISCHIA_OK) code = run_merge(&merge, files + 1, output, &err);
    merge_finish(&merge);
    free(files);
    return code == ISCHIA_OK ? EXIT_DONE : study_failed("merge", &err);
}
