/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/study_journal.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "api/text.h"

enum { HEADER_BYTES = 96, CRC_DIGITS = 8 };

/* CRC-32 as in IEEE 802.3, reflected, bit by bit: a line is a few hundred bytes. */
static uint32_t crc32_of(const char *bytes, size_t length)
{
    uint32_t crc = UINT32_MAX;
    for (size_t i = 0; i < length; i++) {
        crc ^= (unsigned char)bytes[i];
        for (int bit = 0; bit < 8; bit++)
            crc = (crc >> 1) ^ (UINT32_C(0xedb88320) & (0 - (crc & 1)));
    }
    return ~crc;
}

static void header_of(uint64_t fingerprint, size_t rows, char ret[HEADER_BYTES])
{
    (void)snprintf(ret, HEADER_BYTES, "ischia study journal 1, plan %016" PRIx64 ", %zu rows\n",
                   fingerprint, rows);
}

/* "CRC ROW WALL TEXT" -> row and text, false when the line is not whole. */
static bool parse_line(const char *line, size_t length, size_t rows, size_t *ret_row,
                       const char **ret_text)
{
    char *end;
    if (length < CRC_DIGITS + 2 || line[CRC_DIGITS] != ' ') return false;
    const unsigned long crc = strtoul(line, &end, 16);
    const char *body = line + CRC_DIGITS + 1;
    if (end != line + CRC_DIGITS || crc != crc32_of(body, length - CRC_DIGITS - 1)) return false;
    const unsigned long long row = strtoull(body, &end, 10);
    if (*end != ' ' || row < 1 || row > rows) return false;
    const char *text = strchr(end + 1, ' ');
    if (text == NULL) return false;
    *ret_row = (size_t)row - 1;
    *ret_text = text + 1;
    return true;
}

static enum ischia_code keep(struct study_journal *journal, size_t row, const char *text,
                             struct ischia_error *err)
{
    if (journal->text[row] != NULL) return ISCHIA_OK;
    journal->text[row] = strdup(text);
    CHECK(journal->text[row] != NULL, err, ISCHIA_E_MEMORY, "out of memory for row %zu", row + 1);
    journal->done++;
    return ISCHIA_OK;
}

static enum ischia_code load_line(struct study_journal *journal, char *line, size_t length,
                                  struct ischia_error *err)
{
    size_t row;
    const char *text;
    const bool ended = length > 0 && line[length - 1] == '\n';
    if (ended) line[length - 1] = '\0';
    if (!ended || !parse_line(line, length - 1, journal->rows, &row, &text)) {
        journal->damaged++;
        return ISCHIA_OK;
    }
    return keep(journal, row, text, err);
}

static enum ischia_code write_all(int fd, const char *bytes, size_t length,
                                  struct ischia_error *err)
{
    while (length > 0) {
        const ssize_t written = write(fd, bytes, length);
        if (written < 0 && errno == EINTR) continue;
        CHECK(written > 0, err, ISCHIA_E_IO, "the journal cannot be written: %s", strerror(errno));
        bytes += written;
        length -= (size_t)written;
    }
    CHECK(fdatasync(fd) == 0, err, ISCHIA_E_IO, "the journal cannot be written: %s",
          strerror(errno));
    return ISCHIA_OK;
}

/* A torn last line gets its end, so that the next one starts on its own. */
static enum ischia_code end_last_line(int fd, struct ischia_error *err)
{
    char last;
    const off_t size = lseek(fd, 0, SEEK_END);
    if (size <= 0 || pread(fd, &last, 1, size - 1) != 1 || last == '\n') return ISCHIA_OK;
    return write_all(fd, "\n", 1, err);
}

/* A header torn by a kill is a prefix of ours with nothing after it: the journal starts anew. */
static enum ischia_code check_header(struct study_journal *journal, const char *path,
                                     const char *found, const char *expected,
                                     struct ischia_error *err)
{
    const size_t length = strlen(found);
    if (strcmp(found, expected) == 0) return ISCHIA_OK;
    CHECK(strncmp(found, expected, length) == 0 && strchr(found, '\n') == NULL, err, ISCHIA_E_STATE,
          "%s belongs to another design or version: remove it to start anew, or name another "
          "output file",
          path);
    CHECK(ftruncate(journal->fd, 0) == 0, err, ISCHIA_E_IO, "%s cannot be written: %s", path,
          strerror(errno));
    return write_all(journal->fd, expected, strlen(expected), err);
}

static enum ischia_code load(struct study_journal *journal, const char *path, const char *header,
                             struct ischia_error *err)
{
    const int copy = dup(journal->fd);
    FILE *in = copy >= 0 ? fdopen(copy, "r") : NULL;
    char *line = NULL;
    size_t room = 0;
    if (in == NULL) {
        if (copy >= 0) (void)close(copy);
        return FAIL(err, ISCHIA_E_IO, "%s cannot be read: %s", path, strerror(errno));
    }
    ssize_t length = getline(&line, &room, in);
    enum ischia_code code = check_header(journal, path, length > 0 ? line : "", header, err);
    while (code == ISCHIA_OK && (length = getline(&line, &room, in)) > 0)
        code = load_line(journal, line, (size_t)length, err);
    free(line);
    (void)fclose(in);
    return code;
}

enum ischia_code study_journal_open(struct study_journal *ret, const char *path,
                                    uint64_t fingerprint, size_t rows, struct ischia_error *err)
{
    char header[HEADER_BYTES];
    struct study_journal journal = {.rows = rows};
    journal.fd = open(path, O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    CHECK(journal.fd >= 0, err, ISCHIA_E_IO, "%s cannot be opened: %s", path, strerror(errno));
    header_of(fingerprint, rows, header);
    journal.text = calloc(rows > 0 ? rows : 1, sizeof *journal.text);
    enum ischia_code code = ISCHIA_OK;
    if (journal.text == NULL) {
        code = FAIL(err, ISCHIA_E_MEMORY, "out of memory for %zu rows", rows);
    } else if (flock(journal.fd, LOCK_EX | LOCK_NB) != 0) {
        code =
            FAIL(err, ISCHIA_E_STATE, "another process is running this study (%s is taken)", path);
    } else {
        code = load(&journal, path, header, err);
        if (code == ISCHIA_OK) code = end_last_line(journal.fd, err);
    }
    if (code != ISCHIA_OK) {
        study_journal_close(&journal);
    } else {
        *ret = journal;
    }
    return code;
}

void study_journal_close(struct study_journal *journal)
{
    if (journal->text == NULL && journal->rows == 0) return;
    for (size_t row = 0; journal->text != NULL && row < journal->rows; row++)
        free(journal->text[row]);
    free(journal->text);
    (void)close(journal->fd);
    *journal = (struct study_journal){0};
}

enum ischia_code study_journal_add(struct study_journal *journal, size_t row, double wall_s,
                                   const char *text, struct ischia_error *err)
{
    struct text_out line;
    char start[64], *bytes;
    size_t length;
    assert(row < journal->rows && journal->text[row] == NULL && strchr(text, '\n') == NULL);
    /* Room for the checksum first: it covers what comes after it. */
    (void)snprintf(start, sizeof start, "00000000 %zu %.3f ", row + 1, wall_s);
    text_out_init(&line);
    text_put_string(&line, start);
    text_put_string(&line, text);
    TRY(text_out_take(&line, &bytes, &length, err));
    const uint32_t crc = crc32_of(bytes + CRC_DIGITS + 1, length - CRC_DIGITS - 1);
    (void)snprintf(start, sizeof start, "%08" PRIx32, crc);
    memcpy(bytes, start, CRC_DIGITS);
    bytes[length] = '\n'; /* over the NUL that ends it */
    enum ischia_code code = write_all(journal->fd, bytes, length + 1, err);
    free(bytes);
    if (code == ISCHIA_OK) code = keep(journal, row, text, err);
    return code;
}
