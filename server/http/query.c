/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/query.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "api/text.h"

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

bool query_decode(const char *text, size_t length, bool plus, char *ret, size_t size)
{
    size_t used = 0;
    for (size_t i = 0; i < length; i++) {
        char c = text[i];
        if (c == '+' && plus) c = ' ';
        if (text[i] == '%') {
            const int high = length - i > 2 ? hex_digit(text[i + 1]) : -1;
            const int low = length - i > 2 ? hex_digit(text[i + 2]) : -1;
            if (high < 0 || low < 0) return false;
            c = (char)(high * 16 + low);
            i += 2;
        }
        if ((unsigned char)c < 0x20 || c == 0x7f || used + 1 >= size) return false;
        ret[used++] = c;
    }
    if (used >= size) return false;
    ret[used] = '\0';
    return text_is_utf8(ret, used);
}

const char *query_absolute(const char *target, const char **ret, size_t *ret_length)
{
    static const char *const schemes[] = {"http://", "https://"};
    for (size_t i = 0; i < sizeof schemes / sizeof schemes[0]; i++) {
        const size_t length = strlen(schemes[i]);
        if (strncasecmp(target, schemes[i], length) != 0) continue;
        *ret = target + length;
        *ret_length = strcspn(*ret, "/?");
        return *ret + *ret_length;
    }
    return NULL;
}

/* One "key=value" of a query string; `at` moves behind it. False at the end. */
struct pair {
    const char *key, *value;
    size_t key_length, value_length;
};

static bool next_pair(const char **at, struct pair *ret)
{
    while (**at == '&') (*at)++;
    if (**at == '\0') return false;
    const size_t length = strcspn(*at, "&");
    const char *equals = memchr(*at, '=', length);
    ret->key = *at;
    ret->key_length = equals == NULL ? length : (size_t)(equals - *at);
    ret->value = equals == NULL ? *at + length : equals + 1;
    ret->value_length = equals == NULL ? 0 : length - ret->key_length - 1;
    *at += length;
    return true;
}

static bool key_is(const struct pair *pair, const char *key)
{
    char decoded[64];
    return query_decode(pair->key, pair->key_length, true, decoded, sizeof decoded) &&
           strcmp(decoded, key) == 0;
}

enum query_answer query_find(const char *query, const char *key, char *ret, size_t size)
{
    struct pair pair;
    enum query_answer answer = QUERY_ABSENT;
    ret[0] = '\0';
    while (next_pair(&query, &pair)) {
        if (!key_is(&pair, key)) continue;
        if (answer == QUERY_FOUND ||
            !query_decode(pair.value, pair.value_length, true, ret, size)) {
            ret[0] = '\0';
            return QUERY_BAD;
        }
        answer = QUERY_FOUND;
    }
    return answer;
}

enum query_answer query_next(const char **at, char *ret_key, size_t key_size, char *ret_value,
                             size_t value_size)
{
    struct pair pair;
    if (!next_pair(at, &pair)) return QUERY_ABSENT;
    return query_decode(pair.key, pair.key_length, true, ret_key, key_size) &&
                   query_decode(pair.value, pair.value_length, true, ret_value, value_size)
               ? QUERY_FOUND
               : QUERY_BAD;
}

/* As it stands, but with nothing in it that is not text. */
static void show_key(const struct pair *pair, char *ret, size_t size)
{
    char key[128]; /* longer than what is shown, so that the cut is text_printable's */
    const size_t length = pair->key_length < sizeof key ? pair->key_length : sizeof key - 1;
    memcpy(key, pair->key, length);
    key[length] = '\0';
    (void)text_printable(key, ret, size);
}

bool query_unknown(const char *query, const char *const *known, char *ret, size_t size)
{
    struct pair pair;
    while (next_pair(&query, &pair)) {
        bool found = false;
        for (int i = 0; known[i] != NULL; i++) found = found || key_is(&pair, known[i]);
        if (found) continue;
        show_key(&pair, ret, size);
        return true;
    }
    return false;
}

bool query_whole_number(const char *text, long long min, long long max, long long *ret)
{
    char *end = NULL;
    if (text[0] == '\0' || strspn(text, "0123456789") != strlen(text)) return false;
    errno = 0;
    const long long value = strtoll(text, &end, 10);
    if (errno != 0 || *end != '\0' || value < min || value > max) return false;
    *ret = value;
    return true;
}

int query_prefer_wait(const char *prefer, int max)
{
    const char *at = prefer;
    while (at != NULL && *at != '\0') {
        at += strspn(at, " \t,;");
        if (strncasecmp(at, "wait=", 5) == 0 && isdigit((unsigned char)at[5])) {
            errno = 0;
            const long seconds = strtol(at + 5, NULL, 10);
            return errno != 0 || seconds > max ? max : (int)seconds;
        }
        at += strcspn(at, ",;");
    }
    return -1;
}

/* Quality that one entry of an Accept header gives a type, and how specific it is; -1: none. */
static int match_entry(const char *entry, size_t length, const char *type, double *ret_quality)
{
    const size_t name = strcspn(entry, " \t;,");
    const char *slash = strchr(type, '/');
    const char *q = memmem(entry, length, "q=", 2);
    int specific = -1;
    if (name == strlen(type) && strncasecmp(entry, type, name) == 0)
        specific = 2;
    else if (name == 3 && entry[0] == '*' && entry[1] == '/' && entry[2] == '*')
        specific = 0;
    else if (slash != NULL && name == (size_t)(slash - type) + 2 && entry[name - 1] == '*' &&
             strncasecmp(entry, type, name - 1) == 0)
        specific = 1;
    *ret_quality = q == NULL ? 1.0 : strtod(q + 2, NULL);
    return specific;
}

static double quality_of(const char *accept, const char *type)
{
    double best = 0;
    int most_specific = -1;
    while (*accept != '\0') {
        double quality = 0;
        accept += strspn(accept, " \t,");
        const size_t length = strcspn(accept, ",");
        const int specific = match_entry(accept, length, type, &quality);
        if (specific > most_specific) {
            most_specific = specific;
            best = quality;
        }
        accept += length;
    }
    return best;
}

int query_accept(const char *accept, const char *const *types)
{
    int best = -1;
    double best_quality = 0;
    if (accept == NULL) return 0;
    for (int i = 0; types[i] != NULL; i++) {
        const double quality = quality_of(accept, types[i]);
        if (quality <= best_quality) continue;
        best = i;
        best_quality = quality;
    }
    return best;
}

/* Of the entries for a language, "de" and "de-CH", the best; of "*" where it has none. */
static double language_quality(const char *accept_language, const char *tag)
{
    double best = 0, others = 0;
    bool named = false;
    for (const char *at = accept_language; *at != '\0';) {
        at += strspn(at, " \t,");
        const size_t length = strcspn(at, ","), primary = strcspn(at, " \t;,-");
        const char *q = memmem(at, length, "q=", 2);
        const double quality = q == NULL ? 1.0 : strtod(q + 2, NULL);
        if (primary == strlen(tag) && strncasecmp(at, tag, primary) == 0) {
            best = quality > best ? quality : best;
            named = true;
        } else if (primary == 1 && at[0] == '*') {
            others = quality > others ? quality : others;
        }
        at += length;
    }
    return named ? best : others;
}

int query_language(const char *accept_language, const char *const *tags)
{
    int best = 0;
    double best_quality = 0;
    for (int i = 0; accept_language != NULL && tags[i] != NULL; i++) {
        const double quality = language_quality(accept_language, tags[i]);
        if (quality <= best_quality) continue;
        best = i;
        best_quality = quality;
    }
    return best;
}

bool query_media_type_is(const char *content_type, const char *type)
{
    const size_t length = strcspn(content_type, "; \t");
    return length == strlen(type) && strncasecmp(content_type, type, length) == 0;
}

/* The part of a tag between the quotes, weak mark and "-gzip" cut off. */
static size_t opaque_tag(const char *tag, size_t length, const char **ret)
{
    static const char mark[] = "-gzip";
    const size_t mark_length = sizeof mark - 1;
    if (length >= 2 && tag[0] == 'W' && tag[1] == '/') {
        tag += 2;
        length -= 2;
    }
    if (length < 2 || tag[0] != '"' || tag[length - 1] != '"') return 0;
    tag++;
    length -= 2;
    if (length > mark_length && memcmp(tag + length - mark_length, mark, mark_length) == 0)
        length -= mark_length;
    *ret = tag;
    return length;
}

bool query_etag_matches(const char *if_none_match, const char *etag)
{
    const char *wanted = "", *at = if_none_match;
    const size_t wanted_length = opaque_tag(etag, strlen(etag), &wanted);
    if (strcmp(if_none_match, "*") == 0) return true;
    while (*at != '\0') {
        const char *tag = "";
        at += strspn(at, " \t,");
        size_t length = strcspn(at, ",");
        const size_t step = length;
        while (length > 0 && (at[length - 1] == ' ' || at[length - 1] == '\t')) length--;
        const size_t tag_length = opaque_tag(at, length, &tag);
        if (tag_length > 0 && tag_length == wanted_length && memcmp(tag, wanted, tag_length) == 0)
            return true;
        at += step;
    }
    return false;
}

bool query_host(const char *header, char *ret, size_t size)
{
    size_t length = strcspn(header, ":");
    const char *host = header, *rest = header + length;
    if (header[0] == '[') {
        host = header + 1;
        length = strcspn(host, "]");
        if (host[length] != ']') return false;
        rest = host + length + 1;
    }
    if (length == 0 || length >= size) return false;
    if (rest[0] == ':' && (rest[1] == '\0' || strspn(rest + 1, "0123456789") != strlen(rest + 1)))
        return false;
    if (rest[0] != ':' && rest[0] != '\0') return false;
    for (size_t i = 0; i < length; i++) {
        const unsigned char c = (unsigned char)host[i];
        if (!isalnum(c) && strchr(".-_:", c) == NULL) return false;
        ret[i] = (char)tolower(c);
    }
    ret[length] = '\0';
    return true;
}

bool query_list_has(const char *list, const char *word)
{
    const size_t wanted = strlen(word);
    while (*list != '\0') {
        list += strspn(list, " \t,");
        const size_t length = strcspn(list, " \t,");
        if (length == wanted && length > 0 && strncasecmp(list, word, length) == 0) return true;
        list += length;
    }
    return false;
}

bool query_forwarded_for(const char *header, char *ret, size_t size)
{
    const char *comma = strrchr(header, ',');
    const char *last = comma == NULL ? header : comma + 1;
    last += strspn(last, " \t");
    const size_t length = strcspn(last, " \t");
    if (length == 0 || length >= size) return false;
    for (size_t i = 0; i < length; i++)
        if (!isxdigit((unsigned char)last[i]) && last[i] != '.' && last[i] != ':') return false;
    memcpy(ret, last, length);
    ret[length] = '\0';
    return true;
}
