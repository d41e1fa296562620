/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <netinet/in.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/socket.h>

#include <cmocka.h>

#include "server/address.h"

static void a_host_and_a_port_are_found(void **state)
{
    (void)state;
    static const struct {
        const char *text, *host;
        int family;
    } known[] = {{"127.0.0.1:2575", "127.0.0.1", AF_INET}, {"[::1]:2575", "::1", AF_INET6}};
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        struct address address;
        struct ischia_error err = {0};
        if (address_find(known[i].text, &address, &err) != ISCHIA_OK) fail_msg("%s", err.message);
        assert_string_equal(address.text.host, known[i].host);
        assert_int_equal(address.where->ai_family, known[i].family);
        in_port_t port; /* second in both families */
        memcpy(&port, (const char *)address.where->ai_addr + offsetof(struct sockaddr_in, sin_port),
               sizeof port);
        assert_int_equal(ntohs(port), 2575);
        address_finish(&address);
    }
}

static void what_is_no_address_is_refused(void **state)
{
    (void)state;
    char long_host[300];
    memset(long_host, 'a', sizeof long_host);
    memcpy(long_host + sizeof long_host - 3, ":1", 3);
    const struct {
        const char *text;
        enum ischia_code code;
    } wrong[] = {
        {"", ISCHIA_E_INPUT},
        {"host", ISCHIA_E_INPUT},
        {":2575", ISCHIA_E_INPUT},
        {"[]:2575", ISCHIA_E_INPUT},
        {long_host, ISCHIA_E_INPUT},
        {"127.0.0.1:no-port", ISCHIA_E_INPUT},
        {"127.0.0.1:-1", ISCHIA_E_INPUT},
        {"127.0.0.1:65536", ISCHIA_E_INPUT},
        {"127.0.0.1: 80", ISCHIA_E_INPUT},
        {"127.0.0.1:4294967376", ISCHIA_E_INPUT},
        {"no.such.host.invalid:1", ISCHIA_E_IO},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct address address;
        struct ischia_error err = {0};
        assert_int_equal(address_find(wrong[i].text, &address, &err), wrong[i].code);
        assert_true(strlen(err.message) > 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_host_and_a_port_are_found),
        cmocka_unit_test(what_is_no_address_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
