/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/mesh.h"
#include "tests/unit/near.h"

static const struct mesh_divisions odd_divisions = {
    .across = 5, .around = 3, .radial = 7, .fat = 3, .skin = 2};

static struct mesh mesh_of(const struct ischia_case *c, const struct mesh_divisions *divisions)
{
    struct mesh mesh = {0};
    struct ischia_error err;
    assert_true(ischia_case_is_valid(c));
    if (mesh_local_init(&mesh, c, divisions, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    return mesh;
}

/* Row 1R of Table 2. */
static struct ischia_case usual_case(void)
{
    static const double param[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8, 5, 196};
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, param, sizeof param);
    return c;
}

/* Corner `bits` of the box of ranges: bit i set takes the upper end of parameter i. */
static struct ischia_case corner_case(unsigned bits, bool accepted)
{
    struct ischia_case c = ischia_case_default();
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct ischia_param_info *p = &ischia_params[i];
        const bool upper = bits >> i & 1;
        if (accepted)
            c.param[i] = upper ? p->accepted_max : p->accepted_min;
        else
            c.param[i] = upper ? p->studied_max : p->studied_min;
    }
    c.param[ISCHIA_R2] = fmax(c.param[ISCHIA_R2], c.param[ISCHIA_R1]);
    return c;
}

static void check_valid(const struct ischia_case *c, const struct mesh_divisions *divisions)
{
    struct mesh mesh = mesh_of(c, divisions);
    if (!mesh_is_valid(&mesh))
        fail_msg("mesh of R1 %g, R2 %g, eM %g, eF %g, skin %g, L/h %g, surface %g, embedded %g "
                 "with %d across is not valid",
                 c->param[ISCHIA_R1], c->param[ISCHIA_R2], c->param[ISCHIA_EM], c->param[ISCHIA_EF],
                 c->option[ISCHIA_SKIN_THICKNESS], c->option[ISCHIA_L_OVER_H],
                 c->option[ISCHIA_R2_SURFACE], c->option[ISCHIA_EMBED_OVER_R1], divisions->across);
    mesh_finish(&mesh);
}

static void every_studied_corner_is_valid(void **state)
{
    (void)state;
    for (unsigned bits = 0; bits < 1U << ISCHIA_PARAM_COUNT; bits++) {
        const struct ischia_case c = corner_case(bits, false);
        for (int r = 0; r < ISCHIA_RESOLUTION_COUNT; r++) check_valid(&c, &mesh_divisions[r]);
        check_valid(&c, &odd_divisions);
    }
}

/* Bits above the parameters take the upper ends of the options that shape the mesh. */
static void every_accepted_corner_is_valid(void **state)
{
    (void)state;
    static const enum ischia_option shaping[] = {ISCHIA_SKIN_THICKNESS, ISCHIA_L_OVER_H,
                                                 ISCHIA_R2_SURFACE, ISCHIA_EMBED_OVER_R1};
    enum { GEOMETRIC = 4, SHAPING = 4 }; /* R1, R2, eM and eF come first */
    for (unsigned bits = 0; bits < 1U << (GEOMETRIC + SHAPING); bits++) {
        struct ischia_case c = corner_case(bits & 0xf, true);
        for (int i = 0; i < SHAPING; i++) {
            const struct ischia_option_info *o = &ischia_options[shaping[i]];
            c.option[shaping[i]] = bits >> (GEOMETRIC + i) & 1 ? o->accepted_max : o->accepted_min;
        }
        for (int r = 0; r < ISCHIA_RESOLUTION_COUNT; r++) check_valid(&c, &mesh_divisions[r]);
    }
}

static void named_extremes_are_valid(void **state)
{
    (void)state;
    static const struct {
        double R1, R2, eM, surface;
    } extremes[] = {{9, 9, 20, 0},    {15, 15, 5, 1},    {15, 15, 60, 1}, {15, 120, 5, 0},
                    {15, 120, 5, 1},  {3, 120, 5, 0},    {8, 8, 5, 1},    {3, 8, 60, 1},
                    {8, 8.001, 5, 1}, {15, 15.5, 5, 0.5}};
    for (size_t i = 0; i < sizeof extremes / sizeof extremes[0]; i++) {
        struct ischia_case c = usual_case();
        c.param[ISCHIA_R1] = extremes[i].R1;
        c.param[ISCHIA_R2] = extremes[i].R2;
        c.param[ISCHIA_EM] = extremes[i].eM;
        c.option[ISCHIA_R2_SURFACE] = extremes[i].surface;
        for (int r = 0; r < ISCHIA_RESOLUTION_COUNT; r++) check_valid(&c, &mesh_divisions[r]);
    }
}

/* One solver's pattern serves every case: nothing but positions depends on the inputs. */
static void topology_depends_on_the_divisions_alone(void **state)
{
    (void)state;
    const struct ischia_case usual = usual_case();
    struct mesh a = mesh_of(&usual, &odd_divisions);
    assert_int_equal(a.node_count, mesh_local_node_count(&odd_divisions));
    for (unsigned bits = 0; bits < 16; bits++) {
        const struct ischia_case c = corner_case(bits, true);
        struct mesh b = mesh_of(&c, &odd_divisions);
        const size_t nodes = (size_t)a.node_count, elements = (size_t)a.element_count;
        assert_int_equal(b.node_count, a.node_count);
        assert_int_equal(b.element_count, a.element_count);
        assert_int_equal(b.muscle_count, a.muscle_count);
        assert_int_equal(b.seat_quad_count, a.seat_quad_count);
        assert_int_equal(b.outer_skin_quad_count, a.outer_skin_quad_count);
        assert_int_equal(b.axis_count, a.axis_count);
        assert_memory_equal(b.hex, a.hex, elements * sizeof *a.hex);
        assert_memory_equal(b.tissue, a.tissue, elements);
        assert_memory_equal(b.node_flags, a.node_flags, nodes);
        assert_memory_equal(b.seat_quad, a.seat_quad,
                            (size_t)a.seat_quad_count * sizeof *a.seat_quad);
        assert_memory_equal(b.axis, a.axis, (size_t)a.axis_count * sizeof *a.axis);
        mesh_finish(&b);
    }
    mesh_finish(&a);
}

static void planes_and_layers_are_exact(void **state)
{
    (void)state;
    const struct ischia_case c = usual_case();
    struct mesh m = mesh_of(&c, &odd_divisions);
    const double skin = c.option[ISCHIA_SKIN_THICKNESS];
    assert_true(m.muscle_z_mm == skin + 10);
    assert_true(m.tip_z_mm == skin + 38);
    assert_near(m.top_z_mm, skin + 38 + 6.9, 1e-12);
    assert_near(m.half_width_mm, 38, 1e-12);
    int on_plane[2] = {0, 0};
    for (int n = 0; n < m.node_count; n++) {
        const double *X = m.X_mm[n];
        for (int k = 0; k < 2; k++) {
            const bool flagged = m.node_flags[n] & (k == 0 ? NODE_ON_X0 : NODE_ON_Y0);
            assert_true(flagged ? X[k] == 0 : X[k] > 1e-6);
            assert_true(X[k] <= m.half_width_mm);
            on_plane[k] += flagged;
        }
        assert_true(X[2] >= 0 && X[2] <= m.top_z_mm + 1e-12);
        if (m.node_flags[n] & NODE_ON_BONE) assert_true(X[2] >= m.tip_z_mm - 1e-9);
    }
    assert_int_equal(on_plane[0], on_plane[1]);
    /* core and rim patch over every layer of the muscle, and the core's columns below it */
    const int expected = (5 + 1 + 3) * (7 + 1) + (5 + 1) * (3 + 2);
    assert_int_equal(on_plane[0], expected);
    mesh_finish(&m);
}

/* Bone nodes lie on the torus: at a distance R1 from a circle of radius R2 in the plane y = 0. */
static void bone_nodes_lie_on_the_torus(void **state)
{
    (void)state;
    for (int surface = 0; surface <= 1; surface++) {
        struct ischia_case c = usual_case();
        c.option[ISCHIA_R2_SURFACE] = surface;
        struct mesh m = mesh_of(&c, &mesh_divisions[ISCHIA_FINE]);
        const double R1 = 6.9, R2 = 19.7 - surface * R1;
        for (int n = 0; n < m.node_count; n++) {
            if (!(m.node_flags[n] & NODE_ON_BONE)) continue;
            const double *X = m.X_mm[n];
            const double from_centre = hypot(X[0], m.tip_z_mm + R1 + R2 - X[2]);
            assert_near(hypot(from_centre - R2, X[1]), R1, 0.005);
        }
        mesh_finish(&m);
    }
}

static void face_geometry(const struct mesh *m, const int quad[4], double ret_centre[3],
                          double ret_normal[3])
{
    double a[3], b[3];
    for (int i = 0; i < 3; i++) {
        a[i] = m->X_mm[quad[2]][i] - m->X_mm[quad[0]][i];
        b[i] = m->X_mm[quad[3]][i] - m->X_mm[quad[1]][i];
        ret_centre[i] = 0;
        for (int k = 0; k < 4; k++) ret_centre[i] += m->X_mm[quad[k]][i] / 4;
    }
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        ret_normal[i] = (a[j] * b[k] - a[k] * b[j]) / 2; /* its length is the area */
    }
}

static int compare_ints(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

struct face {
    int node[4]; /* ascending */
    int corner[4];
};

static int compare_faces(const void *a, const void *b)
{
    const struct face *x = a, *y = b;
    for (int k = 0; k < 4; k++)
        if (x->node[k] != y->node[k]) return x->node[k] - y->node[k];
    return 0;
}

static struct face face_of(const int corner[4])
{
    struct face f;
    memcpy(f.node, corner, sizeof f.node);
    memcpy(f.corner, corner, sizeof f.corner);
    qsort(f.node, 4, sizeof f.node[0], compare_ints);
    return f;
}

static bool all_flagged(const struct mesh *m, const struct face *f, unsigned flag)
{
    bool all = true;
    for (int k = 0; k < 4; k++) all = all && m->node_flags[f->node[k]] & flag;
    return all;
}

static bool at_box_top(const struct mesh *m, const struct face *f)
{
    bool all = true;
    for (int k = 0; k < 4; k++) all = all && m->X_mm[f->node[k]][2] > m->top_z_mm - 1e-9;
    return all;
}

/* All faces of all elements, sorted; corners so ordered that the normal points out. */
static struct face *faces_of(const struct mesh *m, int *ret_count)
{
    static const int side[6][4] = {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4},
                                   {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
    struct face *faces = calloc((size_t)m->element_count * 6, sizeof *faces);
    assert_non_null(faces);
    for (int e = 0; e < m->element_count; e++)
        for (int s = 0; s < 6; s++) {
            int corner[4];
            for (int k = 0; k < 4; k++) corner[k] = m->hex[e][side[s][k]];
            faces[6 * e + s] = face_of(corner);
        }
    *ret_count = 6 * m->element_count;
    qsort(faces, (size_t)*ret_count, sizeof *faces, compare_faces);
    return faces;
}

static bool is_inner(const struct face *faces, int count, int at)
{
    return (at > 0 && compare_faces(&faces[at], &faces[at - 1]) == 0) ||
           (at + 1 < count && compare_faces(&faces[at], &faces[at + 1]) == 0);
}

/* The seat quads are the faces of one element only that are neither on a symmetry plane, nor on the
 * bone, nor on the box' top. */
static void seat_quads_cover_the_outside(void **state)
{
    (void)state;
    const struct ischia_case c = usual_case();
    struct mesh m = mesh_of(&c, &odd_divisions);
    int count, outside = 0;
    struct face *faces = faces_of(&m, &count);
    for (int i = 0; i < count; i++) {
        const struct face *f = &faces[i];
        if (is_inner(faces, count, i) || all_flagged(&m, f, NODE_ON_X0) ||
            all_flagged(&m, f, NODE_ON_Y0) || all_flagged(&m, f, NODE_ON_BONE) || at_box_top(&m, f))
            continue;
        assert_true(all_flagged(&m, f, NODE_ON_SEAT));
        outside++;
    }
    assert_int_equal(outside, m.seat_quad_count);
    for (int q = 0; q < m.seat_quad_count; q++) {
        const struct face key = face_of(m.seat_quad[q]);
        const struct face *f = bsearch(&key, faces, (size_t)count, sizeof *faces, compare_faces);
        assert_non_null(f);
        assert_false(is_inner(faces, count, (int)(f - faces)));
    }
    free(faces);
    mesh_finish(&m);
}

static void seat_quads_face_outward(void **state)
{
    (void)state;
    const struct ischia_case c = usual_case();
    struct mesh m = mesh_of(&c, &odd_divisions);
    const double w = m.half_width_mm;
    double area[3] = {0};
    for (int q = 0; q < m.seat_quad_count; q++) {
        double centre[3], normal[3];
        face_geometry(&m, m.seat_quad[q], centre, normal);
        const bool bottom = q < m.outer_skin_quad_count;
        const int axis = bottom ? 2 : normal[1] > normal[0];
        assert_near(centre[axis], bottom ? 0 : w, 1e-9);
        assert_true(bottom ? normal[2] < 0 : normal[axis] > 0);
        area[axis] += fabs(normal[axis]);
        for (int k = 0; k < 3; k++)
            if (k != axis) assert_near(normal[k], 0, 1e-9);
    }
    assert_near(area[2], w * w, 1e-9 * w * w);
    assert_near(area[0], w * m.top_z_mm, 1e-9 * w * w);
    assert_near(area[1], w * m.top_z_mm, 1e-9 * w * w);
    mesh_finish(&m);
}

static void axis_runs_down_from_the_tip(void **state)
{
    (void)state;
    const struct ischia_case c = usual_case();
    struct mesh m = mesh_of(&c, &odd_divisions);
    assert_int_equal(m.axis_count, odd_divisions.radial + 1);
    double above = HUGE_VAL;
    for (int l = 0; l < m.axis_count; l++) {
        const int *row = m.axis[l];
        const double *X = m.X_mm[row[0]];
        assert_true(X[0] == 0 && X[1] == 0 && X[2] < above);
        above = X[2];
        for (int k = 0; k < 2; k++) {
            const double *first = m.X_mm[row[1 + 2 * k]], *second = m.X_mm[row[2 + 2 * k]];
            assert_true(first[1 - k] == 0 && second[1 - k] == 0);
            assert_true(first[k] > 0 && second[k] > first[k]);
        }
    }
    assert_near(m.X_mm[m.axis[0][0]][2], m.tip_z_mm, 1e-12);
    assert_near(above, m.muscle_z_mm, 1e-12);
    mesh_finish(&m);
}

static void finish_takes_an_empty_mesh(void **state)
{
    (void)state;
    struct mesh m = {0};
    mesh_finish(&m);
    mesh_finish(&m);
    assert_false(mesh_is_valid(&m));
}

/* What mesh_is_valid is for: each damage is found. */
static void damage_is_found(void **state)
{
    (void)state;
    const struct ischia_case c = usual_case();
    struct mesh m = mesh_of(&c, &mesh_divisions[ISCHIA_COARSE]);
    int *hex = m.hex[m.element_count / 2];
    const int was = hex[3];
    assert_true(mesh_is_valid(&m));
    hex[3] = m.node_count;
    assert_false(mesh_is_valid(&m));
    hex[3] = -1;
    assert_false(mesh_is_valid(&m));
    hex[3] = hex[1];
    assert_false(mesh_is_valid(&m));
    hex[3] = was;
    m.tissue[0] = TISSUE_COUNT;
    assert_false(mesh_is_valid(&m));
    m.tissue[0] = TISSUE_MUSCLE;
    m.node_count--;
    assert_false(mesh_is_valid(&m)); /* the last node is used, and no longer there */
    m.node_count++;
    assert_true(mesh_is_valid(&m));
    mesh_finish(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_studied_corner_is_valid),
        cmocka_unit_test(every_accepted_corner_is_valid),
        cmocka_unit_test(named_extremes_are_valid),
        cmocka_unit_test(topology_depends_on_the_divisions_alone),
        cmocka_unit_test(planes_and_layers_are_exact),
        cmocka_unit_test(bone_nodes_lie_on_the_torus),
        cmocka_unit_test(seat_quads_cover_the_outside),
        cmocka_unit_test(seat_quads_face_outward),
        cmocka_unit_test(axis_runs_down_from_the_tip),
        cmocka_unit_test(finish_takes_an_empty_mesh),
        cmocka_unit_test(damage_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
