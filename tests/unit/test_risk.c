/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/samples.h"

#include "api/risk.h"

static struct risk assess(double E_shear, double shear_mm3, double E_comp, double comp_mm3)
{
    const struct ischia_request request = sample_request();
    struct ischia_result result = sample_result();
    struct risk risk;
    result.strain.E_shear_max = E_shear;
    result.strain.E_comp_max = E_comp;
    result.clusters[ISCHIA_OVER_SHEAR].volume_mm3 = shear_mm3;
    result.clusters[ISCHIA_OVER_COMPRESSION].volume_mm3 = comp_mm3;
    risk_assess(&risk, &request.values, &result, LANGUAGE_EN);
    return risk;
}

static void bands_say_what_is_crossed(void **state)
{
    (void)state;
    assert_int_equal(assess(0.75, 0, 0.45, 0).band, RISK_BELOW);
    assert_int_equal(assess(0.76, 0, 0.45, 0).band, RISK_SHEAR);
    assert_int_equal(assess(0.7, 5, 0.4, 0).band, RISK_SHEAR);
    assert_int_equal(assess(0.7, 0, 0.46, 9).band, RISK_COMPRESSION);
    assert_int_equal(assess(1.9, 100, 0.49, 50).band, RISK_BOTH);
}

static void reasons_have_values_and_measures(void **state)
{
    const struct risk risk = assess(1.9, 14400.1, 0.4, 0);
    (void)state;
    assert_int_equal(risk.reason_count, 3);
    assert_string_equal(
        risk.reason[0],
        "Green-Lagrange shear strain in muscle reaches 1.9; it is over the threshold of 0.75 in "
        "14400 mm³ (8.3 % of the muscle in the model).");
    assert_string_equal(risk.reason[1], "The shear threshold is first crossed at 61 N of 258 N.");
    assert_string_equal(risk.reason[2],
                        "Green-Lagrange compression strain in muscle reaches 0.4, under the "
                        "threshold of 0.45.");
}

/* No probability and no promise of safety, in any text there is. */
static void nothing_is_predicted(void **state)
{
    static const char *const banned[] = {"probab", "likel",        "chance",
                                         "safe",   "will develop", "odds"};
    (void)state;
    for (size_t w = 0; w < sizeof banned / sizeof banned[0]; w++) {
        for (int i = 0; i < RISK_BAND_COUNT; i++)
            assert_null(strstr(risk_headline((enum risk_band)i), banned[w]));
        for (size_t i = 0; i < RISK_CAVEAT_COUNT; i++)
            assert_null(strstr(risk_caveat(i), banned[w]));
    }
}

static void tables_are_complete(void **state)
{
    static const char *const names[RISK_BAND_COUNT] = {"below", "shear", "compression", "both"};
    (void)state;
    for (int i = 0; i < RISK_BAND_COUNT; i++) {
        assert_string_equal(risk_bands[i].name, names[i]);
        assert_non_null(risk_headline((enum risk_band)i));
    }
    assert_non_null(strstr(risk_caveat(0), "animals"));
    assert_non_null(strstr(risk_caveat(1), "0.5"));
    assert_non_null(strstr(risk_caveat(1), "does not diagnose"));
    assert_non_null(strstr(risk_caveat(2), "not a medical device"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bands_say_what_is_crossed),
        cmocka_unit_test(reasons_have_values_and_measures),
        cmocka_unit_test(nothing_is_predicted),
        cmocka_unit_test(tables_are_complete),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
