/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/outbound/web.h"

#include <curl/curl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CONNECT_TIMEOUT_MS = 10 * 1000, POST_TIMEOUT_MS = 30 * 1000 };

enum ischia_code web_start(struct ischia_error *err)
{
    CHECK(curl_global_init(CURL_GLOBAL_DEFAULT) == CURLE_OK, err, ISCHIA_E_STATE,
          "libcurl could not start");
    return ISCHIA_OK;
}

void web_finish(void) { curl_global_cleanup(); }

const char *web_library_version(void) { return curl_version_info(CURLVERSION_NOW)->version; }

struct sink {
    char *bytes;
    size_t used;
};

/* Keeps the beginning; the rest is read and thrown away. */
static size_t take(char *bytes, size_t one, size_t size, void *context)
{
    struct sink *sink = context;
    const size_t room = WEB_ANSWER_BYTES_MAX - sink->used, kept = size < room ? size : room;
    (void)one; /* always 1 */
    memcpy(sink->bytes + sink->used, bytes, kept);
    sink->used += kept;
    sink->bytes[sink->used] = '\0';
    return size;
}

static int look_up(void *context, curl_off_t a, curl_off_t b, curl_off_t c, curl_off_t d)
{
    (void)a, (void)b, (void)c, (void)d;
    return atomic_load((atomic_bool *)context) ? 1 : 0;
}

static struct curl_slist *headers_of(const struct web_post *post)
{
    struct curl_slist *list = NULL;
    for (int i = 0; i < WEB_HEADERS_MAX && post->header[i] != NULL; i++) {
        struct curl_slist *longer = curl_slist_append(list, post->header[i]);
        if (longer == NULL) {
            curl_slist_free_all(list);
            return NULL;
        }
        list = longer;
    }
    return list;
}

/* The first option that cannot be set makes the transfer fail; the others are the same call. */
static CURLcode prepare(CURL *curl, const struct web_post *post, struct curl_slist *headers,
                        struct sink *sink, char *problem)
{
    CURLcode code = curl_easy_setopt(curl, CURLOPT_URL, post->url);
#define SET(option, value)                                                                         \
    if (code == CURLE_OK) code = curl_easy_setopt(curl, option, value)
    SET(CURLOPT_PROTOCOLS_STR, "http,https");
    SET(CURLOPT_NOSIGNAL, 1L);
    SET(CURLOPT_CONNECTTIMEOUT_MS, (long)CONNECT_TIMEOUT_MS);
    SET(CURLOPT_TIMEOUT_MS, (long)POST_TIMEOUT_MS);
    SET(CURLOPT_HTTPHEADER, headers);
    SET(CURLOPT_POST, 1L);
    SET(CURLOPT_POSTFIELDS, post->body);
    SET(CURLOPT_POSTFIELDSIZE_LARGE, (curl_off_t)post->size);
    SET(CURLOPT_USERAGENT, "ischiad/" ISCHIA_VERSION);
    SET(CURLOPT_PROXY, "");
    SET(CURLOPT_WRITEFUNCTION, take);
    SET(CURLOPT_WRITEDATA, sink);
    SET(CURLOPT_NOPROGRESS, 0L);
    SET(CURLOPT_XFERINFOFUNCTION, look_up);
    SET(CURLOPT_XFERINFODATA, post->stopping);
    SET(CURLOPT_ERRORBUFFER, problem);
    if (post->ca[0] != '\0') SET(CURLOPT_CAINFO, post->ca);
#undef SET
    return code;
}

static void perform(CURL *curl, const struct web_post *post, struct sink *sink,
                    struct web_answer *ret)
{
    char problem[CURL_ERROR_SIZE] = "";
    long status = 0;
    struct curl_slist *headers = headers_of(post);
    CURLcode code =
        headers == NULL ? CURLE_OUT_OF_MEMORY : prepare(curl, post, headers, sink, problem);
    if (code == CURLE_OK) code = curl_easy_perform(curl);
    if (code == CURLE_OK) code = curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &status);
    if (code == CURLE_OK)
        ret->status = (int)status;
    else
        (void)snprintf(ret->problem, sizeof ret->problem, "%.150s",
                       problem[0] == '\0' ? curl_easy_strerror(code) : problem);
    curl_slist_free_all(headers);
}

void web_post(const struct web_post *post, struct web_answer *ret)
{
    struct sink sink = {.bytes = calloc(1, WEB_ANSWER_BYTES_MAX + 1)};
    CURL *curl = curl_easy_init();
    memset(ret, 0, sizeof *ret);
    (void)snprintf(ret->problem, sizeof ret->problem, "out of memory");
    if (curl != NULL && sink.bytes != NULL) perform(curl, post, &sink, ret);
    if (curl != NULL) curl_easy_cleanup(curl);
    ret->body = sink.bytes;
}

void web_answer_finish(struct web_answer *answer)
{
    free(answer->body);
    answer->body = NULL;
}
