/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Uncertainty through emulators whose answers are known in closed form, and its document. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "api/predictor_doc.h"
#include "api/uncertainty_doc.h"
#include "solver/study/sampling.h"

#define IN(key, min, max) "\"" key "\":{\"min\":" #min ",\"max\":" #max ",\"log\":false}"
#define HEAD                                                                                       \
    "{\"model\":{\"name\":\"macron2020-local\",\"version\":1},\"rows\":100,\"trial\":true,"        \
    "\"case\":{\"resolution\":\"coarse\"},\"inputs\":{" IN("R1", 3, 15) "," IN(                    \
        "R2", 8, 120) "," IN("eM", 19,                                                             \
                             39) "," IN("eF", 9,                                                   \
                                        35) "," IN("muM", 0.5,                                     \
                                                   30) "," IN("muF", 2,                            \
                                                              8) "," IN("F", 100,                  \
                                                                        500) "},\"outputs\":["
#define OUT(name, power, mean, reach)                                                              \
    "{\"name\":\"" name "\",\"power\":" #power ",\"reach\":" #reach ",\"held_out_rms\":0.1,"       \
    "\"mean\":" mean ",\"spread\":[[0,0,0,0,0,0,0,0]]}"

/* eps_max = 1 - 0.1 (R1 - 9) + 0.02 (muM - 15.25); E_shear = 0.75 + (eM - 29) / 10; a force. */
#define LINEAR                                                                                     \
    HEAD OUT("eps_max", 1, "[[0,0,0,0,0,0,0,1],[1,0,0,0,0,0,0,-0.6],[0,0,0,0,1,0,0,0.295]]",       \
             0) "," OUT("E_shear_max", 1, "[[0,0,0,0,0,0,0,0.75],[0,0,1,0,0,0,0,1]]",              \
                        0) "," OUT("force_shear_N", 1, "[[0,0,0,0,0,0,0,250]]", 0) "]}"

static struct predictor read_predictor(const char *json)
{
    struct predictor p = {0};
    struct ischia_error err = {0};
    if (predictor_doc_read(&p, json, strlen(json), &err) != ISCHIA_OK) fail_msg("%s", err.message);
    return p;
}

static struct ischia_case centre(void)
{
    struct ischia_case c = ischia_case_default();
    const double param[ISCHIA_PARAM_COUNT] = {9, 60, 29, 22, 15.25, 5, 300};
    memcpy(c.param, param, sizeof param);
    return c;
}

/* A solve that says what the linear emulator says at the centre, moved by `more` in eps_max. */
static struct ischia_result solve(double more)
{
    struct ischia_result r = {.numerics = {.reason = ISCHIA_CONVERGED}};
    r.strain.eps_max = 1 + more;
    r.strain.E_shear_max = 0.75;
    r.threshold_force_shear_N = 250;
    r.threshold_force_compression_N = (double)NAN;
    return r;
}

static struct ischia_uncertainty compute(const struct predictor *p, const struct ischia_case *c,
                                         const double *sd, double more, uint64_t seed)
{
    struct ischia_uncertainty u;
    struct ischia_error err = {0};
    const struct ischia_result r = solve(more);
    if (uncertainty_compute(&u, p, c, sd, &r, seed, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    assert_true(uncertainty_is_valid(&u));
    return u;
}

static void near(double a, double b, double tolerance)
{
    if (!(fabs(a - b) <= tolerance)) fail_msg("%.9g is not %.9g within %g", a, b, tolerance);
}

static void a_linear_model_has_known_quantiles_and_indices(void **state)
{
    (void)state;
    struct predictor p = read_predictor(LINEAR);
    const struct ischia_case c = centre();
    const double sd[ISCHIA_PARAM_COUNT] = {[ISCHIA_R1] = 0.5, [ISCHIA_MUM] = 2, [ISCHIA_EF] = 1};
    const struct ischia_uncertainty u = compute(&p, &c, sd, 0, 1);
    const double a = 0.1 * 0.5, b = 0.02 * 2, all = a * a + b * b, s = sqrt(all);
    assert_int_equal(u.status, UNCERTAINTY_GIVEN);
    assert_int_equal(u.inside, u.samples);
    const double z[UNCERTAINTY_QUANTILES] = {-1.6449, -0.6745, 0, 0.6745, 1.6449};
    for (int k = 0; k < UNCERTAINTY_QUANTILES; k++)
        near(u.quantile[UNCERTAIN_EPS_MAX][k], 1 + z[k] * s, 0.02 * s);
    near(u.first_order[ISCHIA_R1], a * a / all, 0.02);
    near(u.total[ISCHIA_R1], a * a / all, 0.02);
    near(u.first_order[ISCHIA_MUM], b * b / all, 0.02);
    near(u.total[ISCHIA_MUM], b * b / all, 0.02);
    assert_true(u.total[ISCHIA_EF] < 1e-12 && u.total[ISCHIA_F] == 0);
    near(u.quantile[UNCERTAIN_FORCE_SHEAR][0], 250, 1e-9);
    assert_true(isnan(u.quantile[UNCERTAIN_VOLUME_BOTH][0])); /* not in the emulator */
    near(u.emulator_sd, 0, 0);
    predictor_finish(&p);
}

static void an_sd_of_zero_gives_the_point(void **state)
{
    (void)state;
    struct predictor p = read_predictor(HEAD OUT("eps_max", 1, "[[0,0,0,0,0,0,0,1]]", 0.3) "," OUT(
        "volume_shear_mm3", 2, "[[0,0,0,0,0,0,0,9]]", 3) "," OUT("force_shear_N", 1,
                                                                 "[[0,0,0,0,0,0,0,90]]", 9) "]}");
    const struct ischia_case c = centre();
    const double sd[ISCHIA_PARAM_COUNT] = {0};
    const struct ischia_uncertainty u = compute(&p, &c, sd, 0.25, 1);
    for (int k = 0; k < UNCERTAINTY_QUANTILES; k++) {
        near(u.quantile[UNCERTAIN_EPS_MAX][k], 1.25, 1e-15);
        near(u.quantile[UNCERTAIN_VOLUME_SHEAR][k], 0, 0); /* of the solve, not the emulator's 81 */
        near(u.quantile[UNCERTAIN_FORCE_SHEAR][k], 250, 1e-12);
    }
    near(u.emulator_sd, 0, 0);
    assert_true(isnan(u.total[ISCHIA_R1]));
    assert_int_equal(u.check_count, 0);
    predictor_finish(&p);
}

static void the_emulators_error_is_in_it_away_from_the_solve(void **state)
{
    (void)state;
    struct predictor p = read_predictor(HEAD OUT("eps_max", 1, "[[0,0,0,0,0,0,0,1]]", 0.196) "]}");
    const struct ischia_case c = centre();
    double sd[ISCHIA_PARAM_COUNT] = {[ISCHIA_R1] = 1e-6, [ISCHIA_R2] = 1e-6};
    struct ischia_uncertainty u = compute(&p, &c, sd, 0, 1);
    near(u.quantile[UNCERTAIN_EPS_MAX][4], 1, 1e-6);
    /* eF half the box and eM too: most samples are far off, their spread is the emulator's 0.1 */
    sd[ISCHIA_EM] = sd[ISCHIA_EF] = 5;
    sd[ISCHIA_MUM] = 20;
    u = compute(&p, &c, sd, 0, 1);
    const double s = (u.quantile[UNCERTAIN_EPS_MAX][4] - u.quantile[UNCERTAIN_EPS_MAX][0]) / 3.29;
    near(s, u.emulator_sd, 0.01);
    assert_true(u.emulator_sd > 0.08 && u.emulator_sd < 0.1);
    predictor_finish(&p);
}

static void the_solve_moves_what_is_near_it(void **state)
{
    (void)state;
    struct predictor p = read_predictor(LINEAR);
    const struct ischia_case c = centre();
    const double sd[ISCHIA_PARAM_COUNT] = {[ISCHIA_R1] = 0.1};
    const struct ischia_uncertainty u = compute(&p, &c, sd, 0.2, 1);
    near(u.quantile[UNCERTAIN_EPS_MAX][2], 1.2, 1e-3);
    for (int k = 0; k < u.check_count; k++) {
        const struct uncertainty_check *check = &u.check[k];
        near(check->estimate, 1.2 - 0.1 * (check->param[ISCHIA_R1] - 9), 2e-3);
        assert_true(isnan(check->eps_max));
    }
    assert_int_equal(u.check_count, UNCERTAINTY_CHECKS);
    predictor_finish(&p);
}

static void shares_and_forces_know_the_thresholds(void **state)
{
    (void)state;
    struct predictor p = read_predictor(LINEAR);
    struct ischia_case c = centre();
    const double sd[ISCHIA_PARAM_COUNT] = {[ISCHIA_EM] = 1, [ISCHIA_F] = 20};
    c.param[ISCHIA_F] = 250; /* half of the samples carry less than the crossing force */
    const struct ischia_uncertainty u = compute(&p, &c, sd, 0, 1);
    near(u.share_shear, 0.5, 0.01);
    assert_true(isnan(u.share_compression) && isnan(u.share_both)); /* not in this emulator */
    near(u.quantile[UNCERTAIN_FORCE_SHEAR][1], 250, 1e-9);
    assert_true(isnan(u.quantile[UNCERTAIN_FORCE_SHEAR][3])); /* not reached */
    predictor_finish(&p);
}

static void the_seed_settles_everything(void **state)
{
    (void)state;
    struct predictor p = read_predictor(LINEAR);
    const struct ischia_case c = centre();
    const double sd[ISCHIA_PARAM_COUNT] = {[ISCHIA_R1] = 1, [ISCHIA_R2] = 20, [ISCHIA_F] = 10};
    const struct ischia_uncertainty a = compute(&p, &c, sd, 0, 1), b = compute(&p, &c, sd, 0, 1),
                                    d = compute(&p, &c, sd, 0, 2);
    assert_memory_equal(a.quantile, b.quantile, sizeof a.quantile);
    assert_memory_equal(a.total, b.total, sizeof a.total);
    assert_memory_equal(a.check, b.check, sizeof a.check);
    assert_true(a.quantile[UNCERTAIN_EPS_MAX][0] != d.quantile[UNCERTAIN_EPS_MAX][0]);
    near(a.quantile[UNCERTAIN_EPS_MAX][0], d.quantile[UNCERTAIN_EPS_MAX][0], 0.005);
    predictor_finish(&p);
}

static void beyond_the_training_there_is_none(void **state)
{
    (void)state;
    struct predictor p = read_predictor(LINEAR);
    struct ischia_case c = centre();
    double sd[ISCHIA_PARAM_COUNT] = {[ISCHIA_EM] = 1};
    c.param[ISCHIA_EM] = 38.5; /* the box ends at 39: three in ten are outside */
    struct ischia_uncertainty u = compute(&p, &c, sd, 0, 1);
    assert_int_equal(u.status, UNCERTAINTY_OUTSIDE);
    near(u.outside[ISCHIA_EM], 0.3085, 0.01);
    assert_true(isnan(u.quantile[UNCERTAIN_EPS_MAX][2]) && isnan(u.share_shear));
    c.param[ISCHIA_EM] = 37.5; /* one in fifteen: given, and said */
    u = compute(&p, &c, sd, 0, 1);
    assert_int_equal(u.status, UNCERTAINTY_GIVEN);
    near(u.outside[ISCHIA_EM], 0.0668, 0.01);
    near(u.inside, u.samples * (1 - u.outside[ISCHIA_EM]), 0.5);
    c.param[ISCHIA_EM] = 45; /* itself outside: no sample, but said which input */
    u = compute(&p, &c, sd, 0, 1);
    assert_int_equal(u.status, UNCERTAINTY_OUTSIDE);
    assert_int_equal(u.samples, 0);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        assert_true(u.outside[i] == (i == ISCHIA_EM ? 1 : 0));
    c = centre();
    c.option[ISCHIA_FRICTION] = 0.3;
    assert_int_equal(compute(&p, &c, sd, 0, 1).status, UNCERTAINTY_OTHER_MODEL);
    assert_int_equal(compute(NULL, &c, sd, 0, 1).status, UNCERTAINTY_NO_EMULATOR);
    predictor_finish(&p);
}

/* ---- its document ---- */

static char *write_document(const struct ischia_uncertainty *u)
{
    struct json_out out;
    char *text = NULL;
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    uncertainty_doc_put(&out, u);
    json_close_object(&out);
    assert_int_equal(json_out_take(&out, &text, NULL, NULL), ISCHIA_OK);
    return text;
}

static void the_document_reads_back_bit_for_bit(void **state)
{
    (void)state;
    struct predictor p = read_predictor(LINEAR);
    const struct ischia_case c = centre();
    const double sd[ISCHIA_PARAM_COUNT] = {[ISCHIA_R1] = 1, [ISCHIA_MUM] = 3};
    struct ischia_uncertainty u = compute(&p, &c, sd, 0, 1), back;
    struct ischia_error err = {0};
    bool present = false;
    u.check[1].eps_max = 1.5;
    char *text = write_document(&u);
    if (uncertainty_doc_read(&back, &present, text, strlen(text), &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
    assert_true(present);
    char *again = write_document(&back);
    assert_string_equal(text, again);
    assert_true(back.check[1].eps_max == 1.5 && isnan(back.check[0].eps_max));
    free(text);
    free(again);
    assert_int_equal(uncertainty_doc_read(&back, &present, "{}", 2, &err), ISCHIA_OK);
    assert_false(present);
    predictor_finish(&p);
}

static void a_broken_document_is_refused(void **state)
{
    static const char *const bad[] = {"{\"uncertainty\":{}}", "{\"uncertainty\":[]}",
                                      "{\"uncertainty\":{\"status\":\"given\"}}"};
    struct ischia_uncertainty u = {.samples = 7};
    struct ischia_error err = {0};
    bool present;
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_int_equal(uncertainty_doc_read(&u, &present, bad[i], strlen(bad[i]), &err),
                         ISCHIA_E_INPUT);
        assert_int_equal(u.samples, 7);
    }
}

static void what_to_measure_better_comes_first(void **state)
{
    struct ischia_uncertainty u = {
        .total = {0.02, 0.6, 0.049, 0.05, 0.3, 0, 0.01},
    };
    enum ischia_param order[ISCHIA_PARAM_COUNT];
    (void)state;
    assert_int_equal(uncertainty_order(&u, order), 3);
    assert_int_equal(order[0], ISCHIA_R2);
    assert_int_equal(order[1], ISCHIA_MUM);
    assert_int_equal(order[2], ISCHIA_EF);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) u.total[i] = (double)NAN;
    assert_int_equal(uncertainty_order(&u, order), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_linear_model_has_known_quantiles_and_indices),
        cmocka_unit_test(an_sd_of_zero_gives_the_point),
        cmocka_unit_test(the_emulators_error_is_in_it_away_from_the_solve),
        cmocka_unit_test(the_solve_moves_what_is_near_it),
        cmocka_unit_test(shares_and_forces_know_the_thresholds),
        cmocka_unit_test(the_seed_settles_everything),
        cmocka_unit_test(beyond_the_training_there_is_none),
        cmocka_unit_test(the_document_reads_back_bit_for_bit),
        cmocka_unit_test(a_broken_document_is_refused),
        cmocka_unit_test(what_to_measure_better_comes_first),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
