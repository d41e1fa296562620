/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The encoding of HL7 v2; whole messages are tested from outside in tests/interop/test_hl7.py. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "api/hl7.h"
#include "api/measure.h"

static struct hl7 *parse(const char *text)
{
    struct hl7 *m = NULL;
    assert_int_equal(hl7_parse(&m, text, strlen(text), NULL), ISCHIA_OK);
    return m;
}

static void test_fields(void **state)
{
    struct hl7 *m = parse("MSH|^~\\&|APP^x|FAC\rPID|1||7^^^H&1~8^^^K||\r\n\nOBX\r");
    char text[32];
    (void)state;
    assert_int_equal(m->count, 3);
    assert_true(hl7_is(m, 0, "MSH") && hl7_is(m, 1, "PID") && hl7_is(m, 2, "OBX"));
    assert_false(hl7_is(m, 2, "OBR"));
    assert_true(hl7_get(m, 0, 3, 1, text, sizeof text));
    assert_string_equal(text, "APP");
    assert_true(hl7_get(m, 0, 4, 1, text, sizeof text));
    assert_string_equal(text, "FAC");
    assert_true(hl7_get(m, 0, 40, 1, text, sizeof text));
    assert_string_equal(text, "");
    assert_true(hl7_raw(m, 1, 3, text, sizeof text));
    assert_string_equal(text, "7^^^H&1");
    assert_true(hl7_repeats(m, 1, 3) && !hl7_repeats(m, 1, 1));
    assert_false(hl7_raw(m, 1, 3, text, 4));
    assert_true(hl7_get(m, 2, 5, 1, text, sizeof text));
    hl7_destroy(m);
}

static void test_escapes_come_back(void **state)
{
    static const char odd[] = "a|b^c~d\\e&f \xC3\xA9";
    struct text_out out;
    char text[64];
    (void)state;
    text_out_init(&out);
    text_put_string(&out, "MSH|^~\\&|");
    hl7_put_text(&out, odd);
    struct hl7 *m = NULL;
    text_put_string(&out, "|||||||||||||||UNICODE UTF-8");
    assert_int_equal(hl7_parse(&m, out.text, out.length, NULL), ISCHIA_OK);
    assert_true(hl7_get(m, 0, 3, 1, text, sizeof text));
    assert_string_equal(text, odd);
    hl7_destroy(m);
    text_out_finish(&out);
}

static void test_what_is_no_message(void **state)
{
    static const char *const bad[] = {"",          "MSH",        "MSH|^~\\&",   "MSH|||||||",
                                      "MSHabcdef", "PID|^~\\&|", "MSH|^~\\\\|", "MSH |^~\\|"};
    struct hl7 *m = NULL;
    struct ischia_error err;
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_int_equal(hl7_parse(&m, bad[i], strlen(bad[i]), &err), ISCHIA_E_INPUT);
    assert_null(m);
}

static void test_times(void **state)
{
    static const struct {
        const char *rfc3339, *ts;
    } both[] = {
        {"2026-03-01T09:30:00Z", "20260301093000+0000"},
        {"2026-03-01T09:30:00.123Z", "20260301093000.123+0000"},
        {"2026-03-01T09:30:00+01:00", "20260301093000+0100"},
        {"2026-03-01T09:30:00-05:30", "20260301093000-0530"},
        {"2026-03-01", "20260301"},
        {"", ""},
    };
    char ts[HL7_TIME_BYTES], back[ISCHIA_MEASURED_AT_BYTES];
    (void)state;
    for (size_t i = 0; i < sizeof both / sizeof both[0]; i++) {
        hl7_time(both[i].rfc3339, ts);
        assert_string_equal(ts, both[i].ts);
        hl7_time_read(both[i].ts, back);
        const char *z = strchr(both[i].rfc3339, 'Z');
        if (z == NULL) assert_string_equal(back, both[i].rfc3339);
        if (z != NULL) assert_non_null(strstr(back, "+00:00"));
    }
    hl7_time("2026-03-01T09:30:00.1234567+01:00", ts); /* HL7 has four digits behind the point */
    assert_string_equal(ts, "20260301093000.1234+0100");
    hl7_time("2026-03-01t09:30:00.12345678901234567z", ts);
    assert_string_equal(ts, "20260301093000.1234+0000");
    hl7_time_read("20260301093000", back); /* no offset: whose clock is not said */
    assert_string_equal(back, "2026-03-01");
    hl7_time_read("202603", back);
    assert_string_equal(back, "");
    hl7_time_read("20261399", back);
    assert_string_equal(back, "");
}

static void test_a_request_is_read_back(void **state)
{
    static struct hl7_input input;
    static const double values[] = {7.1, 22.8, 31, 10, 8, 5, 258.125};
    const struct hl7_sender sender = {"EHR", "", "ISCHIA", "", "17", "20260301"};
    struct ischia_request request;
    struct doc_faults faults;
    struct text_out out;
    (void)state;
    ischia_request_init(&request);
    memcpy(request.values.param, values, sizeof values);
    request.side = ISCHIA_SIDE_RIGHT;
    request.values.resolution = ISCHIA_FINE;
    (void)snprintf(request.label, sizeof request.label, "a|b");
    (void)snprintf(request.measured_at, sizeof request.measured_at, "2026-03-01");
    (void)snprintf(request.preset, sizeof request.preset, "%s", ischia_presets[1].name);
    memcpy(request.values.option, ischia_presets[1].option, sizeof request.values.option);
    assert_true(hl7_carries(&request));
    request.has_sd = true;
    request.sd[ISCHIA_R2] = 10.6;
    request.sd[ISCHIA_F] = 25;
    text_out_init(&out);
    doc_faults_init(&faults);
    hl7_put_request(&out, &sender, &request);
    assert_int_equal(hl7_read(&input, out.text, out.length, "ISCHIA", &faults), HL7_ACCEPTED);
    assert_memory_equal(input.request.values.param, values, sizeof values);
    assert_int_equal(input.request.side, ISCHIA_SIDE_RIGHT);
    assert_int_equal(input.request.values.resolution, ISCHIA_FINE);
    assert_string_equal(input.request.label, "a|b");
    assert_string_equal(input.request.measured_at, "2026-03-01");
    assert_string_equal(input.request.preset, ischia_presets[1].name);
    assert_memory_equal(input.request.values.option, request.values.option,
                        sizeof request.values.option);
    assert_true(input.request.has_sd && !input.request.sd_typical);
    assert_memory_equal(input.request.sd, request.sd, sizeof request.sd);
    assert_string_equal(input.head.control_id, "17");
    text_out_finish(&out);
}

static void test_single_options_have_no_place(void **state)
{
    struct ischia_request request;
    (void)state;
    ischia_request_init(&request);
    assert_true(hl7_carries(&request));
    request.values.option[ISCHIA_SKIN_MU] += 1;
    assert_false(hl7_carries(&request));
}

/* The latest by the clock, not by its digits. */
static void test_the_latest_observation_says_when(void **state)
{
    static const char *const times[] = {"20260301090000+0200", "20260301083000+0000", "20260301"};
    static struct hl7_input input;
    const double values[] = {7.1, 22.8, 31, 10, 8, 5, 258};
    struct doc_faults faults;
    char text[1024];
    size_t used = (size_t)snprintf(text, sizeof text,
                                   "MSH|^~\\&|EHR|||||"
                                   "|ORU^R01|1|P|2.5.1\rOBR|1\r");
    (void)state;
    doc_faults_init(&faults);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        used += (size_t)snprintf(
            text + used, sizeof text - used, "OBX|%d|NM|%s^^99ISCHIA||%g|%s^^UCUM|||||F|||%s\r",
            i + 1, ischia_params[i].key, values[i], ischia_params[i].unit, times[i % 3]);
    assert_int_equal(hl7_read(&input, text, used, "ISCHIA", &faults), HL7_ACCEPTED);
    assert_string_equal(input.request.measured_at, "2026-03-01T08:30:00+00:00");
}

/* ids of Observations are made of codes and read back; no two codes give the same. */
static void test_measures(void **state)
{
    char id[MEASURE_ID_BYTES], other[MEASURE_ID_BYTES];
    (void)state;
    for (int i = 0; i < MEASURE_COUNT; i++) {
        const struct measure m = measure_at(i);
        assert_int_equal(measure_find(m.code), i);
        assert_true(m.display[0] != '\0' && m.definition[0] != '\0' && m.v1[0] == '/');
        measure_id(i, id);
        assert_null(strchr(id, '_'));
        assert_true(strlen(id) + 37 <= 64); /* behind an assessment's id: what FHIR allows */
        for (int k = 0; k < i; k++) {
            measure_id(k, other);
            assert_string_not_equal(id, other);
        }
    }
    assert_int_equal(measure_find("R3"), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fields),
        cmocka_unit_test(test_escapes_come_back),
        cmocka_unit_test(test_what_is_no_message),
        cmocka_unit_test(test_times),
        cmocka_unit_test(test_a_request_is_read_back),
        cmocka_unit_test(test_single_options_have_no_place),
        cmocka_unit_test(test_the_latest_observation_says_when),
        cmocka_unit_test(test_measures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
