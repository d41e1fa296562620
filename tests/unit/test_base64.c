/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "api/base64.h"

/* RFC 4648, section 10. */
static void test_vectors(void **state)
{
    static const struct {
        const char *plain, *padded, *bare;
    } rows[] = {
        {"", "", ""},
        {"f", "Zg==", "Zg"},
        {"fo", "Zm8=", "Zm8"},
        {"foo", "Zm9v", "Zm9v"},
        {"foobar", "Zm9vYmFy", "Zm9vYmFy"},
        {"\xff\xfe\xfd?>", "//79Pz4=", "__79Pz4"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct text_out out;
        unsigned char back[16];
        size_t size = 99;
        text_out_init(&out);
        base64_put(&out, rows[i].plain, strlen(rows[i].plain));
        assert_string_equal(out.text == NULL ? "" : out.text, rows[i].padded);
        text_out_clear(&out);
        base64url_put(&out, rows[i].plain, strlen(rows[i].plain));
        assert_string_equal(out.text == NULL ? "" : out.text, rows[i].bare);
        assert_true(base64url_decode(rows[i].bare, strlen(rows[i].bare), back, sizeof back, &size));
        assert_int_equal(size, strlen(rows[i].plain));
        assert_memory_equal(back, rows[i].plain, size);
        text_out_finish(&out);
    }
}

static void test_what_is_not_base64url(void **state)
{
    static const char *const bad[] = {"Z",    "Zg==", "Zm9v!", "Zm 9v", "Zh" /* bits left over */,
                                      "Zm9+", "/m9v"};
    unsigned char back[16];
    size_t size = 0;
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(base64url_decode(bad[i], strlen(bad[i]), back, sizeof back, &size));
    assert_false(base64url_decode("Zm9vYmFy", 8, back, 5, &size)); /* no room */
    assert_false(base64url_decode("Zm\0v", 4, back, sizeof back, &size));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_vectors),
        cmocka_unit_test(test_what_is_not_base64url),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
