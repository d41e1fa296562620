/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/submit.h"

#include <string.h>

#include "server/digest.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/routes.h"
#include "server/intake.h"
#include "server/metrics.h"

enum { WAIT_MAX_S = 60, IDEMPOTENCY_KEY_BYTES = 256, STOP_WAIT_MS = 10000 };
static const int64_t for_ever_ms = INT64_MAX / 4;

int64_t submit_wait_deadline(const struct call *call)
{
    const int seconds = query_prefer_wait(http_request_header(call->request, "Prefer"), WAIT_MAX_S);
    return seconds < 0 ? 0 : call->request->begun_ms + (int64_t)seconds * 1000;
}

/* Printable ASCII, as RFC 9110 would have any header be; "" is none. */
bool submit_read_key(struct call *call, const char **ret_key, struct http_response *ret)
{
    const char *key = http_request_header(call->request, "Idempotency-Key");
    *ret_key = key;
    if (key == NULL) return true;
    const size_t length = strlen(key);
    bool good = length > 0 && length < IDEMPOTENCY_KEY_BYTES;
    for (size_t i = 0; i < length; i++) good = good && key[i] > 0x20 && key[i] < 0x7f;
    if (good) return true;
    reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_KEY,
                  WORDS(word_count("max", IDEMPOTENCY_KEY_BYTES - 1)));
    return false;
}

static void on_accepted(void *context, enum ischia_code code, const struct store_accepted *accepted,
                        const struct ischia_error *err)
{
    struct deferred *deferred = context;
    deferred->code = code;
    if (code == ISCHIA_OK)
        deferred->accepted = *accepted;
    else
        deferred->err = *err;
    deferred_complete(deferred);
}

static void park(struct http_response *ret)
{
    ret->action = HTTP_WAIT; /* for the commit, however long the disk takes */
    ret->wake_at_ms = for_ever_ms;
}

static enum ischia_code enqueue(struct call *call, const struct ischia_request *request,
                                const struct origin *origin, const char *key,
                                struct ischia_error *err)
{
    struct intake intake;
    const struct digest_part body = {call->request->body, call->request->body_size};
    TRY(intake_init(&intake, request, origin, err));
    intake.what.client = call->who.id;
    intake.what.idempotency_key = key;
    digest_parts(&body, 1, intake.what.body_digest);
    struct deferred *deferred = deferred_create(call);
    enum ischia_code code =
        deferred != NULL
            ? queue_accept_later(call->service->queue, &intake.what, on_accepted, deferred, err)
            : FAIL(err, ISCHIA_E_MEMORY, "no memory for a request");
    if (code != ISCHIA_OK && deferred != NULL) { /* the callback will not come */
        http_release(deferred->exchange);
        deferred_drop(deferred);
    }
    intake_finish(&intake);
    return code;
}

void submit_enqueue(struct call *call, const struct ischia_request *request,
                    const struct origin *origin, const char *key, struct http_response *ret)
{
    struct ischia_error err;
    if (enqueue(call, request, origin, key, &err) == ISCHIA_OK)
        park(ret);
    else
        reply_failure(call->request, ret, &err);
}

bool submit_is_committed(struct call *call, struct http_response *ret)
{
    if (atomic_load(&call->deferred->done)) return true;
    park(ret);
    if (http_is_stopping(call->service->http) &&
        http_now_ms() > call->request->begun_ms + STOP_WAIT_MS)
        ret->action = HTTP_DROP; /* the disk hangs: neither yes nor no would be true */
    return false;
}

static void refuse_acceptance(struct call *call, const struct store_accepted *accepted,
                              struct http_response *ret)
{
    if (accepted->acceptance == STORE_KEY_CONFLICT) {
        reply_refusal(call->request, ret, PROBLEM_IDEMPOTENCY, WORD_DAEMON_REFUSAL_KEY_CONFLICT,
                      NULL);
        return;
    }
    http_header_static(ret, "Retry-After", "30");
    reply_refusal(call->request, ret, PROBLEM_QUEUE_FULL, WORD_DAEMON_REFUSAL_QUEUE_FULL,
                  WORDS(word_count("n", accepted->queued)));
}

bool submit_take_accepted(struct call *call, struct http_response *ret)
{
    const struct deferred *deferred = call->deferred;
    const enum store_acceptance acceptance = deferred->accepted.acceptance;
    if (deferred->code != ISCHIA_OK) {
        reply_failure(call->request, ret, &deferred->err);
        return false;
    }
    if (acceptance == STORE_KEY_CONFLICT || acceptance == STORE_FULL) {
        refuse_acceptance(call, &deferred->accepted, ret);
        return false;
    }
    if (call->id_text[0] != '\0') return true;
    call->id = deferred->accepted.id;
    uuid_format(&call->id, call->id_text);
    metrics_count(METRIC_ASSESSMENTS_ACCEPTED);
    metrics_store(STORE_ACCEPTS, (double)(http_now_ms() - call->request->begun_ms) / 1e3);
    if (call->deadline_ms > 0) (void)call_subscribe(call);
    return true;
}
