/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/samples.h"

#include "api/assessment_doc.h"

static struct ischia_error err;

static struct assessment queued(void)
{
    struct assessment a = {.id = "0192f0c1-0000-7000-8000-000000000001",
                           .status = ASSESSMENT_QUEUED,
                           .created_at = "2026-03-01T09:30:00.000Z",
                           .request = sample_request()};
    (void)snprintf(a.request.subject, sizeof a.request.subject, "P-017");
    a.request.side = ISCHIA_SIDE_LEFT;
    return a;
}

static char *write_assessment(const struct assessment *a)
{
    char *text = NULL;
    assert_int_equal(assessment_doc_text(&text, a, 0, &err), ISCHIA_OK);
    return text;
}

static void a_queued_side(void **state)
{
    const struct assessment a = queued();
    char *text = write_assessment(&a);
    (void)state;
    assert_string_equal(
        text,
        "{\"id\":\"0192f0c1-0000-7000-8000-000000000001\",\"status\":\"queued\","
        "\"created_at\":\"2026-03-01T09:30:00.000Z\",\"started_at\":null,\"finished_at\":null,"
        "\"subject\":\"P-017\",\"side\":\"left\",\"label\":null,\"measured_at\":null,"
        "\"parameters\":{\"R1\":7.1,\"R2\":22.8,\"eM\":31,\"eF\":10,\"muM\":8,\"muF\":5,\"F\":258},"
        "\"sd\":null,"
        "\"skin\":{\"mu\":67,\"thickness\":1},\"resolution\":\"standard\","
        "\"model\":{\"name\":\"default\",\"L_over_h\":2,\"bulk_ratio\":2000,\"friction\":0.4,"
        "\"R2_surface\":0,\"embed_over_R1\":1},"
        "\"progress\":0,\"result\":null,\"problem\":null,\"warnings\":[],"
        "\"links\":{\"self\":\"/v1/assessments/0192f0c1-0000-7000-8000-000000000001\","
        "\"field\":null,\"section\":null,\"report\":null}}");
    free(text);
}

static void a_side_that_succeeded(void **state)
{
    struct assessment a = queued();
    (void)state;
    a.status = ASSESSMENT_SUCCEEDED;
    a.progress = 1;
    a.request.values.param[ISCHIA_R2] = 80;
    a.result_json = "{\"strain\":null}";
    char *text = write_assessment(&a);
    assert_non_null(strstr(text, "\"status\":\"succeeded\""));
    assert_non_null(strstr(text, "\"progress\":1,\"result\":{\"strain\":null},\"problem\":null"));
    assert_non_null(strstr(
        text,
        "\"warnings\":[{\"code\":\"outside_study_range\",\"pointer\":\"/R2\",\"detail\":\"R2 is 80 "
        "mm; the published study covers 15 to 63.3 mm\"}]"));
    assert_non_null(strstr(text, "000000000001/field.vtu\""));
    assert_non_null(strstr(text, "000000000001/section.svg\""));
    assert_non_null(strstr(text, "000000000001/report\""));
    free(text);
}

static void states_have_names(void **state)
{
    static const char *const names[ASSESSMENT_STATUS_COUNT] = {"queued", "running", "succeeded",
                                                               "failed", "cancelled"};
    (void)state;
    for (int i = 0; i < ASSESSMENT_STATUS_COUNT; i++)
        assert_string_equal(assessment_status_names[i], names[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_queued_side),
        cmocka_unit_test(a_side_that_succeeded),
        cmocka_unit_test(states_have_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
