/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solver/kinematics.h"
#include "tests/unit/box_mesh.h"

static const struct box small_box = {{2, 3, 2}, {4, 6, 5}, 0, 0};

/* R_z(a) R_x(b), and A = R diag(stretch) Q^T for two such rotations. */
static void rotation(double a, double b, double ret_R[3][3])
{
    const double R[3][3] = {{cos(a), -sin(a) * cos(b), sin(a) * sin(b)},
                            {sin(a), cos(a) * cos(b), -cos(a) * sin(b)},
                            {0, sin(b), cos(b)}};
    memcpy(ret_R, R, sizeof R);
}

static void stretched(const double stretch[3], double a, double b, double ret_A[3][3])
{
    double R[3][3], Q[3][3];
    rotation(a, b, R);
    rotation(b + 1, a - 2, Q);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            ret_A[i][j] = 0;
            for (int k = 0; k < 3; k++) ret_A[i][j] += R[i][k] * stretch[k] * Q[j][k];
        }
    }
}

static void stretches_are_recovered_from_their_product_with_rotations(void **state)
{
    (void)state;
    static const double stretch[][3] = {{1, 1, 1}, {2, 1, 0.5}, {5, 5, 0.04}, {3, 1e-7, 1e-7}};
    for (size_t s = 0; s < sizeof stretch / sizeof stretch[0]; s++) {
        for (int k = 0; k < 20; k++) {
            double A[3][3], found[3];
            stretched(stretch[s], 0.3 * k, 1.7 - 0.2 * k, A);
            principal_stretches(A, found);
            for (int i = 0; i < 3; i++)
                assert_true(fabs(found[i] - stretch[s][i]) <= 1e-14 * stretch[s][0]);
        }
    }
}

static void small_stretches_keep_their_digits(void **state)
{
    (void)state;
    /* Graded columns: forming C = F^T F would lose the small stretch altogether. */
    double F[3][3] = {{1e8, 0, 0}, {0, 1, 1e-9}, {0, 0, 1e-9}};
    double found[3];
    principal_stretches(F, found);
    assert_true(fabs(found[0] / 1e8 - 1) < 1e-15);
    assert_true(fabs(found[1] - 1) < 1e-15);
    assert_true(fabs(found[2] / 1e-9 - 1) < 1e-14);
}

static void singular_gradients_have_zero_stretches(void **state)
{
    (void)state;
    double zero[3][3] = {{0}}, flat[3][3] = {{1, 2, 0}, {0, 1, 0}, {0, 0, 0}};
    double found[3];
    principal_stretches(zero, found);
    assert_true(found[0] == 0 && found[1] == 0 && found[2] == 0);
    principal_stretches(flat, found);
    assert_true(found[2] == 0);
    assert_true(fabs(found[0] - (1 + sqrt(2.0))) < 1e-15 * 8);
    assert_true(fabs(found[1] - (sqrt(2.0) - 1)) < 1e-15 * 8);
}

static void a_homogeneous_deformation_has_one_gradient_everywhere(void **state)
{
    (void)state;
    double A[3][3] = {{1.2, 0.1, -0.3}, {0.4, 0.8, 0.2}, {-0.1, 0.5, 1.1}};
    struct mesh mesh = box_mesh(&small_box);
    box_distort(&mesh, 0.01);
    double *u = box_displacement(&mesh, A);
    for (int e = 0; e < mesh.element_count; e++) {
        const struct hex_corners X = hex_gather(mesh.hex[e], &mesh.X_mm[0][0]);
        const struct hex_corners ue = hex_gather(mesh.hex[e], u);
        for (int q = 0; q < HEX_CELLS; q++) {
            const struct hex_point p = hex_point_at(&X, q);
            double F[3][3];
            deformation_gradient(&p, &ue, F);
            for (int k = 0; k < 9; k++)
                assert_true(fabs(F[k / 3][k % 3] - A[k / 3][k % 3]) < 1e-13);
        }
    }
    free(u);
    box_mesh_free(&mesh);
}

static void volumes_sum_to_the_box(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&small_box);
    /* Inner nodes move, the outside stays: the sum must not. */
    const int inner = box_node(&small_box, 1, 1, 1);
    mesh.X_mm[inner][0] += 0.5;
    mesh.X_mm[inner][2] -= 0.4;
    double sum = 0;
    for (int e = 0; e < mesh.element_count; e++) {
        const struct hex_corners X = hex_gather(mesh.hex[e], &mesh.X_mm[0][0]);
        for (int q = 0; q < HEX_CELLS; q++) sum += hex_point_at(&X, q).volume_mm3;
    }
    assert_true(fabs(sum - 4 * 6 * 5) < 1e-12 * 120);
    box_mesh_free(&mesh);
}

static void points_lie_in_the_octant_of_their_corner(void **state)
{
    (void)state;
    const struct box unit = {{1, 1, 1}, {2, 2, 2}, 0, 0};
    struct mesh mesh = box_mesh(&unit);
    const struct hex_corners X = hex_gather(mesh.hex[0], &mesh.X_mm[0][0]);
    for (int q = 0; q < HEX_CELLS; q++) {
        const struct hex_point p = hex_point_at(&X, q);
        for (int d = 0; d < 3; d++)
            assert_true(fabs(p.X_mm[d] - (1 + (X.at[q][d] - 1) / sqrt(3.0))) < 1e-15);
        assert_true(fabs(p.volume_mm3 - 1) < 1e-15);
    }
    box_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stretches_are_recovered_from_their_product_with_rotations),
        cmocka_unit_test(small_stretches_keep_their_digits),
        cmocka_unit_test(singular_gradients_have_zero_stretches),
        cmocka_unit_test(a_homogeneous_deformation_has_one_gradient_everywhere),
        cmocka_unit_test(volumes_sum_to_the_box),
        cmocka_unit_test(points_lie_in_the_octant_of_their_corner),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
