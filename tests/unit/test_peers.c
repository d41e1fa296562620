/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "server/peers.h"

static void addresses_are_found_in_networks(void **state)
{
    (void)state;
    static const struct {
        const char *list, *address;
        bool has;
    } cases[] = {
        {"127.0.0.1", "127.0.0.1", true},
        {"127.0.0.1", "127.0.0.2", false},
        {"127.0.0.1", "127.0.0.1.evil", false},
        {"10.0.0.0/8", "10.255.1.2", true},
        {"10.0.0.0/8", "11.0.0.1", false},
        {"10.1.128.0/17", "10.1.127.255", false},
        {"10.1.128.0/17", "10.1.129.1", true},
        {"10.1.2.3/32", "10.1.2.3", true},
        {"0.0.0.0/0", "203.0.113.9", true},
        {"0.0.0.0/0", "::1", false},
        {"::1", "0:0:0:0:0:0:0:1", true},
        {"fd00::/8", "fdff::1", true},
        {"fd00::/8", "fe80::1", false},
        {"2001:db8::/33", "2001:db8:8000::1", false},
        {" 192.0.2.1 ,\t::1, 10.0.0.0/8", "10.1.1.1", true},
        {"192.0.2.1,::1", "?", false},
        {"192.0.2.1", "", false},
        {"", "127.0.0.1", false},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        assert_int_equal(peers_have(cases[i].list, cases[i].address), cases[i].has);
}

static void what_is_no_address_is_named(void **state)
{
    (void)state;
    static const char *const bad[] = {
        "proxy.example",
        "127.0.0.1,localhost",
        "10.0.0.0/33",
        "10.0.0.0/",
        "10.0.0.0/-1",
        "10.0.0.0/8x",
        "::1/129",
        "1.2.3",
        "10.0.0.0/+8",
        "fe80::1%eth0",
        "/8",
        "10.0.0.0/00000000000000000000000000000000000000000000000000000000000000000000000000008",
    };
    struct ischia_error err;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_int_equal(peers_check(bad[i], &err), ISCHIA_E_INPUT);
        assert_non_null(strstr(err.message, "is no address"));
        assert_false(peers_have(bad[i], "10.0.0.1"));
    }
    assert_int_equal(peers_check("", &err), ISCHIA_OK);
    assert_int_equal(peers_check("127.0.0.1, ::1,10.0.0.0/8", &err), ISCHIA_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(addresses_are_found_in_networks),
        cmocka_unit_test(what_is_no_address_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
