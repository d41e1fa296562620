/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/guide.h"
#include "tests/unit/near.h"

/* A cubic load curve, which the guide must carry exactly. */
static double force_at(double d) { return 1 + d * (2 + d * (3 + d * 0.5)); }
static double slope_at(double d) { return 2 + d * (6 + d * 1.5); }
static double work_at(double d) { return d * (1 + d * (1 + d * (1 + d * 0.125))); }

/* A coarse local model on its seat, to record states of. */
struct model {
    struct mesh mesh;
    struct body body;
    struct seat seat;
    double (*u_mm)[3];
};

static void model_init(struct model *m)
{
    static const double row_1R[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8, 5, 196};
    const struct element_material soft = {0.008, 16, 0.0024, 0.0008};
    const struct element_material material[TISSUE_COUNT] = {soft, soft, soft};
    struct ischia_case c = ischia_case_default();
    struct ischia_error err;
    memcpy(c.param, row_1R, sizeof row_1R);
    *m = (struct model){0};
    if (mesh_local_init(&m->mesh, &c, &mesh_divisions[ISCHIA_COARSE], &err) != ISCHIA_OK ||
        body_init(&m->body, &m->mesh, material, &err) != ISCHIA_OK ||
        seat_init(&m->seat, &m->mesh, 0.4, &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
    m->u_mm = calloc((size_t)m->mesh.node_count, sizeof *m->u_mm);
    assert_non_null(m->u_mm);
}

static void model_finish(struct model *m)
{
    free(m->u_mm);
    seat_finish(&m->seat);
    body_finish(&m->body);
    mesh_finish(&m->mesh);
}

/* A state at d: u = -d, 2 d, 3 d everywhere, pressures d, contact forces 5 d times the springs. */
static void record(struct guide *guide, struct model *m, double d)
{
    const struct guide_point numbers = {
        .d_mm = d, .force_N = force_at(d), .stiffness_N_mm = slope_at(d), .work_Nmm = work_at(d)};
    for (int n = 0; n < m->mesh.node_count; n++) {
        memcpy(m->u_mm[n], (double[3]){-d, 2 * d, 3 * d}, sizeof m->u_mm[n]);
        m->seat.normal_N[n] = 5 * d * m->seat.stick_stiffness_N_mm[n];
    }
    for (int e = 0; e < m->mesh.element_count; e++) m->body.pressure_MPa[e] = d;
    assert_int_equal(
        guide_record(guide, &numbers, &m->body, &m->seat, (const double(*)[3])m->u_mm, NULL),
        ISCHIA_OK);
}

static void a_cubic_load_curve_is_carried_exactly(void **state)
{
    (void)state;
    static const double points[] = {0.5, 1, 3};
    struct guide guide = {.stride = 1};
    struct model m;
    model_init(&m);
    for (int k = 0; k < 3; k++) record(&guide, &m, points[k]);
    for (double d = 0.5; d <= 3; d += 0.0625) {
        const struct guide_load load = guide_load_at(&guide, d);
        assert_near(load.force_N / force_at(d), 1, 1e-13);
        assert_near(load.stiffness_N_mm / slope_at(d), 1, 1e-12);
        assert_near(load.work_Nmm / work_at(d), 1, 1e-13);
    }
    const struct guide_load beyond = guide_load_at(&guide, 3.5);
    assert_near(beyond.force_N, force_at(3) + 0.5 * slope_at(3), 1e-12);
    assert_near(beyond.work_Nmm, work_at(3) + 0.5 * force_at(3) + 0.125 * slope_at(3), 1e-12);
    assert_near(guide_load_at(&guide, 0).work_Nmm, 0, 1e-15); /* rest */
    guide_finish(&guide);
    model_finish(&m);
}

/* The guide's own work may know more than the cubic: over a step it counts in full. */
static void work_of_a_step_is_the_guides(void **state)
{
    (void)state;
    struct guide guide = {.stride = 1};
    struct model m;
    model_init(&m);
    record(&guide, &m, 1);
    record(&guide, &m, 2);
    guide.point[1].work_Nmm += 7;
    const double step = guide_load_at(&guide, 2).work_Nmm - guide_load_at(&guide, 1).work_Nmm;
    assert_near(step, work_at(2) - work_at(1) + 7, 1e-12);
    guide_finish(&guide);
    model_finish(&m);
}

static void without_a_guide_there_is_no_load_and_no_way(void **state)
{
    (void)state;
    struct guide none = {0};
    struct guide_cursor cursor;
    assert_true(guide_load_at(NULL, 3).force_N == 0 && guide_load_at(&none, 3).work_Nmm == 0);
    for (int k = 0; k < 2; k++) {
        assert_int_equal(guide_cursor_init(&cursor, k == 0 ? NULL : &none, 10, NULL), ISCHIA_OK);
        assert_true(guide_next_mm(&cursor) == HUGE_VAL);
        guide_cursor_finish(&cursor);
    }
    guide_finish(&none);
}

/* Points 1 ... 6 by a stride of 3: the 1st, the 4th, and the last, which bears the whole force. */
static void a_cursor_strides_and_ends_at_the_last(void **state)
{
    (void)state;
    static const double stops[] = {1, 4, 6};
    struct guide guide = {.stride = 3, .complete = true};
    struct guide_cursor cursor;
    struct model m;
    model_init(&m);
    for (int k = 1; k <= 6; k++) record(&guide, &m, k);
    assert_int_equal(guide_cursor_init(&cursor, &guide, m.mesh.node_count, NULL), ISCHIA_OK);
    for (int s = 0; s < 3; s++) {
        const double before = s == 0 ? 0 : stops[s - 1];
        assert_true(guide_next_mm(&cursor) == stops[s]);
        assert_true(guide_is_last(&cursor) == (s == 2));
        guide_look_ahead(&cursor, &m.mesh);
        for (int n = 0; n < m.mesh.node_count; n++) {
            const double springs = m.seat.stick_stiffness_N_mm[n] > 0 ? 5 : 0;
            assert_near(cursor.here.u_mm[n][1], 2 * before, 1e-12);
            assert_near(cursor.ahead.u_mm[n][2], 3 * stops[s], 1e-12);
            assert_near(cursor.ahead.pressure[n][0], springs * stops[s], 1e-12);
            assert_near(cursor.ahead.pressure[n][1], stops[s], 1e-12);
        }
        guide_advance(&cursor);
    }
    assert_true(guide_next_mm(&cursor) == HUGE_VAL);
    guide_cursor_finish(&cursor);
    guide_finish(&guide);
    model_finish(&m);
}

static void an_incomplete_guide_has_no_last_point(void **state)
{
    (void)state;
    struct guide guide = {.stride = 1};
    struct guide_cursor cursor;
    struct model m;
    model_init(&m);
    record(&guide, &m, 1);
    assert_int_equal(guide_cursor_init(&cursor, &guide, m.mesh.node_count, NULL), ISCHIA_OK);
    assert_false(guide_is_last(&cursor));
    guide_cursor_finish(&cursor);
    guide_finish(&guide);
    model_finish(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cubic_load_curve_is_carried_exactly),
        cmocka_unit_test(work_of_a_step_is_the_guides),
        cmocka_unit_test(without_a_guide_there_is_no_load_and_no_way),
        cmocka_unit_test(a_cursor_strides_and_ends_at_the_last),
        cmocka_unit_test(an_incomplete_guide_has_no_last_point),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
