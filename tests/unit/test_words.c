/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "api/words.h"

static void values_stand_where_they_are_named(void **state)
{
    (void)state;
    char text[128];
    const struct word_value *values =
        WORDS(word_number("min", 0.5, 6), word_fixed("max", 30, 1), word_text("unit", "kPa"));
    assert_string_equal(words_fill(text, sizeof text, LANGUAGE_EN, WORD_FORM_ACCEPTED, values),
                        "0.5 to 30.0 kPa");
    assert_string_equal(words_fill(text, sizeof text, LANGUAGE_DE, WORD_FORM_ACCEPTED, values),
                        "0,5 bis 30,0 kPa");
}

static void a_value_that_is_not_given_is_seen_to_be_missing(void **state)
{
    (void)state;
    char text[128];
    assert_string_equal(words_fill(text, sizeof text, LANGUAGE_EN, WORD_FORM_ACCEPTED, NULL),
                        "{min} to {max} {unit}");
}

static void a_value_is_not_searched_for_values(void **state)
{
    (void)state;
    char text[128];
    const struct word_value *values = WORDS(word_text("min", "{max}"), word_text("max", "b"));
    assert_string_equal(words_fill(text, sizeof text, LANGUAGE_EN, WORD_FORM_ACCEPTED, values),
                        "{max} to b {unit}");
}

static void braces_that_name_nothing_stay(void **state)
{
    (void)state;
    char text[128];
    assert_string_equal(words_fill(text, sizeof text, LANGUAGE_EN, WORD_DAEMON_FAULT_ACCEPTED_SKIN,
                                   WORDS(word_text("mu", "x"))),
                        "an object { \"mu\": kPa, \"thickness\": mm }");
}

static void a_text_is_cut_between_characters(void **state)
{
    (void)state;
    char text[32];
    const struct word_value *values = WORDS(word_text("min", "\u00e9\u00e9\u00e9"));
    for (size_t size = 1; size <= 10; size++) {
        memset(text, '#', sizeof text);
        (void)words_fill(text, size, LANGUAGE_EN, WORD_FORM_ACCEPTED, values);
        const size_t wanted = size <= 7 ? (size - 1) / 2 * 2 : size - 1;
        assert_int_equal(strlen(text), wanted);
        assert_int_equal(text[size], '#');
    }
}

static void a_language_is_known_by_its_tag(void **state)
{
    (void)state;
    enum language language = LANGUAGE_EN;
    assert_true(words_language("de", &language));
    assert_int_equal(language, LANGUAGE_DE);
    assert_false(words_language("DE", &language));
    assert_false(words_language("", &language));
    assert_int_equal(language, LANGUAGE_DE);
    assert_null(language_tags[LANGUAGE_COUNT]);
}

static void every_text_of_every_language_is_there(void **state)
{
    (void)state;
    for (int l = 0; l < LANGUAGE_COUNT; l++)
        for (int w = 0; w < WORD_COUNT; w++) assert_non_null(words_table[l][w]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_stand_where_they_are_named),
        cmocka_unit_test(a_value_that_is_not_given_is_seen_to_be_missing),
        cmocka_unit_test(a_value_is_not_searched_for_values),
        cmocka_unit_test(braces_that_name_nothing_stay),
        cmocka_unit_test(a_text_is_cut_between_characters),
        cmocka_unit_test(a_language_is_known_by_its_tag),
        cmocka_unit_test(every_text_of_every_language_is_there),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
