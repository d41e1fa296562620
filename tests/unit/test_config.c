/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "server/config.h"
#include "server/log.h"

static enum ischia_code parse(struct config *config, const char *text, struct ischia_error *err)
{
    return config_parse(config, text, strlen(text), "test", err);
}

static void the_table_is_complete_and_takes_its_own_defaults(void **state)
{
    (void)state;
    struct config config = config_default();
    for (size_t i = 0; i < config_option_count; i++) {
        const struct config_option *option = &config_options[i];
        char value[CONFIG_TEXT_BYTES];
        assert_non_null(option->name);
        assert_non_null(option->unit);
        assert_true(strlen(option->help) > 10);
        assert_true(option->offset < sizeof config);
        assert_int_equal(option->kind == CONFIG_CHOICE, option->choices != NULL);
        if (option->kind == CONFIG_INTEGER) assert_true(option->min < option->max);
        config_value_text(&config, option, value, sizeof value);
        assert_string_equal(value, option->default_text);
        for (size_t j = 0; j < i; j++) {
            assert_string_not_equal(option->name, config_options[j].name);
            assert_true(option->offset != config_options[j].offset);
        }
    }
    assert_int_equal(config_check(&config, NULL), ISCHIA_OK);
}

static void lines_may_have_blanks_and_comments(void **state)
{
    (void)state;
    struct config config = config_default();
    assert_int_equal(parse(&config, "# all\n\n  workers\t=  7 # seven\r\nlisten=[::1]:0", NULL),
                     ISCHIA_OK);
    assert_int_equal(config.workers, 7);
    assert_string_equal(config.listen, "[::1]:0");
}

static void a_bad_line_is_named(void **state)
{
    (void)state;
    struct config config = config_default();
    struct ischia_error err;
    assert_int_equal(parse(&config, "workers = 2\nqueue_limt = 5\n", &err), ISCHIA_E_INPUT);
    assert_string_equal(
        err.message, "test, line 2: no option is called 'queue_limt'; did you mean 'queue_limit'?");
    assert_int_equal(parse(&config, "workers\n", &err), ISCHIA_E_INPUT);
    assert_string_equal(err.message, "test, line 1: expected `name = value`");
    assert_int_equal(parse(&config, "zzzzzzzzzzzz = 1", &err), ISCHIA_E_INPUT);
    assert_null(strstr(err.message, "did you mean"));
}

static void values_out_of_bounds_are_refused_and_change_nothing(void **state)
{
    (void)state;
    static const struct {
        const char *name, *value;
    } bad[] = {{"workers", "-1"},     {"workers", "1025"}, {"workers", "2x"},
               {"workers", ""},       {"workers", "1e2"},  {"behind_proxy", "maybe"},
               {"log_level", "loud"}, {"audit", ""},       {"workers", "99999999999999999999"},
               {"listen", "a\nb"},    {"rate_burst", "0"}, {"drain_timeout", "3601"}};
    struct config config = config_default();
    const struct config before = config;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct ischia_error err = {.message = ""};
        assert_int_equal(config_set(&config, bad[i].name, bad[i].value, &err), ISCHIA_E_INPUT);
        assert_non_null(strstr(err.message, bad[i].name));
    }
    assert_memory_equal(&config, &before, sizeof config);
}

static void text_that_does_not_fit_is_refused(void **state)
{
    (void)state;
    struct config config = config_default();
    char value[CONFIG_TEXT_BYTES + 1];
    memset(value, 'a', sizeof value - 1);
    value[sizeof value - 1] = '\0';
    assert_int_equal(config_set(&config, "listen", value, NULL), ISCHIA_E_INPUT);
    value[CONFIG_TEXT_BYTES - 1] = '\0';
    assert_int_equal(config_set(&config, "listen", value, NULL), ISCHIA_OK);
    assert_int_equal(strlen(config.listen), CONFIG_TEXT_BYTES - 1);
}

static void the_environment_sets_options_and_names_strangers(void **state)
{
    (void)state;
    static char workers[] = "ISCHIA_WORKERS=5", odd[] = "ISCHIA_WROKERS=1", other[] = "PATH=/x";
    char *const good[] = {workers, odd, other, NULL};
    static char bad_value[] = "ISCHIA_AUDIT=never";
    char *const bad[] = {bad_value, NULL};
    struct config config = config_default();
    struct ischia_error err;
    char unknown[64];
    assert_int_equal(config_read_environment(&config, good, unknown, sizeof unknown, &err),
                     ISCHIA_OK);
    assert_int_equal(config.workers, 5);
    assert_string_equal(unknown, "ISCHIA_WROKERS");
    assert_int_equal(config_read_environment(&config, bad, unknown, sizeof unknown, &err),
                     ISCHIA_E_INPUT);
    assert_non_null(strstr(err.message, "ISCHIA_AUDIT"));
}

static void options_that_belong_together_are_checked(void **state)
{
    (void)state;
    struct config config = config_default();
    assert_int_equal(config_set(&config, "tls_key", "/k", NULL), ISCHIA_OK);
    assert_int_equal(config_check(&config, NULL), ISCHIA_E_INPUT);
    assert_int_equal(config_set(&config, "tls_certificate", "/c", NULL), ISCHIA_OK);
    assert_int_equal(config_check(&config, NULL), ISCHIA_OK);
    config.connections_per_address = config.connections + 1;
    assert_int_equal(config_check(&config, NULL), ISCHIA_E_INPUT);
}

static void a_reload_takes_what_it_may_and_names_the_rest(void **state)
{
    (void)state;
    struct config config = config_default(), fresh = config;
    char names[128];
    fresh.rate_limit = 3;
    fresh.log_level = LOG_LEVEL_ERROR;
    fresh.workers = 9;
    fresh.behind_proxy = true;
    assert_int_equal(config_reload(&config, &fresh, names, sizeof names), 2);
    assert_string_equal(names, "workers behind_proxy");
    assert_int_equal(config.rate_limit, 3);
    assert_int_equal(config.log_level, LOG_LEVEL_ERROR);
    assert_int_equal(config.workers, 0);
    assert_false(config.behind_proxy);
}

static void what_is_printed_can_be_read(void **state)
{
    (void)state;
    struct config config = config_default(), again = config_default();
    char *text = NULL;
    size_t size = 0;
    assert_int_equal(config_set(&config, "allowed_hosts", "a.example,b.example", NULL), ISCHIA_OK);
    assert_int_equal(config_set(&config, "audit", "off", NULL), ISCHIA_OK);
    FILE *out = open_memstream(&text, &size);
    assert_non_null(out);
    config_print(&config, out);
    assert_int_equal(fclose(out), 0);
    assert_int_equal(config_parse(&again, text, size, "printed", NULL), ISCHIA_OK);
    assert_memory_equal(&config, &again, sizeof config);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_table_is_complete_and_takes_its_own_defaults),
        cmocka_unit_test(lines_may_have_blanks_and_comments),
        cmocka_unit_test(a_bad_line_is_named),
        cmocka_unit_test(values_out_of_bounds_are_refused_and_change_nothing),
        cmocka_unit_test(text_that_does_not_fit_is_refused),
        cmocka_unit_test(the_environment_sets_options_and_names_strangers),
        cmocka_unit_test(options_that_belong_together_are_checked),
        cmocka_unit_test(a_reload_takes_what_it_may_and_names_the_rest),
        cmocka_unit_test(what_is_printed_can_be_read),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
