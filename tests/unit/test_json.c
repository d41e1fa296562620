/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/samples.h"

#include "api/json.h"

static struct json *root;
static struct doc_faults faults;
static struct ischia_error err;

static enum ischia_code parse(const char *text, size_t length)
{
    doc_faults_init(&faults);
    root = NULL;
    return json_parse(&root, text, length, &json_limits_request, &faults, &err);
}

static void json_is_read(void **state)
{
    static const char *const good[] = {
        "{}",
        " [ ] ",
        "null",
        "true",
        "\t\r\n -1.5e3 ",
        "\"\"",
        "[1,2,{\"a\":[null,false]}]",
        "\"\\u00b5 \\ud83d\\ude42 \\\" \\\\ \\/ \\b\\f\\n\\r\\t\"",
        "{\"\":1}",
        "\"\x7f\"",
        "-0",
    };
    (void)state;
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        assert_int_equal(parse(good[i], strlen(good[i])), ISCHIA_OK);
        assert_int_equal(faults.count, 0);
        json_destroy(root);
    }
}

/* What RFC 8259 does not allow, much of which cJSON would take. */
static void what_is_not_json_is_refused(void **state)
{
    static const char *const bad[] = {
        "",
        " ",
        "NaN",
        "Infinity",
        "-Infinity",
        "nan",
        "01",
        "-01",
        "+1",
        "1.",
        ".5",
        "1e",
        "0x10",
        "-",
        "1,5",
        "1 2",
        "{} x",
        "[1,]",
        "[,1]",
        "[1 2]",
        "{\"a\":1,}",
        "{\"a\" 1}",
        "{a:1}",
        "{'a':1}",
        "{1:1}",
        "{\"a\"}",
        "[",
        "{",
        "\"",
        "[1",
        "{\"a\":",
        "]",
        "\"\\x\"",
        "\"\\u12\"",
        "\"\\ud800\"",
        "\"\\ud800\\u0041\"",
        "\"\\udc00\"",
        "\"\t\"",
        "\"\xff\"",
        "\"\xc0\x80\"",
        "\"\xed\xa0\x80\"",
        "tru",
        "TRUE",
        "nulll",
        "// x\n1",
        "/* x */1",
        "\xEF\xBB\xBF{}",
        "\xC2\xA0{}",
        "\"\\",
        "\"\\u\"",
        "[1]\x01",
        "1111111111111111111111111111111111111111111111111111111111111111",
    };
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        if (parse(bad[i], strlen(bad[i])) != ISCHIA_E_INPUT) fail_msg("accepted: %s", bad[i]);
        assert_null(root);
        assert_null(strchr(err.message, '\n'));
    }
    assert_int_equal(parse("1\0", 2), ISCHIA_E_INPUT);
    assert_int_equal(parse("\"a\0b\"", 5), ISCHIA_E_INPUT);
}

static void messages_say_where(void **state)
{
    (void)state;
    assert_int_equal(parse("{\n  \"muM\": NaN}", 15), ISCHIA_E_INPUT);
    assert_string_equal(err.message, "not JSON: line 2, column 10, at or after \"muM\": expected a "
                                     "value (NaN and Infinity are not JSON), found 'N'");
    for (int before = 30; before < 40; before++) { /* a cut inside a character, and beside it */
        char text[64];
        const int length = snprintf(text, sizeof text, "{\"%.*s\xc3\xa9\xc3\xa9\xc3\xa9\": x}",
                                    before, "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa");
        assert_int_equal(parse(text, (size_t)length), ISCHIA_E_INPUT);
        assert_true(text_is_utf8(err.message, strlen(err.message)));
    }
}

static void depth_and_size_are_limited(void **state)
{
    static char brackets[64 * 1024 + 1];
    (void)state;
    memset(brackets, '[', 17);
    memset(brackets + 17, ']', 17);
    assert_int_equal(parse(brackets, 34), ISCHIA_OK);
    json_destroy(root);
    assert_int_equal(faults.count, 1);
    assert_string_equal(faults.item[0].code, "too_many");
    assert_non_null(strstr(faults.item[0].detail, "16 deep"));
    assert_int_equal(parse(brackets + 1, 32), ISCHIA_OK);
    json_destroy(root);
    assert_int_equal(faults.count, 0);
    memset(brackets, '[', 65);
    memset(brackets + 65, ']', 65);
    assert_int_equal(parse(brackets, 130), ISCHIA_E_INPUT);
    assert_non_null(strstr(err.message, "16 deep"));
    assert_int_equal(parse(brackets + 1, 128), ISCHIA_OK);
    json_destroy(root);
    memset(brackets, '[', sizeof brackets);
    assert_int_equal(parse(brackets, sizeof brackets), ISCHIA_E_LIMIT);
    assert_int_equal(parse(brackets, sizeof brackets - 1), ISCHIA_E_INPUT);
    memset(brackets, ' ', sizeof brackets);
    brackets[0] = '1';
    assert_int_equal(parse(brackets, sizeof brackets - 1), ISCHIA_OK);
    json_destroy(root);
}

static void an_escaped_nul_is_a_fault(void **state)
{
    static const char text[] = "{\"label\":\"a\\u0000b\",\"x\":[\"\\u0000\",1,1]}";
    (void)state;
    assert_int_equal(parse(text, strlen(text)), ISCHIA_OK);
    assert_int_equal(faults.count, 1);
    assert_string_equal(faults.item[0].code, "malformed");
    assert_string_equal(faults.item[0].detail,
                        "a text at or after \"label\" holds \\u0000, which is not accepted");
    assert_int_equal(json_count(json_member(root, "x")), 3);
    json_destroy(root);
    assert_int_equal(parse("\"\\u0000\"", 8), ISCHIA_OK);
    assert_int_equal(faults.count, 1);
    json_destroy(root);
    assert_int_equal(parse("{\"a\":\"\\u0000\"} x", 16), ISCHIA_E_INPUT);
}

static void duplicates_are_faults(void **state)
{
    static const char text[] = "{\"a\":1,\"b\":[0,{\"c/~\":1,\"c/~\":2}],\"a\":2,\"A\":3}";
    (void)state;
    assert_int_equal(parse(text, strlen(text)), ISCHIA_OK);
    assert_int_equal(faults.count, 2);
    assert_string_equal(faults.item[0].pointer, "/b/1/c~1~0");
    assert_string_equal(faults.item[0].code, "duplicate");
    assert_string_equal(faults.item[1].pointer, "/a");
    json_destroy(root);
}

static void a_number_beyond_a_double_is_a_fault(void **state)
{
    (void)state;
    assert_int_equal(parse("{\"F\":[1e308,-1e999]}", 20), ISCHIA_OK);
    assert_int_equal(faults.count, 1);
    assert_string_equal(faults.item[0].pointer, "/F/1");
    assert_string_equal(faults.item[0].code, "not_finite");
    json_destroy(root);
}

static void too_many_members_are_a_fault(void **state)
{
    char text[8 * 300 + 2], *at = text;
    (void)state;
    for (int i = 0; i < 300; i++) at += snprintf(at, 16, "%c\"%d\":0", i == 0 ? '{' : ',', i);
    *at++ = '}';
    assert_int_equal(parse(text, (size_t)(at - text)), ISCHIA_OK);
    assert_int_equal(faults.count, 1);
    assert_string_equal(faults.item[0].code, "too_many");
    json_destroy(root);
}

static void values_are_looked_at(void **state)
{
    static const char text[] =
        "{\"n\":null,\"t\":true,\"f\":false,\"d\":-0.5,\"s\":\"\\u03bcM\",\"a\":[1,2,3]}";
    (void)state;
    assert_int_equal(parse(text, strlen(text)), ISCHIA_OK);
    assert_int_equal(json_count(root), 6);
    assert_int_equal(json_type_of(json_member(root, "n")), JSON_NULL);
    assert_true(json_bool(json_member(root, "t")));
    assert_false(json_bool(json_member(root, "f")));
    assert_true(json_number(json_member(root, "d")) == -0.5);
    assert_string_equal(json_string(json_member(root, "s")), "\xCE\xBCM");
    assert_int_equal(json_count(json_member(root, "a")), 3);
    assert_null(json_member(root, "N"));
    assert_null(json_member(json_member(root, "a"), "x"));
    assert_string_equal(json_key(json_first(root)), "n");
    assert_null(json_first(json_member(root, "s")));
    json_destroy(root);
}

static void put_sample(struct json_out *out)
{
    json_open_object(out, NULL);
    json_put_string(out, "s", "\"\\\n\x01\x7f \xCE\xBC");
    json_open_array(out, "a");
    json_put_number(out, NULL, 0.1);
    json_put_integer(out, NULL, -7);
    json_put_number_or_null(out, NULL, (double)NAN);
    json_close_array(out);
    json_open_object(out, "o");
    json_close_object(out);
    json_put_bool(out, "b", true);
    json_put_null(out, "z");
    json_put_raw(out, "r", "[1]");
    json_close_object(out);
}

static void json_is_written(void **state)
{
    struct json_out out;
    char *text;
    size_t length;
    (void)state;
    json_out_init(&out, 0);
    put_sample(&out);
    assert_int_equal(json_out_take(&out, &text, &length, &err), ISCHIA_OK);
    assert_string_equal(text, "{\"s\":\"\\\"\\\\\\n\\u0001\\u007f \xCE\xBC\",\"a\":[0.1,-7,null],"
                              "\"o\":{},\"b\":true,\"z\":null,\"r\":[1]}");
    assert_int_equal(length, strlen(text));
    assert_int_equal(parse(text, length), ISCHIA_OK);
    assert_string_equal(json_string(json_first(root)), "\"\\\n\x01\x7f \xCE\xBC");
    json_destroy(root);
    free(text);
}

static void indented_json_says_the_same(void **state)
{
    struct json_out out;
    char *text;
    (void)state;
    json_out_init(&out, 2);
    put_sample(&out);
    assert_int_equal(json_out_take(&out, &text, NULL, &err), ISCHIA_OK);
    assert_non_null(
        strstr(text, "\n  \"a\": [\n    0.1,\n    -7,\n    null\n  ],\n  \"o\": {},\n"));
    assert_int_equal(parse(text, strlen(text)), ISCHIA_OK);
    json_destroy(root);
    free(text);
}

static void infinity_is_not_written(void **state)
{
    struct json_out out;
    char *text = NULL;
    (void)state;
    json_out_init(&out, 0);
    json_open_array(&out, NULL);
    json_put_number(&out, NULL, (double)INFINITY);
    json_close_array(&out);
    assert_int_equal(json_out_take(&out, &text, NULL, &err), ISCHIA_E_NUMERIC);
    assert_null(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(json_is_read),
        cmocka_unit_test(what_is_not_json_is_refused),
        cmocka_unit_test(messages_say_where),
        cmocka_unit_test(depth_and_size_are_limited),
        cmocka_unit_test(an_escaped_nul_is_a_fault),
        cmocka_unit_test(duplicates_are_faults),
        cmocka_unit_test(a_number_beyond_a_double_is_a_fault),
        cmocka_unit_test(too_many_members_are_a_fault),
        cmocka_unit_test(values_are_looked_at),
        cmocka_unit_test(json_is_written),
        cmocka_unit_test(indented_json_says_the_same),
        cmocka_unit_test(infinity_is_not_written),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
