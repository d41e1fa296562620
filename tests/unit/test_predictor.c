/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The emulator's evaluation and file against closed forms. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "api/predictor_doc.h"

#define INPUTS                                                                                     \
    "\"inputs\":{\"R1\":{\"min\":5,\"max\":9,\"log\":false},\"R2\":{\"min\":15,\"max\":60,"        \
    "\"log\":true},\"eM\":{\"min\":19,\"max\":39,\"log\":false},\"eF\":{\"min\":9,\"max\":35,"     \
    "\"log\":false},\"muM\":{\"min\":1,\"max\":9,\"log\":true},\"muF\":{\"min\":2,\"max\":8,"      \
    "\"log\":false},\"F\":{\"min\":200,\"max\":400,\"log\":false}}"
#define HEAD                                                                                       \
    "{\"model\":{\"name\":\"macron2020-local\",\"version\":1},\"rows\":100,\"trial\":true,"        \
    "\"case\":{\"resolution\":\"coarse\"}," INPUTS ","
#define ZERO_SPREAD "\"spread\":[[0,0,0,0,0,0,0,0]]}"

/* eps_max = 2 - P1(R1) + 0.5 P3(muM) P2(F), band 0.1 exp(0.5 P1(R1)); a volume's root is P1(R1). */
static const char good[] =
    HEAD "\"outputs\":[{\"name\":\"eps_max\",\"power\":1,\"reach\":0.1,\"held_out_rms\":0.01,"
         "\"mean\":[[0,0,0,0,0,0,0,2],[1,0,0,0,0,0,0,-1],[0,0,0,0,3,0,2,0.5]],"
         "\"spread\":[[1,0,0,0,0,0,0,0.5]]},"
         "{\"name\":\"volume_both_mm3\",\"power\":2,\"reach\":0.25,\"held_out_rms\":1,"
         "\"mean\":[[1,0,0,0,0,0,0,1]]," ZERO_SPREAD "]}";

static struct predictor read_good(void)
{
    struct predictor p = {0};
    struct ischia_error err = {0};
    if (predictor_doc_read(&p, good, strlen(good), &err) != ISCHIA_OK) fail_msg("%s", err.message);
    return p;
}

static struct ischia_case case_at(double R1, double muM, double F)
{
    struct ischia_case c = ischia_case_default();
    const double param[ISCHIA_PARAM_COUNT] = {R1, 30, 29, 22, muM, 5, F};
    memcpy(c.param, param, sizeof param);
    return c;
}

static void near(double a, double b)
{
    if (!(fabs(a - b) <= 1e-13)) fail_msg("%.17g is not %.17g", a, b);
}

static void sums_of_legendre_products(void **state)
{
    (void)state;
    struct predictor p = read_good();
    const struct ischia_case c = case_at(8, 3, 350); /* R1: 0.5; muM: 0 (log); F: 0.5 */
    struct predictor_point point = predictor_point_of(&p, &c);
    near(point.legendre[ISCHIA_R1][2], (3 * 0.25 - 1) / 2);
    near(point.legendre[ISCHIA_F][4], (35 * 0.0625 - 30 * 0.25 + 3) / 8);
    near(predictor_estimate_of(&p, &p.output[0], &point).value, 1.5); /* P3(0) = 0 */
    const struct ischia_case soft = case_at(5, 1, 400);               /* -1, -1, 1 */
    point = predictor_point_of(&p, &soft);
    const struct predictor_estimate e = predictor_estimate_of(&p, &p.output[0], &point);
    near(e.value, 2 + 1 - 0.5); /* P3(-1) = -1, P2(1) = 1 */
    near(e.high - e.value, 0.1 * exp(-0.5));
    near(e.value - e.low, 0.1 * exp(-0.5));
    for (int n = 0; n <= PREDICTOR_DEGREE_MAX; n++) near(point.legendre[ISCHIA_F][n], 1);
    predictor_finish(&p);
}

static void a_root_is_squared_and_never_negative(void **state)
{
    (void)state;
    struct predictor p = read_good();
    struct ischia_case c = case_at(8, 3, 300); /* the root is 0.5 */
    struct predictor_point point = predictor_point_of(&p, &c);
    struct predictor_estimate e = predictor_estimate_of(&p, &p.output[1], &point);
    near(e.value, 0.25);
    near(e.low, 0.0625);
    near(e.high, 0.5625);
    c = case_at(5, 3, 300); /* -1 */
    point = predictor_point_of(&p, &c);
    e = predictor_estimate_of(&p, &p.output[1], &point);
    near(e.value, 0);
    near(e.high, 0);
    predictor_finish(&p);
}

/* One group, F / muM, from 1 to 3; eps_max = 1 + 2 (1 + r^2/4)^-2 - ... of two centres. */
static const char kriged[] =
    HEAD "\"groups\":[{\"powers\":[0,0,0,0,-1,0,1],\"low\":0,\"high\":6}],"
         "\"centres\":[[7,30,29,22,3,5,300],[9,30,29,22,3,5,300]],"
         "\"outputs\":[{\"name\":\"eps_max\",\"power\":1,\"reach\":0.1,\"held_out_rms\":0.01,"
         "\"mean\":[[0,0,0,0,0,0,0,1]],"
         "\"kernel\":{\"lengths\":[1,9,9,9,9,9,9,0.5],\"weights\":[2,-0.5]}," ZERO_SPREAD "]}";

static void near_a_centre_its_weight_counts(void **state)
{
    (void)state;
    struct predictor p = {0};
    struct ischia_error err = {0};
    if (predictor_doc_read(&p, kriged, strlen(kriged), &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
    assert_int_equal(p.centre_count, 2);
    assert_true(p.stride == PREDICTOR_LANES && p.output[0].weight[2] == 0);
    struct ischia_case c = case_at(7, 3, 300); /* the first centre; the second is 1 away in R1 */
    struct predictor_point point = predictor_point_of(&p, &c);
    near(point.coordinate[ISCHIA_PARAM_COUNT], log(100) / 3 - 1);
    near(predictor_estimate_of(&p, &p.output[0], &point).value, 1 + 2 - 0.5 / (1.25 * 1.25));
    c = case_at(8, 3, 300); /* half way */
    point = predictor_point_of(&p, &c);
    near(predictor_estimate_of(&p, &p.output[0], &point).value, 1 + 1.5 / (1.0625 * 1.0625));
    c = case_at(7, 3, 300 * exp(0.3)); /* F is 0.1 of the group's half, 0.2 lengths, away */
    point = predictor_point_of(&p, &c);
    const double F = (300 * exp(0.3) - 300) / 100 / 9, near_one = 0.04 + F * F;
    const double one = 1 + near_one / 4, two = 1 + (1 + near_one) / 4;
    near(predictor_estimate_of(&p, &p.output[0], &point).value,
         1 + 2 / (one * one) - 0.5 / (two * two));
    predictor_finish(&p);
}

static void it_knows_where_it_was_trained(void **state)
{
    (void)state;
    struct predictor p = read_good();
    struct ischia_case c = case_at(5, 9, 200);
    assert_true(p.trial && p.rows == 100 && p.resolution == ISCHIA_COARSE);
    assert_true(predictor_covers(&p, &c, ISCHIA_R1) && predictor_covers(&p, &c, ISCHIA_MUM));
    c = case_at(4.999, 9.001, 200);
    assert_false(predictor_covers(&p, &c, ISCHIA_R1) || predictor_covers(&p, &c, ISCHIA_MUM));
    assert_true(predictor_same_options(&p, &c));
    c.option[ISCHIA_FRICTION] = 0.3;
    assert_false(predictor_same_options(&p, &c));
    predictor_finish(&p);
}

static void refuse(const char *json, const char *words)
{
    struct predictor p = {.rows = 7};
    struct ischia_error err = {0};
    assert_int_equal(predictor_doc_read(&p, json, strlen(json), &err), ISCHIA_E_INPUT);
    if (strstr(err.message, words) == NULL) fail_msg("no '%s' in '%s'", words, err.message);
    assert_int_equal(p.rows, 7);
}

#define OUTPUT(mean)                                                                               \
    HEAD "\"outputs\":[{\"name\":\"eps_max\",\"power\":1,\"reach\":1,\"held_out_rms\":1,"          \
         "\"mean\":" mean "," ZERO_SPREAD "]}"

static void what_is_wrong_is_named(void **state)
{
    (void)state;
    refuse("{", "line 1");
    refuse("{}", "name is missing");
    refuse("{\"model\":{\"name\":\"macron2020-local\",\"version\":2}}", "version 2");
    refuse("{\"model\":{\"name\":\"macron2020-local\",\"version\":1}}", "rows is missing");
    refuse(HEAD "\"outputs\":[]}", "out of bounds");
    refuse(HEAD "\"outputs\":[{\"name\":\"eps\"}]}", "not a response");
    refuse(HEAD "\"centres\":[[1,2]],\"outputs\":[]}", "centre 1");
    refuse(HEAD "\"groups\":[{\"powers\":[1]}],\"outputs\":[]}", "group 1");
    refuse(HEAD "\"centres\":[[0,30,29,22,3,5,300]],\"groups\":[{\"powers\":[1,0,0,0,0,0,0],"
                "\"low\":0,\"high\":1}],\"outputs\":[{\"name\":\"eps_max\",\"power\":1,\"reach\":1,"
                "\"held_out_rms\":1,\"mean\":[[0,0,0,0,0,0,0,1]]," ZERO_SPREAD "]}",
           "out of bounds");
    refuse(HEAD "\"outputs\":[{\"name\":\"eps_max\",\"power\":1,\"reach\":1,\"held_out_rms\":1,"
                "\"mean\":[[0,0,0,0,0,0,0,1]],\"kernel\":{\"lengths\":[1,1]}," ZERO_SPREAD "]}",
           "lengths");
    refuse(OUTPUT("[]"), "0 terms");
    refuse(OUTPUT("[[0,0,0,0,0,0,2]]"), "term 1");
    refuse(OUTPUT("[[0,0,0,0,0,0,13,2]]"), "term 1");
    refuse(OUTPUT("[[0,0,0,0,0,0,-1,2]]"), "term 1");
    refuse(OUTPUT("[[0,0,0,0,0,0,0.5,2]]"), "term 1");
    refuse(OUTPUT("[[0,0,0,0,0,0,0,\"2\"]]"), "term 1");
}

static void the_first_line_names_the_digest(void **state)
{
    (void)state;
    char text[256], digest[PREDICTOR_DIGEST_DIGITS + 1];
    const char *json = NULL;
    (void)snprintf(text, sizeof text, "ischia emulator 2 sha256 %064d\n{}", 7);
    assert_int_equal(predictor_doc_split(text, strlen(text), digest, &json, NULL), ISCHIA_OK);
    assert_string_equal(json, "{}");
    assert_int_equal(digest[63], '7');
    static const char *const bad[] = {"", "{}", "ischia emulator 2 sha256 0\n{}",
                                      "ischia emulator 3 sha256 "};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_int_equal(predictor_doc_split(bad[i], strlen(bad[i]), digest, &json, NULL),
                         ISCHIA_E_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sums_of_legendre_products),
        cmocka_unit_test(a_root_is_squared_and_never_negative),
        cmocka_unit_test(near_a_centre_its_weight_counts),
        cmocka_unit_test(it_knows_where_it_was_trained),
        cmocka_unit_test(what_is_wrong_is_named),
        cmocka_unit_test(the_first_line_names_the_digest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
