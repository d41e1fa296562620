/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "server/rate.h"

enum { PER_SECOND = 10, BURST = 5 };

static int make(void **state)
{
    struct rate *rate = NULL;
    if (rate_create(&rate, NULL) != ISCHIA_OK) return -1;
    *state = rate;
    return 0;
}

static int drop(void **state)
{
    rate_destroy(*state);
    return 0;
}

static void a_burst_then_the_rate(void **state)
{
    for (int i = 0; i < BURST; i++)
        assert_int_equal(rate_take(*state, "a", PER_SECOND, BURST, 1000), 0);
    assert_int_equal(rate_take(*state, "a", PER_SECOND, BURST, 1000), 1);
    assert_int_equal(rate_take(*state, "a", PER_SECOND, BURST, 1099), 1);
    assert_int_equal(rate_take(*state, "a", PER_SECOND, BURST, 1100), 0);
    assert_int_equal(rate_take(*state, "a", PER_SECOND, BURST, 1100), 1);
}

static void a_pause_fills_no_more_than_the_burst(void **state)
{
    for (int i = 0; i < BURST; i++)
        assert_int_equal(rate_take(*state, "b", PER_SECOND, BURST, 1000), 0);
    for (int i = 0; i < BURST; i++)
        assert_int_equal(rate_take(*state, "b", PER_SECOND, BURST, 1000000), 0);
    assert_int_equal(rate_take(*state, "b", PER_SECOND, BURST, 1000000), 1);
}

static void the_wait_is_long_enough(void **state)
{
    assert_int_equal(rate_take(*state, "c", 1, 1, 1000), 0);
    const int wait_s = rate_take(*state, "c", 1, 1, 1000);
    assert_in_range(wait_s, 1, 2);
    assert_int_equal(rate_take(*state, "c", 1, 1, 1000 + wait_s * 1000), 0);
}

static void clients_do_not_share(void **state)
{
    assert_int_equal(rate_take(*state, "d", 1, 1, 1000), 0);
    assert_int_not_equal(rate_take(*state, "d", 1, 1, 1000), 0);
    int refused = 0;
    char client[] = "e0";
    for (int digit = 0; digit < 10; digit++) {
        client[1] = (char)('0' + digit);
        refused += rate_take(*state, client, 1, 1, 1000) != 0;
    }
    /* Ten of 8192 slots: a shared one is a chance of 1 in 180, two of them of 1 in 60 000. */
    assert_in_range(refused, 0, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_burst_then_the_rate, make, drop),
        cmocka_unit_test_setup_teardown(a_pause_fills_no_more_than_the_burst, make, drop),
        cmocka_unit_test_setup_teardown(the_wait_is_long_enough, make, drop),
        cmocka_unit_test_setup_teardown(clients_do_not_share, make, drop),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
