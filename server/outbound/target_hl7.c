/* SPDX-License-Identifier: GPL-3.0-or-later */
/* An ORU^R01 over MLLP to the record system's port. The control id is that of the change, so that a
 * peer that has it already can tell. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/hl7.h"
#include "server/hl7/link.h"
#include "server/hl7/mllp.h"
#include "server/http/documents.h"
#include "server/outbound/target.h"
#include "server/textfile.h"

enum { CONNECT_TIMEOUT_MS = 10 * 1000, SLICE_MS = 1000, ANSWER_SLICES = 30, READ_BYTES = 4096 };

static bool is_wanted(const struct config *config) { return config->hl7_peer[0] != '\0'; }

static enum ischia_code open_peer(void **ret_state, const struct config *config,
                                  struct ischia_error *err)
{
    struct link_tls *tls = NULL;
    char *ca = NULL;
    *ret_state = NULL;
    if (!config->hl7_peer_tls) return ISCHIA_OK;
    if (config->outbound_ca[0] != '\0') TRY(textfile_read(config->outbound_ca, &ca, err));
    const enum ischia_code code = link_tls_create(&tls, NULL, NULL, ca, err);
    free(ca);
    TRY(code);
    *ret_state = tls;
    return ISCHIA_OK;
}

static void close_peer(void *state) { link_tls_destroy(state); }

static enum ischia_code frame_of(const struct delivery *d, const char *control_id, char **ret,
                                 size_t *ret_size, struct ischia_error *err)
{
    struct text_out out;
    struct timespec now;
    char rfc3339[DOCUMENTS_TIME_BYTES], time_text[HL7_TIME_BYTES], *text = NULL;
    size_t size = 0;
    const struct config *c = d->config;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    documents_time((int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000, rfc3339);
    hl7_time(rfc3339, time_text);
    const struct hl7_sender sender = {
        c->hl7_application,   c->hl7_facility, c->hl7_peer_application,
        c->hl7_peer_facility, control_id,      time_text};
    text_out_init(&out);
    hl7_put_result(&out, &sender, d->record);
    TRY(text_out_take(&out, &text, &size, err));
    const enum ischia_code code = mllp_frame(text, size, ret, ret_size, err);
    free(text);
    return code;
}

/* Waits for one framed answer; false when it does not come. */
static bool receive(struct link *link, struct mllp *mllp, const struct delivery *d)
{
    char bytes[READ_BYTES];
    for (int slice = 0; slice < ANSWER_SLICES && !atomic_load(d->stopping); slice++) {
        size_t taken = 0;
        const ssize_t n = link_read(link, bytes, sizeof bytes, SLICE_MS);
        if (n == LINK_TIMED_OUT) continue;
        if (n <= 0) break;
        const enum mllp_event event = mllp_take(mllp, bytes, (size_t)n, &taken);
        if (event != MLLP_MORE) return event == MLLP_MESSAGE;
    }
    return false;
}

/* MSA-1 and MSA-2 of the answer. */
static enum outcome judge(const struct mllp *mllp, const char *control_id, char *problem)
{
    struct hl7 *m = NULL;
    char code[8] = "", id[HL7_FIELD_BYTES] = "";
    size_t size = 0;
    const char *text = mllp_message(mllp, &size);
    if (hl7_parse(&m, text, size, NULL) == ISCHIA_OK) {
        for (int s = 0; s < m->count; s++) {
            if (!hl7_is(m, s, "MSA")) continue;
            (void)hl7_get(m, s, 1, 1, code, sizeof code);
            (void)hl7_get(m, s, 2, 1, id, sizeof id);
        }
        hl7_destroy(m);
    }
    if (strcmp(id, control_id) == 0 && (strcmp(code, "AA") == 0 || strcmp(code, "CA") == 0))
        return OUTCOME_DELIVERED;
    if (strcmp(id, control_id) != 0)
        (void)snprintf(problem, TARGET_PROBLEM_BYTES, "the acknowledgement is not of this message");
    else
        (void)snprintf(problem, TARGET_PROBLEM_BYTES, "acknowledged %s", code);
    return OUTCOME_REFUSED;
}

static enum outcome exchange(struct link *link, const struct delivery *d, const char *control_id,
                             const char *frame, size_t size)
{
    struct mllp mllp;
    enum outcome outcome = OUTCOME_DOWN;
    mllp_init(&mllp, HL7_MESSAGE_BYTES_MAX);
    (void)snprintf(d->problem, TARGET_PROBLEM_BYTES, "no acknowledgement");
    if (link_write(link, frame, size, CONNECT_TIMEOUT_MS) && receive(link, &mllp, d))
        outcome = judge(&mllp, control_id, d->problem);
    mllp_finish(&mllp);
    return outcome;
}

static enum outcome deliver(void *state, const struct delivery *d)
{
    struct link *link = NULL;
    struct ischia_error err;
    char control_id[24], *frame = NULL;
    size_t size = 0;
    (void)snprintf(control_id, sizeof control_id, "ISC%lld", (long long)d->row->change_seq);
    if (frame_of(d, control_id, &frame, &size, &err) != ISCHIA_OK) {
        (void)snprintf(d->problem, TARGET_PROBLEM_BYTES, "the message cannot be written");
        return OUTCOME_REFUSED;
    }
    enum outcome outcome = OUTCOME_DOWN;
    if (link_connect(&link, d->config->hl7_peer, state, CONNECT_TIMEOUT_MS, &err) == ISCHIA_OK)
        outcome = exchange(link, d, control_id, frame, size);
    else
        (void)snprintf(d->problem, TARGET_PROBLEM_BYTES, "%.190s", err.message);
    link_close(link);
    free(frame);
    return outcome;
}

const struct target target_hl7 = {"hl7", is_wanted, open_peer, deliver, close_peer};
