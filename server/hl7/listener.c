/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/hl7/listener.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "api/hl7.h"
#include "server/digest.h"
#include "server/hl7/mllp.h"
#include "server/http/documents.h"
#include "server/http/listen.h"
#include "server/intake.h"
#include "server/log.h"
#include "server/metrics.h"

enum { CONNECTIONS_MAX = 32, FRAME_TIMEOUT_MS = 30 * 1000, IDLE_TIMEOUT_MS = 10 * 60 * 1000 };
enum { READ_BYTES = 8192, WRITE_TIMEOUT_MS = 30 * 1000, HANDSHAKE_TIMEOUT_MS = 10 * 1000 };

struct listener {
    struct listener_options options;
    char address[LISTEN_ADDRESS_BYTES];
    int fd, wake_fd;
    pthread_t thread;
    pthread_mutex_t lock; /* guards the slots and stopping */
    pthread_cond_t ended;
    bool stopping;
    int count;
    struct slot {
        struct listener *listener;
        int fd;
        struct link *link; /* NULL until its handshake is done */
        bool used;
    } slot[CONNECTIONS_MAX];
    atomic_uint control_id;
};

/* ------------------------------------------------------------------------- one message */

static void now_text(char ret[HL7_TIME_BYTES])
{
    struct timespec now;
    char rfc3339[DOCUMENTS_TIME_BYTES];
    (void)clock_gettime(CLOCK_REALTIME, &now);
    documents_time((int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000, rfc3339);
    hl7_time(rfc3339, ret);
}

/* The sender, as the owner of its control ids. */
static void client_of(const struct hl7_head *head, char ret[64])
{
    const struct digest_part parts[] = {digest_text(head->application),
                                        digest_text(head->facility)};
    unsigned char digest[DIGEST_BYTES];
    char hex[DIGEST_HEX_BYTES];
    digest_parts(parts, 2, digest);
    digest_hex(digest, hex);
    (void)snprintf(ret, 64, "hl7-%.12s", hex);
}

static enum hl7_ack judge_acceptance(enum ischia_code code, const struct store_accepted *accepted,
                                     const struct ischia_error *err, struct doc_faults *faults)
{
    struct log_value quoted;
    if (code != ISCHIA_OK) {
        LOG_ERROR("message not stored", "code=%s detail=%s", ischia_code_name(code),
                  log_quote(&quoted, err->message));
        doc_faults_add(faults, "MSH", "internal", "the service cannot store this now; send again");
        return HL7_REJECTED;
    }
    if (accepted->acceptance == STORE_FULL) {
        doc_faults_add(faults, "MSH", "queue_full", "%d assessments are waiting; send again later",
                       accepted->queued);
        return HL7_REJECTED;
    }
    if (accepted->acceptance != STORE_KEY_CONFLICT) return HL7_ACCEPTED;
    doc_faults_add(faults, "MSH^1^10", "duplicate",
                   "this control id came with another message before");
    return HL7_ERROR;
}

static enum hl7_ack submit(struct listener *l, const struct hl7_input *input, const char *bytes,
                           size_t size, struct doc_faults *faults)
{
    struct intake intake;
    struct ischia_error err;
    struct store_accepted accepted = {.acceptance = STORE_ACCEPTED};
    const struct digest_part body = {bytes, size};
    char client[64], id[UUID_TEXT_BYTES] = "";
    client_of(&input->head, client);
    enum ischia_code code = intake_init(&intake, &input->request, &input->origin, &err);
    if (code == ISCHIA_OK) {
        intake.what.client = client;
        intake.what.idempotency_key = input->head.control_id;
        digest_parts(&body, 1, intake.what.body_digest);
        code = queue_accept(l->options.queue, &intake.what, &accepted, &err);
        intake_finish(&intake);
    }
    const enum hl7_ack ack = judge_acceptance(code, &accepted, &err, faults);
    if (ack == HL7_ACCEPTED) uuid_format(&accepted.id, id);
    if (ack == HL7_ACCEPTED && accepted.acceptance != STORE_REPLAYED)
        metrics_count(METRIC_ASSESSMENTS_ACCEPTED);
    (void)audit_change(l->options.audit, client, "assessment.create", id, hl7_ack_codes[ack]);
    return ack;
}

/* broken: the frame was not closed as it should be; the message is then not looked at further than
 * its head, which the sender needs to match the answer. */
static enum hl7_ack answer(struct listener *l, const char *bytes, size_t size, bool broken,
                           struct hl7_input *input, struct doc_faults *faults)
{
    enum hl7_ack ack = hl7_read(input, bytes, size, l->options.application, faults);
    if (broken) {
        doc_faults_init(faults);
        doc_faults_add(faults, "MSH", "framing", "the message did not end with FS CR");
        return HL7_REJECTED;
    }
    if (ack == HL7_ACCEPTED) ack = submit(l, input, bytes, size, faults);
    return ack;
}

static bool send_answer(struct listener *l, struct link *link, const struct hl7_head *head,
                        enum hl7_ack ack, const struct doc_faults *faults)
{
    struct text_out out;
    struct ischia_error err;
    char time[HL7_TIME_BYTES], control_id[32], *text = NULL, *frame = NULL;
    size_t size = 0, frame_size = 0;
    const struct hl7_sender sender = {.application = l->options.application,
                                      .facility = l->options.facility,
                                      .control_id = control_id,
                                      .time = time};
    now_text(time);
    (void)snprintf(control_id, sizeof control_id, "ACK%.14s%u", time,
                   atomic_fetch_add(&l->control_id, 1U));
    text_out_init(&out);
    hl7_put_ack(&out, &sender, head, ack, faults);
    if (text_out_take(&out, &text, &size, &err) != ISCHIA_OK) return false;
    const bool sent = mllp_frame(text, size, &frame, &frame_size, &err) == ISCHIA_OK &&
                      link_write(link, frame, frame_size, WRITE_TIMEOUT_MS);
    free(frame);
    free(text);
    return sent;
}

static bool handle(struct listener *l, struct link *link, const char *bytes, size_t size,
                   bool broken)
{
    struct doc_faults faults;
    struct hl7_input *input = malloc(sizeof *input);
    if (input == NULL) return false;
    doc_faults_init(&faults);
    const enum hl7_ack ack = answer(l, bytes, size, broken, input, &faults);
    LOG_INFO("message", "protocol=hl7 ack=%s faults=%zu first=%s", hl7_ack_codes[ack], faults.count,
             faults.count == 0 ? "" : faults.item[0].code);
    const bool sent = send_answer(l, link, &input->head, ack, &faults);
    free(input);
    return sent;
}

/* ---------------------------------------------------------------------- one connection */

/* Answers what has arrived. False: the connection ends. */
static bool take_bytes(struct listener *l, struct link *link, struct mllp *mllp, const char *bytes,
                       size_t size)
{
    static const struct hl7_head nobody;
    struct doc_faults faults;
    while (size > 0) {
        size_t taken = 0, length = 0;
        const enum mllp_event event = mllp_take(mllp, bytes, size, &taken);
        const char *message = mllp_message(mllp, &length);
        bytes += taken;
        size -= taken;
        if (event == MLLP_MORE) continue;
        if (event == MLLP_MESSAGE || event == MLLP_BROKEN) {
            if (!handle(l, link, message, length, event == MLLP_BROKEN)) return false;
            continue;
        }
        doc_faults_init(&faults);
        doc_faults_add(&faults, "MSH", "framing", "%s",
                       event == MLLP_TOO_LARGE ? "the message is too large" : "this is not MLLP");
        (void)send_answer(l, link, &nobody, HL7_REJECTED, &faults);
        return false;
    }
    return true;
}

static void converse(struct listener *l, struct link *link)
{
    struct mllp mllp;
    char bytes[READ_BYTES];
    mllp_init(&mllp, HL7_MESSAGE_BYTES_MAX);
    for (bool open = true; open;) {
        const bool within = mllp.state != MLLP_OUTSIDE;
        const ssize_t n =
            link_read(link, bytes, sizeof bytes, within ? FRAME_TIMEOUT_MS : IDLE_TIMEOUT_MS);
        open = n > 0 && take_bytes(l, link, &mllp, bytes, (size_t)n);
    }
    mllp_finish(&mllp);
}

static void release(struct slot *slot)
{
    struct listener *l = slot->listener;
    (void)pthread_mutex_lock(&l->lock);
    struct link *link = slot->link;
    slot->link = NULL; /* from here on nobody cuts it */
    (void)pthread_mutex_unlock(&l->lock);
    link_close(link);
    (void)pthread_mutex_lock(&l->lock);
    slot->used = false;
    l->count--;
    (void)pthread_cond_broadcast(&l->ended);
    (void)pthread_mutex_unlock(&l->lock);
}

static void *serve(void *argument)
{
    struct slot *slot = argument;
    struct listener *l = slot->listener;
    struct link *link = NULL;
    struct ischia_error err;
    struct log_value quoted;
    const enum ischia_code code =
        link_accept(&link, slot->fd, l->options.tls, HANDSHAKE_TIMEOUT_MS, &err);
    if (code != ISCHIA_OK)
        LOG_WARNING("connection refused", "protocol=hl7 detail=%s",
                    log_quote(&quoted, err.message));
    (void)pthread_mutex_lock(&l->lock);
    slot->link = link;
    const bool go = link != NULL && !l->stopping;
    (void)pthread_mutex_unlock(&l->lock);
    if (go) converse(l, link);
    release(slot);
    return NULL;
}

/* ------------------------------------------------------------------------- the listener */

static struct slot *free_slot(struct listener *l)
{
    for (int i = 0; i < CONNECTIONS_MAX; i++)
        if (!l->slot[i].used) return &l->slot[i];
    return NULL;
}

static void take_connection(struct listener *l)
{
    pthread_t thread;
    const int fd = accept4(l->fd, NULL, NULL, SOCK_CLOEXEC);
    if (fd < 0) return;
    (void)pthread_mutex_lock(&l->lock);
    struct slot *slot = l->stopping ? NULL : free_slot(l);
    if (slot != NULL) {
        *slot = (struct slot){.listener = l, .fd = fd, .used = true};
        l->count++;
    }
    (void)pthread_mutex_unlock(&l->lock);
    if (slot == NULL) {
        (void)close(fd);
        return;
    }
    if (pthread_create(&thread, NULL, serve, slot) == 0) {
        (void)pthread_detach(thread);
        return;
    }
    (void)close(fd);
    release(slot);
}

static void *listen_main(void *argument)
{
    struct listener *l = argument;
    struct pollfd fds[] = {{.fd = l->fd, .events = POLLIN}, {.fd = l->wake_fd, .events = POLLIN}};
    for (;;) {
        if (poll(fds, 2, -1) < 0 && errno != EINTR) return NULL;
        if (fds[1].revents != 0) return NULL;
        if (fds[0].revents != 0) take_connection(l);
    }
}

enum ischia_code listener_start(struct listener **ret, const struct listener_options *options,
                                struct ischia_error *err)
{
    struct listener *l = calloc(1, sizeof *l);
    CHECK(l != NULL, err, ISCHIA_E_MEMORY, "no memory for the HL7 listener");
    l->options = *options;
    l->fd = l->wake_fd = -1;
    (void)pthread_mutex_init(&l->lock, NULL);
    (void)pthread_cond_init(&l->ended, NULL);
    enum ischia_code code = listen_open(options->listen, &l->fd, l->address, err);
    if (code == ISCHIA_OK && (l->wake_fd = eventfd(0, EFD_CLOEXEC)) < 0)
        code = FAIL(err, ISCHIA_E_IO, "eventfd: %s", strerror(errno));
    if (code == ISCHIA_OK && pthread_create(&l->thread, NULL, listen_main, l) != 0)
        code = FAIL(err, ISCHIA_E_MEMORY, "the HL7 listener cannot start its thread");
    if (code == ISCHIA_OK) {
        *ret = l;
        return ISCHIA_OK;
    }
    if (l->fd >= 0) (void)close(l->fd);
    if (l->wake_fd >= 0) (void)close(l->wake_fd);
    free(l);
    return code;
}

const char *listener_address(const struct listener *listener) { return listener->address; }

void listener_stop(struct listener *l)
{
    if (l == NULL) return;
    (void)eventfd_write(l->wake_fd, 1);
    (void)pthread_join(l->thread, NULL);
    (void)close(l->fd);
    (void)pthread_mutex_lock(&l->lock);
    l->stopping = true;
    for (int i = 0; i < CONNECTIONS_MAX; i++)
        if (l->slot[i].used && l->slot[i].link != NULL) link_cut(l->slot[i].link);
    while (l->count > 0) (void)pthread_cond_wait(&l->ended, &l->lock);
    (void)pthread_mutex_unlock(&l->lock);
    (void)close(l->wake_fd);
    (void)pthread_mutex_destroy(&l->lock);
    (void)pthread_cond_destroy(&l->ended);
    free(l);
}
