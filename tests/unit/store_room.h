/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_UNIT_STORE_ROOM_H
#define ISCHIA_TESTS_UNIT_STORE_ROOM_H

/* What the tests of the store share: a directory with a store in it, and short ways to use it.
 * Each test program is one file, so everything here is static. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "server/store/store.h"
#include "tests/unit/test_folder.h"
#include "tests/unit/test_server.h"

static int64_t clock_ms;
static inline int64_t fake_now(void) { return clock_ms; }

struct room {
    char directory[128];
    char path[192];
    struct store *store;
};

static inline void expect_ok(enum ischia_code code, const struct ischia_error *err)
{
    if (code != ISCHIA_OK) fail_msg("%s: %s", ischia_code_name(code), err->message);
}

static inline void open_room(struct room *room)
{
    struct ischia_error err = {0};
    const struct store_options options = {
        .location = test_server() == NULL ? room->path : test_server(), .now_ms = fake_now};
    expect_ok(store_open(&options, &room->store, &err), &err);
}

static inline int set_up(void **state)
{
    struct room *room = calloc(1, sizeof *room);
    assert_non_null(room);
    clock_ms = 1767225600000;
    test_folder_make(room->directory, sizeof room->directory, "store");
    (void)snprintf(room->path, sizeof room->path, "%s/state", room->directory);
    if (test_server() != NULL) empty_server();
    open_room(room);
    *state = room;
    return 0;
}

static inline int tear_down(void **state)
{
    struct room *room = *state;
    store_close(room->store);
    test_folder_remove(room->directory);
    free(room);
    return 0;
}

static inline struct store_new request(unsigned char case_number)
{
    struct store_new what = {.subject = "P-017",
                             .side = "left",
                             .case_json = "{\"R1\":7.1}",
                             .warnings_json = "[]",
                             .priority = QUEUE_CLINIC,
                             .client = ""};
    what.case_key[0] = case_number;
    return what;
}

static inline struct store_accepted accept(struct store *store, const struct store_new *what)
{
    struct ischia_error err = {0};
    struct store_accepted accepted = {0};
    expect_ok(store_accept(store, what, &accepted, &err), &err);
    return accepted;
}

static inline void ignore_cached(void *context, const struct uuid *id)
{
    (void)id;
    ++*(int *)context;
}

static inline enum store_answer claim(struct store *store, struct store_claim *ret, int *ret_cached)
{
    struct ischia_error err = {0};
    enum store_answer answer = STORE_ANSWER_COUNT;
    *ret_cached = 0;
    expect_ok(store_claim_next(store, ignore_cached, ret_cached, ret, &answer, &err), &err);
    return answer;
}

static inline struct store_claim claim_one(struct store *store)
{
    struct store_claim got = {0};
    int cached;
    assert_int_equal(claim(store, &got, &cached), STORE_DONE);
    free(got.case_json);
    got.case_json = NULL;
    return got;
}

static inline enum store_answer succeed(struct store *store, const struct uuid *id, int64_t attempt)
{
    struct ischia_error err = {0};
    enum store_answer answer = STORE_ANSWER_COUNT;
    expect_ok(store_succeed(store, id, attempt, "{\"strain\":{}}", (const unsigned char *)"field",
                            5, &answer, &err),
              &err);
    return answer;
}

static inline struct store_assessment get(struct store *store, const struct uuid *id)
{
    struct ischia_error err = {0};
    struct store_assessment a = {0};
    enum store_answer answer = STORE_ANSWER_COUNT;
    expect_ok(store_get(store, id, &a, &answer, &err), &err);
    assert_int_equal(answer, STORE_DONE);
    return a;
}

static inline enum queue_state state_of(struct store *store, const struct uuid *id)
{
    struct store_assessment a = get(store, id);
    const enum queue_state state = a.state;
    store_assessment_finish(&a);
    return state;
}

#define STORE_TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

#endif
