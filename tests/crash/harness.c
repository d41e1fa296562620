/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The durable half of the daemon without its HTTP, to be killed: store, queue and fake workers.
 *
 *   harness serve DIR FAKE_WORKER   four threads submit and cancel for ever; each line on stdout is
 *                                   a promise: "accepted ID N DEED", "cancelled ID"
 *   harness finish DIR FAKE_WORKER  works until nothing is queued or running, says "finished"
 *
 * Refusals by the store go to stdout as well: "refused CODE MESSAGE", ten a second a thread; those
 * that the queue itself meets too, so that a full disk shows when the queue is full as well.
 */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "server/queue.h"

enum { SUBMITTERS = 4, QUEUED_MAX = 300, CANCEL_EVERY = 11 };

static const char *const deeds[] = {"solve", "solve", "slow",  "solve", "diverge",
                                    "solve", "solve", "crash", "solve", "bad_result"};
enum { DEEDS = sizeof deeds / sizeof deeds[0] };

static struct queue *queue;

/* One write(2): a line is there whole or not at all, whenever we are killed. */
static void promise(const char *line)
{
    const size_t length = strlen(line);
    if (write(STDOUT_FILENO, line, length) != (ssize_t)length) _exit(0);
}

static void rest_ms(long ms)
{
    const struct timespec rest = {ms / 1000, ms % 1000 * 1000000};
    (void)nanosleep(&rest, NULL);
}

static void say_refused(const struct ischia_error *err)
{
    char line[700];
    (void)snprintf(line, sizeof line, "refused %s %s\n", ischia_code_name(err->code), err->message);
    promise(line);
}

static void refuse(const struct ischia_error *err)
{
    say_refused(err);
    rest_ms(100);
}

static void on_store_error(void *context, const struct ischia_error *err)
{
    (void)context;
    say_refused(err);
}

static void cancel(const struct uuid *id, const char *text)
{
    struct ischia_error err;
    enum queue_state was;
    enum store_answer answer;
    char line[80];
    if (queue_cancel(queue, id, &was, &answer, &err) != ISCHIA_OK)
        refuse(&err);
    else if (answer == STORE_DONE) {
        (void)snprintf(line, sizeof line, "cancelled %s\n", text);
        promise(line);
    }
}

static void submit(int n)
{
    char case_json[80], line[160], id[UUID_TEXT_BYTES];
    const char *deed = deeds[n % DEEDS];
    struct ischia_error err;
    struct store_accepted accepted;
    (void)snprintf(case_json, sizeof case_json, "{\"n\":%d,\"do\":\"%s\",\"ms\":20}", n, deed);
    const struct store_new what = {.case_json = case_json,
                                   .warnings_json = "[]",
                                   .subject = "P-1",
                                   .priority = n % 3 == 0 ? QUEUE_STUDY : QUEUE_CLINIC,
                                   .client = ""};
    if (queue_accept(queue, &what, &accepted, &err) != ISCHIA_OK) {
        refuse(&err);
        return;
    }
    if (accepted.acceptance == STORE_FULL) {
        rest_ms(5);
        return;
    }
    uuid_format(&accepted.id, id);
    (void)snprintf(line, sizeof line, "accepted %s %d %s\n", id, n, deed);
    promise(line);
    if (n % CANCEL_EVERY == 0) cancel(&accepted.id, id);
}

/* Each run and thread counts from a number of its own, so that cases rarely repeat. */
static void *submit_for_ever(void *argument)
{
    unsigned state = (unsigned)getpid() * SUBMITTERS + *(const unsigned *)argument;
    for (;;) {
        state = state * 1103515245u + 12345u;
        submit((int)(state >> 8 & 0xffffff) + 1);
    }
    return NULL;
}

static void finish(struct store *store)
{
    struct store_stats stats;
    struct ischia_error err;
    do {
        rest_ms(20);
        if (store_stats(store, &stats, &err) != ISCHIA_OK) {
            refuse(&err);
            continue;
        }
    } while (stats.count[QUEUE_QUEUED] > 0 || stats.count[QUEUE_RUNNING] > 0);
    promise("finished\n");
}

static int serve(void)
{
    static const unsigned number[SUBMITTERS] = {0, 1, 2, 3};
    pthread_t thread;
    for (int i = 0; i < SUBMITTERS; i++)
        if (pthread_create(&thread, NULL, submit_for_ever, (void *)(uintptr_t)&number[i]) != 0)
            return 3;
    for (;;) rest_ms(1000);
}

static enum ischia_code run(const char *mode, struct store *store, struct events *events,
                            const char *worker, struct ischia_error *err)
{
    const char *const command[] = {worker, NULL};
    const struct queue_options options = {
        .pool = {.command = command, .solve_workers = 2, .backoff_min_ms = 1, .backoff_max_ms = 20},
        .queued_max = QUEUED_MAX};
    const struct queue_watcher watcher = {.on_store_error = on_store_error};
    TRY(queue_create(store, events, &options, &watcher, &queue, err));
    promise("ready\n");
    if (strcmp(mode, "serve") == 0) exit(serve());
    finish(store);
    queue_destroy(queue, 1000);
    return ISCHIA_OK;
}

int main(int argc, char **argv)
{
    if (argc != 4) return 2;
    const struct store_options options = {.location = argv[2]};
    struct store *store = NULL;
    struct events *events = NULL;
    struct ischia_error err = {0};
    enum ischia_code code = store_open(&options, &store, &err);
    if (code == ISCHIA_OK) code = events_create(&events, &err);
    if (code == ISCHIA_OK) code = run(argv[1], store, events, argv[3], &err);
    if (code != ISCHIA_OK) (void)fprintf(stderr, "harness: %s\n", err.message);
    events_destroy(events);
    store_close(store);
    return code == ISCHIA_OK ? 0 : 1;
}
