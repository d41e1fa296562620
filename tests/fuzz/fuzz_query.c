/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "server/http/gzip.h"
#include "server/http/listen.h"
#include "server/http/query.h"
#include "tests/fuzz/fuzz.h"

/* What clients write into addresses and headers: the same text as each of them. */

static void read_headers(const char *text)
{
    static const char *const types[] = {"application/json", "text/csv", NULL};
    char word[64];
    const int wait = query_prefer_wait(text, 60);
    MUST(wait >= -1 && wait <= 60);
    const int language = query_language(text, types);
    MUST(language >= 0 && language < 2);
    const int chosen = query_accept(text, types);
    MUST(chosen >= -1 && chosen <= 1);
    (void)gzip_accepted(text);
    (void)query_etag_matches(text, "\"tag\"");
    (void)query_list_has(text, "word");
    (void)listen_text_is_loopback(text);
    const char *authority = text, *rest;
    size_t length = 0;
    if ((rest = query_absolute(text, &authority, &length)) != NULL)
        MUST(authority + length == rest && rest <= text + strlen(text));
    if (query_host(text, word, sizeof word)) MUST(strpbrk(word, "@/ ") == NULL && word[0] != '\0');
    if (query_forwarded_for(text, word, sizeof word)) MUST(strchr(word, ',') == NULL);
}

static void read_query(const char *text)
{
    static const char *const known[] = {"limit", "subject", NULL};
    char value[48];
    const enum query_answer answer = query_find(text, "limit", value, sizeof value);
    MUST(answer == QUERY_FOUND || value[0] == '\0');
    MUST(strlen(value) < sizeof value);
    if (answer == QUERY_FOUND) {
        long long number = 0;
        if (query_whole_number(value, 1, 500, &number)) MUST(number >= 1 && number <= 500);
    }
    (void)query_unknown(text, known, value, sizeof value);
    MUST(strlen(value) < sizeof value);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char decoded[128];
    char *text = malloc(size + 1);
    if (text == NULL) return 0;
    memcpy(text, data, size);
    text[size] = '\0';
    if (query_decode(text, size, true, decoded, sizeof decoded))
        for (const char *c = decoded; *c != '\0'; c++) MUST((unsigned char)*c >= 0x20);
    read_headers(text);
    read_query(text);
    free(text);
    return 0;
}
