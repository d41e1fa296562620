/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The table of transitions, walked whole; and the ids. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "server/queue_state.h"
#include "server/uuid.h"

/* Written down independently of the table: from (row) to (column), in the order of the enum. */
static const char *const legal[QUEUE_STATE_COUNT] = {
    /*             qrsfc */
    [QUEUE_QUEUED] = ".xx.x", [QUEUE_RUNNING] = "x.xxx",   [QUEUE_SUCCEEDED] = ".....",
    [QUEUE_FAILED] = ".....", [QUEUE_CANCELLED] = ".....",
};

static void test_every_pair(void **state)
{
    (void)state;
    for (int from = 0; from < QUEUE_STATE_COUNT; from++)
        for (int to = 0; to < QUEUE_STATE_COUNT; to++)
            assert_int_equal(queue_may_follow((enum queue_state)from, (enum queue_state)to),
                             legal[from][to] == 'x');
    assert_false(queue_may_follow((enum queue_state)99, QUEUE_QUEUED));
    assert_false(queue_may_follow(QUEUE_QUEUED, (enum queue_state)99));
}

static void test_names_and_ends(void **state)
{
    (void)state;
    for (int s = 0; s < QUEUE_STATE_COUNT; s++) {
        enum queue_state found = QUEUE_STATE_COUNT;
        assert_non_null(queue_state_names[s]);
        assert_true(queue_state_from_name(queue_state_names[s], &found));
        assert_int_equal(found, s);
        assert_int_equal(queue_is_final((enum queue_state)s), strchr(legal[s], 'x') == NULL);
    }
    enum queue_state untouched = QUEUE_FAILED;
    assert_false(queue_state_from_name("Queued", &untouched));
    assert_false(queue_state_from_name(NULL, &untouched));
    assert_int_equal(untouched, QUEUE_FAILED);
    assert_true(QUEUE_CLINIC > QUEUE_STUDY);
}

static void test_uuid_text(void **state)
{
    (void)state;
    struct uuid id, back;
    struct ischia_error err;
    char text[UUID_TEXT_BYTES];
    assert_int_equal(uuid_make(0x0192f0c1abcd, &id, &err), ISCHIA_OK);
    uuid_format(&id, text);
    assert_int_equal(strlen(text), 36);
    assert_memory_equal(text, "0192f0c1-abcd-7", 15);
    assert_non_null(strchr("89ab", text[19]));
    assert_true(uuid_parse(text, &back));
    assert_true(uuid_equal(&id, &back));
    assert_true(uuid_parse("0192F0C1-ABCD-7000-8000-00000000000F", &back));
    static const char *const bad[] = {"",
                                      "0192f0c1-abcd-7000-8000-00000000000",
                                      "0192f0c1-abcd-7000-8000-00000000000ff",
                                      "0192f0c1xabcd-7000-8000-00000000000f",
                                      "0192f0c1-abcd-7000-8000-00000000000g",
                                      "{192f0c1-abcd-7000-8000-00000000000f"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) assert_false(uuid_parse(bad[i], &back));
}

static void test_uuids_differ(void **state)
{
    (void)state;
    struct uuid a, b;
    struct ischia_error err;
    assert_int_equal(uuid_make(1, &a, &err), ISCHIA_OK);
    assert_int_equal(uuid_make(1, &b, &err), ISCHIA_OK);
    assert_false(uuid_equal(&a, &b));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_pair),
        cmocka_unit_test(test_names_and_ends),
        cmocka_unit_test(test_uuid_text),
        cmocka_unit_test(test_uuids_differ),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
