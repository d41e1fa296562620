/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "server/http/listen.h"
#include "server/http/query.h"

static bool decodes(const char *text, const char *expected)
{
    char decoded[32];
    if (!query_decode(text, strlen(text), true, decoded, sizeof decoded)) return false;
    return strcmp(decoded, expected) == 0;
}

static void escapes_are_undone_or_refused(void **state)
{
    (void)state;
    assert_true(decodes("a%20b+c", "a b c"));
    assert_true(decodes("%CE%BcM", "\xce\xbcM"));
    assert_true(decodes("", ""));
    static const char *const bad[] = {"%",   "%2",  "%zz", "a%0",   "%00",
                                      "%0a", "%7f", "%ff", "%c0%af"};
    char decoded[32];
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(query_decode(bad[i], strlen(bad[i]), true, decoded, sizeof decoded));
    assert_true(query_decode("1234567", 7, true, decoded, 8));
    assert_false(query_decode("12345678", 8, true, decoded, 8));
}

static void a_parameter_is_found_once(void **state)
{
    (void)state;
    char value[16];
    assert_int_equal(query_find("a=1&b=2", "b", value, sizeof value), QUERY_FOUND);
    assert_string_equal(value, "2");
    assert_int_equal(query_find("a=1&b", "b", value, sizeof value), QUERY_FOUND);
    assert_string_equal(value, "");
    assert_int_equal(query_find("aa=1&%61=x", "a", value, sizeof value), QUERY_FOUND);
    assert_string_equal(value, "x");
    assert_int_equal(query_find("", "a", value, sizeof value), QUERY_ABSENT);
    assert_int_equal(query_find("a=1&a=1", "a", value, sizeof value), QUERY_BAD);
    assert_int_equal(query_find("a=%zz", "a", value, sizeof value), QUERY_BAD);
    assert_int_equal(query_find("a=0123456789abcdef", "a", value, sizeof value), QUERY_BAD);
    assert_string_equal(value, "");
}

static void strangers_are_named(void **state)
{
    (void)state;
    static const char *const known[] = {"limit", "cursor", NULL};
    char name[16];
    assert_false(query_unknown("limit=1&cursor=&&", known, name, sizeof name));
    assert_true(query_unknown("limit=1&limits=2", known, name, sizeof name));
    assert_string_equal(name, "limits");
    assert_true(query_unknown("\xff=1", known, name, sizeof name));
    assert_string_equal(name, "?");
    assert_true(query_unknown("aaaaaaaaaaa\xc3\xa9\xc3\xa9\xc3\xa9=1", known, name, sizeof name));
    assert_string_equal(name, "aaaaaaaaaaa...");
}

static void whole_numbers_only(void **state)
{
    (void)state;
    long long n = 0;
    assert_true(query_whole_number("500", 1, 500, &n));
    assert_int_equal(n, 500);
    static const char *const bad[] = {
        "", "-1", "+1", " 1", "1 ", "0", "501", "1.0", "99999999999999999999"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(query_whole_number(bad[i], 1, 500, &n));
}

static void prefer_wait_is_read(void **state)
{
    (void)state;
    assert_int_equal(query_prefer_wait(NULL, 60), -1);
    assert_int_equal(query_prefer_wait("respond-async", 60), -1);
    assert_int_equal(query_prefer_wait("wait=5", 60), 5);
    assert_int_equal(query_prefer_wait("respond-async, Wait=10; x", 60), 10);
    assert_int_equal(query_prefer_wait("wait=3600", 60), 60);
    assert_int_equal(query_prefer_wait("wait=99999999999999999999", 60), 60);
    assert_int_equal(query_prefer_wait("wait=", 60), -1);
    assert_int_equal(query_prefer_wait("wait=x", 60), -1);
}

static void accept_chooses(void **state)
{
    (void)state;
    static const char *const types[] = {"application/json", "text/csv", NULL};
    assert_int_equal(query_accept(NULL, types), 0);
    assert_int_equal(query_accept("*\x2f*", types), 0);
    assert_int_equal(query_accept("text/csv", types), 1);
    assert_int_equal(query_accept("text/*", types), 1);
    assert_int_equal(query_accept("application/json;q=0.5, text/csv;q=0.9", types), 1);
    assert_int_equal(query_accept("application/json;q=0, *\x2f*", types), 1);
    assert_int_equal(query_accept("image/png", types), -1);
    assert_int_equal(query_accept("", types), -1);
    assert_true(query_media_type_is("application/json; charset=utf-8", "application/json"));
    assert_false(query_media_type_is("application/jsonp", "application/json"));
}

static void the_language_that_is_liked_best(void **state)
{
    (void)state;
    static const char *const tags[] = {"en", "de", "fr", NULL};
    static const struct {
        const char *header;
        int wanted;
    } cases[] = {
        {"", 0},
        {"it", 0},
        {"fr", 2},
        {"FR-ca", 2},
        {"frr, fra", 0},
        {"de;q=0.5, fr;q=0.8", 2},
        {"de-CH;q=0.9,de;q=0.1,fr;q=0.5", 1},
        {"en-GB, de;q=0.9", 0},
        {"*", 0},
        {"en;q=0, *;q=0.1", 1},
        {"de;q=0", 0},
        {"*;q=nan, fr;q=0.1", 2},
        {",;,-, fr", 2},
    };
    assert_int_equal(query_language(NULL, tags), 0);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        assert_int_equal(query_language(cases[i].header, tags), cases[i].wanted);
}

static void tags_match_weakly(void **state)
{
    (void)state;
    assert_true(query_etag_matches("\"a\"", "\"a\""));
    assert_true(query_etag_matches("W/\"a\"", "\"a\""));
    assert_true(query_etag_matches("\"x\" , \"a-gzip\"", "\"a\""));
    assert_true(query_etag_matches("*", "\"a\""));
    assert_false(query_etag_matches("a", "\"a\""));
    assert_false(query_etag_matches("\"aa\"", "\"a\""));
    assert_false(query_etag_matches("", "\"a\""));
}

static void hosts_are_whole_names(void **state)
{
    (void)state;
    char host[32];
    assert_true(query_host("Clinic.Example:8080", host, sizeof host));
    assert_string_equal(host, "clinic.example");
    assert_true(query_host("[::1]:80", host, sizeof host));
    assert_string_equal(host, "::1");
    static const char *const bad[] = {"",     ":80", "a:",  "a:b",    "a b",  "a@b",
                                      "[::1", "[]",  "a/b", "[::1]x", "a%00b"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(query_host(bad[i], host, sizeof host));
    assert_true(query_list_has("a.example, B.example", "b.example"));
    assert_false(query_list_has("a.example", "example"));
    assert_false(query_list_has("", ""));
}

static void targets_in_absolute_form_are_taken_apart(void **state)
{
    (void)state;
    static const struct {
        const char *target, *authority, *rest;
    } cases[] = {
        {"http://a.example:80/v1?x=http://b/", "a.example:80", "/v1?x=http://b/"},
        {"HTTPS://[::1]:8443/", "[::1]:8443", "/"},
        {"http://a?x", "a", "?x"},
        {"http://a", "a", ""},
        {"http:///v1", "", "/v1"},
        {"/http://a/", NULL, NULL},
        {"ftp://a/", NULL, NULL},
        {"*", NULL, NULL},
        {"", NULL, NULL},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *authority = NULL;
        size_t length = 0;
        const char *rest = query_absolute(cases[i].target, &authority, &length);
        if (cases[i].rest == NULL) {
            assert_null(rest);
            continue;
        }
        assert_string_equal(rest, cases[i].rest);
        assert_int_equal(length, strlen(cases[i].authority));
        assert_memory_equal(authority, cases[i].authority, length);
    }
}

static void only_whole_addresses_are_loopback(void **state)
{
    (void)state;
    assert_true(listen_text_is_loopback("127.0.0.1"));
    assert_true(listen_text_is_loopback("127.9.9.9"));
    assert_true(listen_text_is_loopback("::1"));
    static const char *const others[] = {
        "127.0.0.1.evil.example", "127.1", "128.0.0.1", "::", "", "0.0.0.0", "localhost"};
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
        assert_false(listen_text_is_loopback(others[i]));
}

static void the_last_forwarded_address_counts(void **state)
{
    (void)state;
    char address[46];
    assert_true(query_forwarded_for("10.0.0.1, 203.0.113.7", address, sizeof address));
    assert_string_equal(address, "203.0.113.7");
    assert_true(query_forwarded_for("2001:db8::1", address, sizeof address));
    assert_false(query_forwarded_for("", address, sizeof address));
    assert_false(query_forwarded_for("a, unknown", address, sizeof address));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(escapes_are_undone_or_refused),
        cmocka_unit_test(a_parameter_is_found_once),
        cmocka_unit_test(strangers_are_named),
        cmocka_unit_test(the_language_that_is_liked_best),
        cmocka_unit_test(whole_numbers_only),
        cmocka_unit_test(prefer_wait_is_read),
        cmocka_unit_test(accept_chooses),
        cmocka_unit_test(tags_match_weakly),
        cmocka_unit_test(hosts_are_whole_names),
        cmocka_unit_test(targets_in_absolute_form_are_taken_apart),
        cmocka_unit_test(only_whole_addresses_are_loopback),
        cmocka_unit_test(the_last_forwarded_address_counts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
