/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solver/strain.h"
#include "tests/unit/box_mesh.h"

static const struct box layered_box = {{2, 2, 4}, {4, 4, 8}, 1, 1};

static struct strain_field field_of(const struct mesh *mesh, const double *u)
{
    struct strain_field field;
    struct ischia_error err;
    assert_int_equal(strain_field_init(&field, mesh, u, &err), ISCHIA_OK);
    return field;
}

static void closed_forms_of_the_measures(void **state)
{
    (void)state;
    const double stretch[3] = {2, 1, 0.5};
    const struct strain_measures s = strain_measures_of(stretch);
    assert_true(s.green_lagrange_shear == 0.5 * (1.5 - -0.375));
    assert_true(s.green_lagrange_compression == 0.375);
    assert_true(s.engineering_shear == 0.75);
    assert_true(green_lagrange(1) == 0);
}

static void compression_is_bounded_and_never_negative(void **state)
{
    (void)state;
    const double crushed[3] = {30, 30, 0}, pulled[3] = {3, 2, 1.5}, rest[3] = {1, 1, 1};
    assert_true(strain_measures_of(crushed).green_lagrange_compression == 0.5);
    assert_true(strain_measures_of(pulled).green_lagrange_compression == 0);
    const struct strain_measures s = strain_measures_of(rest);
    assert_true(s.green_lagrange_shear == 0 && s.engineering_shear == 0 &&
                s.green_lagrange_compression == 0);
}

static void uniaxial_incompressible_thresholds_nearly_coincide(void **state)
{
    (void)state;
    /* E_shear = 0.75 at stretch 0.322, where E_3 is -0.448 (by hand: 1/l - l^2 = 3). */
    const double l = 0.3222, side = 1 / sqrt(l), stretch[3] = {side, side, l};
    const struct strain_measures s = strain_measures_of(stretch);
    assert_true(fabs(s.green_lagrange_shear - 0.75) < 1e-3);
    assert_true(fabs(s.green_lagrange_compression - 0.448) < 1e-3);
}

static void homogeneous_deformation_on_a_distorted_mesh(void **state)
{
    (void)state;
    double A[3][3] = {{1.5, 0, 0}, {0, 1.25, 0}, {0, 0, 0.4}};
    struct mesh mesh = box_mesh(&layered_box);
    box_distort(&mesh, 0.01);
    double *u = box_displacement(&mesh, A);
    struct strain_field field = field_of(&mesh, u);
    assert_int_equal(field.cell_count, 8 * mesh.element_count);
    for (int i = 0; i < field.cell_count; i++) {
        const struct strain_measures *s = &field.cell[i].strain;
        assert_true(fabs(s->green_lagrange_shear - 0.25 * (2.25 - 0.16)) < 1e-12);
        assert_true(fabs(s->green_lagrange_compression - 0.42) < 1e-12);
        assert_true(fabs(s->engineering_shear - 0.55) < 1e-12);
    }
    strain_field_finish(&field);
    free(u);
    box_mesh_free(&mesh);
}

/* A smooth inhomogeneous displacement. */
static double *bent(const struct mesh *mesh)
{
    double *u = box_alloc((size_t)mesh->node_count * 3, sizeof *u);
    for (int n = 0; n < mesh->node_count; n++) {
        const double *X = mesh->X_mm[n];
        u[3 * n] = 0.03 * X[0] * X[2];
        u[3 * n + 1] = 0.02 * X[1] * X[0];
        u[3 * n + 2] = -0.05 * X[2] * X[2] + 0.01 * X[0] * X[1];
    }
    return u;
}

static void assert_same_strains(const struct strain_field *a, const struct strain_field *b)
{
    assert_int_equal(a->cell_count, b->cell_count);
    for (int i = 0; i < a->cell_count; i++) {
        const struct strain_measures *s = &a->cell[i].strain, *t = &b->cell[i].strain;
        assert_true(fabs(s->green_lagrange_shear - t->green_lagrange_shear) < 1e-12);
        assert_true(fabs(s->green_lagrange_compression - t->green_lagrange_compression) < 1e-12);
        assert_true(fabs(s->engineering_shear - t->engineering_shear) < 1e-12);
    }
}

/* The displacement that brings the deformed body x = X + u to Q x + 7. */
static double *moved_rigidly(const struct mesh *mesh, const double *u, double Q[3][3])
{
    double *moved = box_alloc((size_t)mesh->node_count * 3, sizeof *moved);
    for (int n = 0; n < mesh->node_count; n++) {
        for (int i = 0; i < 3; i++) {
            moved[3 * n + i] = 7 - mesh->X_mm[n][i];
            for (int j = 0; j < 3; j++)
                moved[3 * n + i] += Q[i][j] * (mesh->X_mm[n][j] + u[3 * n + j]);
        }
    }
    return moved;
}

static void a_rigid_motion_or_a_reflection_leaves_strain_unchanged(void **state)
{
    (void)state;
    double Q[2][3][3] = {
        {{0.36, 0.48, -0.8}, {-0.8, 0.6, 0}, {0.48, 0.64, 0.6}}, /* a rotation   */
        {{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}},                      /* a reflection */
    };
    struct mesh mesh = box_mesh(&layered_box);
    double *u = bent(&mesh);
    struct strain_field field = field_of(&mesh, u);
    for (int k = 0; k < 2; k++) {
        double *moved = moved_rigidly(&mesh, u, Q[k]);
        struct strain_field moved_field = field_of(&mesh, moved);
        assert_same_strains(&field, &moved_field);
        strain_field_finish(&moved_field);
        free(moved);
    }
    strain_field_finish(&field);
    free(u);
    box_mesh_free(&mesh);
}

static void maxima_and_volume_are_of_the_muscle_only(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&layered_box);
    double *u = box_alloc((size_t)mesh.node_count * 3, sizeof *u);
    /* The skin's lowest nodes alone are pushed in: muscle stays at rest. */
    for (int n = 0; n < mesh.node_count; n++)
        if (mesh.node_flags[n] & NODE_ON_SEAT) u[3 * n + 2] = 1;
    struct strain_field field = field_of(&mesh, u);
    const struct strain_maxima none = strain_muscle_maxima(&mesh, u);
    assert_true(none.green_lagrange_shear == 0 && none.green_lagrange_compression == 0);
    assert_true(field.cell[field.cell_count - 1].strain.engineering_shear > 0.2);
    assert_true(fabs(strain_muscle_volume_mm3(&mesh, &field) - 4 * 4 * 4) < 1e-12);
    strain_field_finish(&field);
    free(u);
    box_mesh_free(&mesh);
}

static void assert_maxima_of_the_field(const struct mesh *mesh, const double *u)
{
    struct strain_field field = field_of(mesh, u);
    double shear = 0, compression = 0;
    for (int i = 0; i < mesh->muscle_count * 8; i++) {
        shear = fmax(shear, field.cell[i].strain.green_lagrange_shear);
        compression = fmax(compression, field.cell[i].strain.green_lagrange_compression);
    }
    const struct strain_maxima most = strain_muscle_maxima(mesh, u);
    assert_true(most.green_lagrange_shear == shear);
    assert_true(most.green_lagrange_compression == compression);
    strain_field_finish(&field);
}

/* Points are left out by a bound; of uniform strains, and of strains that differ in their last
 * digits alone, the bound must not leave out the largest. */
static void maxima_are_those_of_the_field_to_the_bit(void **state)
{
    (void)state;
    static const double scatter[] = {0, 1e-15, 1e-12, 1e-6, 0.05, 0.3};
    double A[3][3][3] = {{{1.5, 0, 0}, {0, 1.25, 0}, {0, 0, 0.4}},
                         {{1, 0.7, 0}, {0, 1, 0}, {0, 0, 1}},
                         {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    struct mesh mesh = box_mesh(&layered_box);
    unsigned random = 1;
    for (size_t k = 0; k < 3 * sizeof scatter / sizeof scatter[0]; k++) {
        double *u = box_displacement(&mesh, A[k % 3]);
        for (int i = 0; i < 3 * mesh.node_count; i++) {
            random = random * 1664525U + 1013904223U;
            u[i] += scatter[k / 3] * (random / 4294967296.0 - 0.5);
        }
        assert_maxima_of_the_field(&mesh, u);
        free(u);
    }
    double *u = bent(&mesh);
    assert_maxima_of_the_field(&mesh, u);
    free(u);
    box_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closed_forms_of_the_measures),
        cmocka_unit_test(compression_is_bounded_and_never_negative),
        cmocka_unit_test(uniaxial_incompressible_thresholds_nearly_coincide),
        cmocka_unit_test(homogeneous_deformation_on_a_distorted_mesh),
        cmocka_unit_test(a_rigid_motion_or_a_reflection_leaves_strain_unchanged),
        cmocka_unit_test(maxima_and_volume_are_of_the_muscle_only),
        cmocka_unit_test(maxima_are_those_of_the_field_to_the_bit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
