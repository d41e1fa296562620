/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The quarter model against all four quarters: the local model's mesh is mirrored in x = 0 and
 * y = 0, nothing is held on those planes, and the same approach of the bone must give the same
 * displacements and four times the force.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/units.h"
#include "tests/verification/bodies.h"

static const double row_1R[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8.0, 5.0, 196};
static const double friction = 0.4, approach_mm = 8;
enum { STEPS = 8 };

static void must(enum ischia_code code, const struct ischia_error *err)
{
    if (code != ISCHIA_OK) fail_msg("%s", err->message);
}

/* Node numbers of the four images of a quarter's nodes; nodes on a mirror are shared. */
static int number_images(const struct mesh *quarter, int (*ret_image)[4])
{
    int count = quarter->node_count;
    for (int n = 0; n < quarter->node_count; n++) {
        const bool on_x0 = quarter->node_flags[n] & NODE_ON_X0;
        const bool on_y0 = quarter->node_flags[n] & NODE_ON_Y0;
        ret_image[n][0] = n;
        ret_image[n][1] = on_x0 ? n : count++;
        ret_image[n][2] = on_y0 ? n : count++;
        ret_image[n][3] = on_x0 ? ret_image[n][2] : on_y0 ? ret_image[n][1] : count++;
    }
    return count;
}

static void mirror_nodes(const struct mesh *quarter, int image, int (*number)[4], struct mesh *full)
{
    const double sign_x = image & 1 ? -1 : 1, sign_y = image & 2 ? -1 : 1;
    for (int n = 0; n < quarter->node_count; n++) {
        double *X = full->X_mm[number[n][image]];
        X[0] = sign_x * quarter->X_mm[n][0];
        X[1] = sign_y * quarter->X_mm[n][1];
        X[2] = quarter->X_mm[n][2];
        full->node_flags[number[n][image]] =
            (unsigned char)(quarter->node_flags[n] & ~(NODE_ON_X0 | NODE_ON_Y0));
    }
}

/* A single reflection turns an element inside out: its two faces change places. */
static void mirror_elements(const struct mesh *quarter, int image, int (*number)[4],
                            struct mesh *full)
{
    const int turn = image == 1 || image == 2 ? 4 : 0;
    for (int e = 0; e < quarter->element_count; e++) {
        const int to = image * quarter->element_count + e;
        full->tissue[to] = quarter->tissue[e];
        for (int k = 0; k < 8; k++)
            full->hex[to][(k + turn) % 8] = number[quarter->hex[e][k]][image];
    }
}

/* Likewise for the faces that may touch the seat, whose normals must go on pointing out. */
static void mirror_seat(const struct mesh *quarter, int image, int (*number)[4], struct mesh *full)
{
    const bool turn = image == 1 || image == 2;
    for (int q = 0; q < quarter->seat_quad_count; q++)
        for (int k = 0; k < 4; k++)
            full->seat_quad[image * quarter->seat_quad_count + q][turn ? 3 - k : k] =
                number[quarter->seat_quad[q][k]][image];
}

static void mirror_mesh(const struct mesh *quarter, struct mesh *ret)
{
    int(*number)[4] = calloc((size_t)quarter->node_count, sizeof *number);
    assert_non_null(number);
    *ret = (struct mesh){.node_count = number_images(quarter, number),
                         .element_count = 4 * quarter->element_count,
                         .seat_quad_count = 4 * quarter->seat_quad_count};
    ret->X_mm = calloc((size_t)ret->node_count, sizeof *ret->X_mm);
    ret->node_flags = calloc((size_t)ret->node_count, sizeof *ret->node_flags);
    ret->hex = calloc((size_t)ret->element_count, sizeof *ret->hex);
    ret->tissue = calloc((size_t)ret->element_count, sizeof *ret->tissue);
    ret->seat_quad = calloc((size_t)ret->seat_quad_count, sizeof *ret->seat_quad);
    if (!ret->X_mm || !ret->node_flags || !ret->hex || !ret->tissue || !ret->seat_quad) {
        fail_msg("not enough memory for the whole body");
        abort(); /* not reached: fail_msg leaves the test */
    }
    for (int image = 0; image < 4; image++) {
        mirror_nodes(quarter, image, number, ret);
        mirror_elements(quarter, image, number, ret);
        mirror_seat(quarter, image, number, ret);
    }
    free(number);
}

static void press(struct bench *b)
{
    struct ischia_error err;
    struct element_material material[TISSUE_COUNT];
    const double mu_kPa[TISSUE_COUNT] = {8, 5, 67};
    for (int t = 0; t < TISSUE_COUNT; t++) {
        const double mu = MPa_from_kPa(mu_kPa[t]);
        material[t] = (struct element_material){mu, 200 * mu, mu, 0.1 * mu};
    }
    must(bench_init(b, material, friction, &err), &err);
    for (int s = 1; s <= STEPS; s++) {
        must(bench_press(b, approach_mm * s / STEPS, &err), &err);
        (void)bench_end_step(b);
    }
}

static void four_quarters_are_the_whole(void **state)
{
    (void)state;
    struct ischia_case c = ischia_case_default();
    struct bench quarter = {0}, full = {0};
    struct ischia_error err;
    double largest = 0;
    memcpy(c.param, row_1R, sizeof row_1R);
    must(mesh_local_init(&quarter.mesh, &c, &mesh_divisions[ISCHIA_COARSE], &err), &err);
    mirror_mesh(&quarter.mesh, &full.mesh);
    press(&quarter);
    press(&full);
    for (int n = 0; n < quarter.mesh.node_count; n++)
        for (int i = 0; i < 3; i++)
            largest = fmax(largest, fabs(full.state.u_mm[n][i] - quarter.state.u_mm[n][i]));
    print_message("displacements differ by %.1e mm of %g mm; force %.4f N against 4 x %.4f N\n",
                  largest, approach_mm, full.state.force_N, quarter.state.force_N);
    assert_true(quarter.state.force_N > 1);
    assert_true(largest < 1e-5);
    assert_true(fabs(full.state.force_N / side_force_N(quarter.state.force_N) - 1) < 1e-6);
    bench_finish(&full);
    bench_finish(&quarter);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(four_quarters_are_the_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
