/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "server/events.h"

static int set_up(void **state)
{
    struct ischia_error err;
    return events_create((struct events **)state, &err) == ISCHIA_OK ? 0 : -1;
}

static int tear_down(void **state)
{
    events_destroy(*state);
    return 0;
}

static const struct uuid topic = {{1, 2, 3}};
static const struct uuid other = {{9, 9, 9}};
enum { DAY_MS = EVENTS_SILENT_MS };

static void count(void *context) { (void)__atomic_add_fetch((int *)context, 1, __ATOMIC_SEQ_CST); }

static void publish(struct events *events, double fraction)
{
    const struct event event = {
        .kind = EVENT_PROGRESS, .state = QUEUE_RUNNING, .fraction = fraction};
    events_publish(events, &topic, &event);
}

static void publish_done(struct events *events)
{
    const struct event event = {.kind = EVENT_DONE, .state = QUEUE_SUCCEEDED, .fraction = 1.0};
    events_publish(events, &topic, &event);
}

static void test_resumes_after_an_id(void **state)
{
    struct event got[4];
    for (int i = 1; i <= 3; i++) publish(*state, i / 4.0);
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 3);
    assert_true(got[0].id != 0 && got[0].id < got[1].id && got[1].id < got[2].id);
    assert_int_equal(events_read(*state, &topic, got[0].id, got + 1, 1), 1);
    assert_true(got[1].fraction > 0.4 && got[1].fraction < 0.6);
    assert_int_equal(events_read(*state, &topic, got[2].id, got, 4), 0);
    assert_int_equal(events_read(*state, &other, 0, got, 4), 0);
}

static void test_keeps_the_newest(void **state)
{
    struct event got[2 * EVENTS_RING];
    double fraction = 0;
    for (int i = 0; i < 2 * EVENTS_RING + 5; i++) publish(*state, i / 1000.0);
    assert_int_equal(events_read(*state, &topic, 0, got, 2 * EVENTS_RING), EVENTS_RING);
    const double newest = (2 * EVENTS_RING + 4) / 1000.0;
    assert_true(got[EVENTS_RING - 1].fraction >= newest);
    for (int i = 1; i < EVENTS_RING; i++) assert_int_equal(got[i].id, got[i - 1].id + 1);
    assert_true(events_fraction(*state, &topic, &fraction));
    assert_true(fraction >= newest);
    assert_false(events_fraction(*state, &other, &fraction));
}

static void test_wakes_its_listeners_only(void **state)
{
    struct events_subscription *a, *b, *c;
    int heard_a = 0, heard_b = 0, heard_c = 0;
    struct ischia_error err;
    assert_int_equal(events_subscribe(*state, &topic, count, &heard_a, &a, &err), ISCHIA_OK);
    assert_int_equal(events_subscribe(*state, &topic, count, &heard_b, &b, &err), ISCHIA_OK);
    assert_int_equal(events_subscribe(*state, &other, count, &heard_c, &c, &err), ISCHIA_OK);
    publish(*state, 0.1);
    events_unsubscribe(a);
    publish_done(*state);
    assert_int_equal(events_subscriber_count(*state), 2);
    events_unsubscribe(b);
    events_unsubscribe(c);
    events_unsubscribe(NULL);
    assert_int_equal(heard_a, 1);
    assert_int_equal(heard_b, 2);
    assert_int_equal(heard_c, 0);
}

static void test_sweeps_what_nobody_needs(void **state)
{
    struct events_subscription *listener;
    struct event got[4];
    struct ischia_error err;
    int heard = 0;
    publish(*state, 0.5);
    events_sweep(*state, 0, DAY_MS); /* has not ended */
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 1);
    assert_int_equal(events_subscribe(*state, &topic, count, &heard, &listener, &err), ISCHIA_OK);
    publish_done(*state);
    events_sweep(*state, 0, DAY_MS); /* somebody listens */
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 2);
    assert_int_equal(got[1].kind, EVENT_DONE);
    events_unsubscribe(listener);
    events_sweep(*state, 60000, DAY_MS); /* too young */
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 2);
    events_sweep(*state, 0, DAY_MS);
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 0);
    publish_done(*state); /* an end alone is the store's to tell */
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 0);
}

/* It ran, went back into the queue when its worker died, and was erased there. */
static void test_an_erased_assessment_is_over(void **state)
{
    struct events_subscription *listener;
    struct event got[4];
    struct ischia_error err;
    int heard = 0;
    assert_int_equal(events_subscribe(*state, &topic, count, &heard, &listener, &err), ISCHIA_OK);
    publish(*state, 0.5);
    events_erased(*state, &topic);
    events_erased(*state, &topic); /* ended: nothing more */
    events_erased(*state, &other); /* nobody knows it */
    assert_int_equal(heard, 2);
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 2);
    assert_int_equal(got[1].kind, EVENT_DONE);
    assert_int_equal(got[1].state, QUEUE_CANCELLED);
    events_unsubscribe(listener);
    events_sweep(*state, 0, DAY_MS);
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 0);
    publish_done(*state);
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 0);
}

static void test_what_falls_silent_is_forgotten(void **state)
{
    struct event got[4];
    publish(*state, 0.5);
    events_sweep(*state, 0, DAY_MS);
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 1);
    events_sweep(*state, 0, 0);
    assert_int_equal(events_read(*state, &topic, 0, got, 4), 0);
}

static void *publish_many(void *argument)
{
    for (int i = 0; i < 2000; i++) publish(argument, 0.5);
    return NULL;
}

static void test_many_threads(void **state)
{
    pthread_t thread[4];
    struct ischia_error err;
    int heard = 0;
    struct events_subscription *kept;
    assert_int_equal(events_subscribe(*state, &topic, count, &heard, &kept, &err), ISCHIA_OK);
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&thread[i], NULL, publish_many, *state), 0);
    for (int i = 0; i < 2000; i++) {
        struct events_subscription *brief;
        int ignored = 0;
        assert_int_equal(events_subscribe(*state, &topic, count, &ignored, &brief, &err),
                         ISCHIA_OK);
        events_unsubscribe(brief);
        events_sweep(*state, 0, DAY_MS);
    }
    for (int i = 0; i < 4; i++) assert_int_equal(pthread_join(thread[i], NULL), 0);
    assert_int_equal(heard, 8000);
    events_unsubscribe(kept);
}

#define EVENTS_TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        EVENTS_TEST(test_resumes_after_an_id),
        EVENTS_TEST(test_keeps_the_newest),
        EVENTS_TEST(test_wakes_its_listeners_only),
        EVENTS_TEST(test_sweeps_what_nobody_needs),
        EVENTS_TEST(test_an_erased_assessment_is_over),
        EVENTS_TEST(test_what_falls_silent_is_forgotten),
        EVENTS_TEST(test_many_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
