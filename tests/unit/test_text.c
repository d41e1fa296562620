/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/samples.h"

#include "api/text.h"

static void shortest_numbers(void **state)
{
    static const struct {
        double value;
        const char *text;
    } cases[] = {
        {0.1, "0.1"},      {0.1 + 0.2, "0.30000000000000004"},
        {258, "258"},      {-0.0, "-0"},
        {1e308, "1e+308"}, {5e-324, "4.94065645841247e-324"},
        {1e21, "1e+21"},   {1.0 / 3, "0.3333333333333333"},
        {8, "8"},          {123456789.125, "123456789.125"},
    };
    char buffer[TEXT_NUMBER_BYTES];
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        assert_string_equal(text_from_number(cases[i].value, buffer), cases[i].text);
}

/* Random bit patterns: what is written reads back as the same bits. */
static void numbers_survive(void **state)
{
    uint64_t bits = 88172645463325252U;
    char buffer[TEXT_NUMBER_BYTES];
    (void)state;
    for (int i = 0; i < 20000; i++) {
        double value, back;
        bits ^= bits << 13, bits ^= bits >> 7, bits ^= bits << 17;
        memcpy(&value, &bits, sizeof value);
        if (!isfinite(value)) continue;
        (void)text_from_number(value, buffer);
        assert_true(text_to_number(buffer, strlen(buffer), &back));
        assert_memory_equal(&value, &back, sizeof value);
    }
}

static void only_json_numbers_are_numbers(void **state)
{
    static const char *const good[] = {"0",     "-0",   "1.5",   "-1.5e3",
                                       "1E+05", "1e-5", "1e999", "10.01"};
    static const char *const bad[] = {"",    "+1",  "01",   "-01",  "1.",  ".5",  "1e",
                                      "1e+", "0x1", "1,5",  "nan",  "NaN", "inf", " 1",
                                      "1 ",  "--1", "1e5.", "1.e5", "1_0", "٣",   "1e1e1"};
    double value;
    (void)state;
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++)
        assert_true(text_to_number(good[i], strlen(good[i]), &value));
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(text_to_number(bad[i], strlen(bad[i]), &value));
    char longest[TEXT_NUMBER_LENGTH_MAX + 2];
    memset(longest, '1', sizeof longest);
    assert_true(text_to_number(longest, TEXT_NUMBER_LENGTH_MAX, &value));
    assert_false(text_to_number(longest, TEXT_NUMBER_LENGTH_MAX + 1, &value));
}

static void numbers_are_read_as_people_type_them(void **state)
{
    static const struct {
        const char *text;
        double value;
    } good[] = {
        {"7.1", 7.1},
        {"7,1", 7.1},
        {" 7 ", 7},
        {".5", 0.5},
        {",5", 0.5},
        {"5,", 5},
        {"+3", 3},
        {"-2,5", -2.5},
        {"\xE2\x88\x92"
         "2",
         -2},
        {"007", 7},
        {"2,58e2", 258},
        {"\xC2\xA0"
         "8\xE2\x80\xAF ",
         8},
    };
    static const char *const ambiguous[] = {"1,234.5", "1.234,5", "1,2,3",    "1.2.3",
                                            "..1",     "-1,,2",   "1,234.5e2"};
    static const char *const bad[] = {
        "",
        " ",
        "\xC2\xA0",
        "x",
        "7 mm",
        "0x10",
        "1 234",
        "--1",
        "+-1",
        ".",
        ",",
        "..",
        "+",
        "-",
        "e5",
        "1e",
        "1e+",
        "nan",
        "inf",
        "NaN",
        "1e1.",
        "1e5,",
        "٣",
        "\xE2\x88\x92",
        "\xE2\x88\x92-1",
        "1_0",
        "infinity",
        "0x1p3",
    };
    double value;
    (void)state;
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        assert_int_equal(text_to_typed_number(good[i].text, &value), TEXT_TYPED_NUMBER);
        assert_true(value == good[i].value);
    }
    value = 77;
    for (size_t i = 0; i < sizeof ambiguous / sizeof ambiguous[0]; i++)
        assert_int_equal(text_to_typed_number(ambiguous[i], &value), TEXT_TYPED_AMBIGUOUS);
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_int_equal(text_to_typed_number(bad[i], &value), TEXT_TYPED_NO_NUMBER);
    assert_true(value == 77);
    char longest[TEXT_NUMBER_LENGTH_MAX + 2];
    memset(longest, '1', sizeof longest);
    longest[sizeof longest - 1] = '\0';
    assert_int_equal(text_to_typed_number(longest, &value), TEXT_TYPED_NO_NUMBER);
    longest[TEXT_NUMBER_LENGTH_MAX] = '\0';
    assert_int_equal(text_to_typed_number(longest, &value), TEXT_TYPED_NUMBER);
}

static void utf8_is_strict(void **state)
{
    static const char *const good[] = {"a",
                                       "\xC2\x80",
                                       "\xDF\xBF",
                                       "\xE0\xA0\x80",
                                       "\xED\x9F\xBF",
                                       "\xEE\x80\x80",
                                       "\xEF\xBF\xBF",
                                       "\xF0\x90\x80\x80",
                                       "\xF4\x8F\xBF\xBF"};
    static const char *const bad[] = {"\x80",
                                      "\xC0\x80",
                                      "\xC1\xBF",
                                      "\xE0\x9F\xBF",
                                      "\xED\xA0\x80",
                                      "\xF0\x8F\xBF\xBF",
                                      "\xF4\x90\x80\x80",
                                      "\xF5\x80\x80\x80",
                                      "\xE2\x82",
                                      "\xFF",
                                      "\xC2",
                                      "\xE2\x82("};
    (void)state;
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++)
        assert_true(text_is_utf8(good[i], strlen(good[i])));
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(text_is_utf8(bad[i], strlen(bad[i])));
    assert_int_equal(text_character_count("\xCE\xBCM \xF0\x9F\x99\x82"), 4);
}

static void messages_are_printable(void **state)
{
    char buffer[12];
    (void)state;
    assert_string_equal(text_printable("a\x1b[2Jb", buffer, sizeof buffer), "a?[2Jb");
    assert_string_equal(text_printable("\xC2\x9Bx\xFF", buffer, sizeof buffer), "?x?");
    assert_string_equal(text_printable("12345678901", buffer, sizeof buffer), "12345678901");
    assert_string_equal(text_printable("123456789012", buffer, sizeof buffer), "12345678...");
    assert_string_equal(text_printable("1234567\xE2\x82\xAC"
                                       "9012",
                                       buffer, sizeof buffer),
                        "1234567...");
}

static void dates_are_real(void **state)
{
    static const char *const good[] = {"2026-03-01", "2024-02-29", "2026-03-01T09:30:00Z",
                                       "2026-03-01t09:30:00.125+01:00", "2016-12-31T23:59:60Z"};
    static const char *const bad[] = {"",
                                      "2026-3-1",
                                      "2026-13-01",
                                      "2026-02-29",
                                      "1900-02-29",
                                      "2026-00-10",
                                      "2026-03-01T09:30:00",
                                      "2026-03-01T24:00:00Z",
                                      "2026-03-01 09:30:00Z",
                                      "2026-03-01T09:30Z",
                                      "2026-03-01T09:30:00.Z",
                                      "2026-03-01x",
                                      "01.03.2026"};
    (void)state;
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++)
        assert_true(text_is_date_or_time(good[i]));
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(text_is_date_or_time(bad[i]));
}

static void pseudonyms(void **state)
{
    char longest[66];
    (void)state;
    memset(longest, 'a', sizeof longest - 1);
    longest[65] = '\0';
    assert_false(text_is_pseudonym(longest));
    longest[64] = '\0';
    assert_true(text_is_pseudonym(longest));
    assert_true(text_is_pseudonym("P-017_b.2"));
    assert_false(text_is_pseudonym(""));
    assert_false(text_is_pseudonym("Jane Doe"));
    assert_false(text_is_pseudonym("J\xC3\xBCrgen"));
}

static void distances(void **state)
{
    (void)state;
    assert_int_equal(text_distance("muM", "mum"), 0);
    assert_int_equal(text_distance("resolutoin", "resolution"), 1);
    assert_int_equal(text_distance("kitten", "sitting"), 3);
    assert_int_equal(text_distance("", "abc"), 3);
    assert_int_equal(text_distance("a much longer text than any key of ours", "F"),
                     TEXT_DISTANCE_LENGTH_MAX);
}

static void slips_are_few(void **state)
{
    (void)state;
    assert_int_equal(text_slips("--vut", "--vtu"), 1);
    assert_int_equal(text_slips("sovle", "solve"), 1);
    assert_int_equal(text_slips("foo", "hl7"), TEXT_NO_SLIP);
    assert_int_equal(text_slips("--hel", "--vtu"), TEXT_NO_SLIP);
    assert_int_equal(text_slips("", "F"), TEXT_NO_SLIP);
}

static void a_text_grows(void **state)
{
    struct text_out out;
    struct ischia_error err;
    char *text;
    size_t length;
    (void)state;
    text_out_init(&out);
    for (int i = 0; i < 1000; i++) text_put(&out, "0123456789", 10);
    assert_int_equal(text_out_take(&out, &text, &length, &err), ISCHIA_OK);
    assert_int_equal(length, 10000);
    assert_int_equal(strlen(text), 10000);
    free(text);
    assert_int_equal(text_out_take(&out, &text, NULL, &err), ISCHIA_OK);
    assert_string_equal(text, "");
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shortest_numbers),
        cmocka_unit_test(numbers_survive),
        cmocka_unit_test(only_json_numbers_are_numbers),
        cmocka_unit_test(numbers_are_read_as_people_type_them),
        cmocka_unit_test(utf8_is_strict),
        cmocka_unit_test(messages_are_printable),
        cmocka_unit_test(dates_are_real),
        cmocka_unit_test(pseudonyms),
        cmocka_unit_test(distances),
        cmocka_unit_test(slips_are_few),
        cmocka_unit_test(a_text_grows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
