/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/verification/bodies.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/dense.h"

/* The seat's friction springs are made this much stiffer, so that what sticks hardly moves. */
static const double stick_stiffening = 50;

static void fill_nodes(struct mesh *mesh, const double size_mm[3], const int m[3],
                       unsigned top_flags)
{
    int n = 0;
    for (int k = 0; k <= m[2]; k++)
        for (int j = 0; j <= m[1]; j++)
            for (int i = 0; i <= m[0]; i++, n++) {
                mesh->X_mm[n][0] = size_mm[0] * i / m[0];
                mesh->X_mm[n][1] = size_mm[1] * j / m[1];
                mesh->X_mm[n][2] = size_mm[2] * k / m[2];
                mesh->node_flags[n] =
                    (unsigned char)((i == 0 ? NODE_ON_X0 : 0) | (j == 0 ? NODE_ON_Y0 : 0) |
                                    (k == 0 ? NODE_ON_SEAT : 0) | (k == m[2] ? top_flags : 0));
            }
}

static void fill_corners(int hex[8], int i, int j, int k, const int m[3])
{
    static const int offset[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                     {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    for (int c = 0; c < 8; c++)
        hex[c] =
            ((k + offset[c][2]) * (m[1] + 1) + j + offset[c][1]) * (m[0] + 1) + i + offset[c][0];
}

static void fill_seat_quads(struct mesh *mesh, const int m[3])
{
    for (int j = 0, q = 0; j < m[1]; j++)
        for (int i = 0; i < m[0]; i++, q++) {
            const int at = j * (m[0] + 1) + i;
            const int quad[4] = {at, at + m[0] + 1, at + m[0] + 2, at + 1};
            memcpy(mesh->seat_quad[q], quad, sizeof quad);
        }
}

enum ischia_code block_init(struct mesh *ret, const double size_mm[3], const int m[3],
                            unsigned top_flags, struct ischia_error *err)
{
    struct mesh mesh = {.node_count = (m[0] + 1) * (m[1] + 1) * (m[2] + 1),
                        .element_count = m[0] * m[1] * m[2],
                        .muscle_count = m[0] * m[1] * m[2],
                        .tip_z_mm = size_mm[2],
                        .top_z_mm = size_mm[2],
                        .seat_quad_count = m[0] * m[1],
                        .outer_skin_quad_count = m[0] * m[1]};
    mesh.X_mm = calloc((size_t)mesh.node_count, sizeof *mesh.X_mm);
    mesh.hex = calloc((size_t)mesh.element_count, sizeof *mesh.hex);
    mesh.tissue = calloc((size_t)mesh.element_count, sizeof *mesh.tissue);
    mesh.node_flags = calloc((size_t)mesh.node_count, sizeof *mesh.node_flags);
    mesh.seat_quad = calloc((size_t)mesh.seat_quad_count, sizeof *mesh.seat_quad);
    if (!mesh.X_mm || !mesh.hex || !mesh.tissue || !mesh.node_flags || !mesh.seat_quad) {
        mesh_finish(&mesh);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the block");
    }
    fill_nodes(&mesh, size_mm, m, top_flags);
    fill_seat_quads(&mesh, m);
    int e = 0;
    for (int k = 0; k < m[2]; k++)
        for (int j = 0; j < m[1]; j++)
            for (int i = 0; i < m[0]; i++) fill_corners(mesh.hex[e++], i, j, k, m);
    *ret = mesh;
    return ISCHIA_OK;
}

enum ischia_code bench_init(struct bench *b, const struct element_material material[TISSUE_COUNT],
                            double friction, struct ischia_error *err)
{
    TRY(body_init(&b->body, &b->mesh, material, err));
    TRY(assembly_init(&b->assembly, &b->mesh, err));
    TRY(seat_init(&b->seat, &b->mesh, friction, err));
    for (int n = 0; n < b->mesh.node_count; n++)
        b->seat.stick_stiffness_N_mm[n] *= stick_stiffening;
    TRY(newton_create(&b->newton, &b->body, &b->assembly, &b->seat, err));
    b->state.u_mm = calloc((size_t)b->mesh.node_count, sizeof *b->state.u_mm);
    b->normal_before_N = calloc((size_t)b->mesh.node_count, sizeof *b->normal_before_N);
    b->ahead = calloc((size_t)b->mesh.node_count, sizeof *b->ahead);
    b->normal_rate_N_mm = calloc((size_t)b->mesh.node_count, sizeof *b->normal_rate_N_mm);
    CHECK(b->state.u_mm && b->normal_before_N && b->ahead && b->normal_rate_N_mm, err,
          ISCHIA_E_MEMORY, "not enough memory for the state");
    return ISCHIA_OK;
}

void bench_finish(struct bench *b)
{
    free(b->normal_rate_N_mm);
    free(b->ahead);
    free(b->normal_before_N);
    free(b->state.u_mm);
    newton_destroy(b->newton);
    seat_finish(&b->seat);
    assembly_finish(&b->assembly);
    body_finish(&b->body);
    mesh_finish(&b->mesh);
}

/* The tissue is taken along by the tangent of the last equilibrium. */
static void move_bone(struct bench *b, double d_mm)
{
    const double by_mm = d_mm - b->state.d_mm;
    b->state.d_mm = d_mm;
    for (int n = 0; n < b->mesh.node_count; n++) {
        double *u_mm = b->state.u_mm[n];
        for (int c = 0; c < 3; c++) u_mm[c] += by_mm * b->ahead[n][c];
        if (b->mesh.node_flags[n] & NODE_ON_SEAT) seat_stop(&b->mesh, n, u_mm);
        if (b->mesh.node_flags[n] & (NODE_ON_BONE | NODE_ON_PLATE)) u_mm[2] = -d_mm;
    }
}

static enum ischia_code look_ahead(struct bench *b, struct ischia_error *err)
{
    struct newton_tangent tangent = {.direction = b->ahead,
                                     .normal_rate_N_mm = b->normal_rate_N_mm};
    TRY(newton_tangent(b->newton, &b->state, &tangent, err));
    if (tangent.stiffness_N_mm == 0)
        memset(b->ahead, 0, sizeof *b->ahead * (size_t)b->mesh.node_count);
    return ISCHIA_OK;
}

/* In two halves, from the state given: a step that is too far at once. */
static enum ischia_code press_in_halves(struct bench *b, double before_mm, double d_mm,
                                        struct ischia_error *err)
{
    CHECK(d_mm - before_mm > 1e-3, err, ISCHIA_E_NUMERIC, "no equilibrium at d = %g mm", d_mm);
    TRY(bench_press(b, (before_mm + d_mm) / 2, err));
    return bench_press(b, d_mm, err);
}

enum ischia_code bench_press(struct bench *b, double d_mm, struct ischia_error *err)
{
    const struct newton_control control = {.force_N = 1, .tolerance = 1e-9, .iterations_max = 200};
    const size_t nodes = (size_t)b->mesh.node_count;
    const double before_mm = b->state.d_mm;
    struct newton_report report = {.reason = ISCHIA_NOT_STARTED};
    double(*u)[3] = malloc(nodes * sizeof *u), *normal_N = malloc(nodes * sizeof *normal_N);
    enum ischia_code code = ISCHIA_OK;
    if (u == NULL || normal_N == NULL) {
        code = FAIL(err, ISCHIA_E_MEMORY, "not enough memory for a step");
        goto out;
    }
    if (d_mm > before_mm && before_mm > 0) code = look_ahead(b, err);
    if (code != ISCHIA_OK) goto out;
    memcpy(u, b->state.u_mm, nodes * sizeof *u);
    memcpy(normal_N, b->seat.normal_N, nodes * sizeof *normal_N);
    move_bone(b, d_mm);
    if (body_det_F_min(&b->body, (const double(*)[3])b->state.u_mm) > 0)
        code = newton_minimise(b->newton, &b->state, &control, NULL, NULL, &report, err);
    if (code != ISCHIA_OK || report.reason > 0) goto out;
    memcpy(b->state.u_mm, u, nodes * sizeof *u);
    memcpy(b->seat.normal_N, normal_N, nodes * sizeof *normal_N);
    b->state.d_mm = before_mm;
    newton_linearise(b->newton, &b->state);
    code = press_in_halves(b, before_mm, d_mm, err);
out:
    free(u);
    free(normal_N);
    return code;
}

double bench_end_step(struct bench *b)
{
    const double dissipated =
        seat_advance(&b->seat, (const double(*)[3])b->state.u_mm, b->normal_before_N);
    memcpy(b->normal_before_N, b->seat.normal_N,
           sizeof *b->normal_before_N * (size_t)b->mesh.node_count);
    return dissipated;
}

/* What the seat would be asked for, were there one: the condensed equations, as they are. */
static enum ischia_code solve_tail(const struct assembly *a, double *x, struct ischia_error *err)
{
    const size_t rows = (size_t)(a->n - a->seat_first);
    double *S = malloc(sizeof *S * (rows * rows + 1));
    int *pivot = malloc(sizeof *pivot * (rows + 1));
    enum ischia_code code = ISCHIA_OK;
    if (S == NULL || pivot == NULL) {
        code = FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the condensed equations");
    } else {
        linear_condensed(a->linear, S);
        if (!dense_solve((int)rows, S, pivot, x))
            code = FAIL(err, ISCHIA_E_NUMERIC, "the condensed equations are singular");
    }
    free(S);
    free(pivot);
    return code;
}

/* Adds the solution of one Newton step to the state; its right-hand side is given. */
static enum ischia_code apply_step(struct bench *b, double *rhs, struct ischia_error *err)
{
    enum linear_outcome outcome;
    TRY(linear_factor(b->assembly.linear, NULL, &outcome, err));
    CHECK(outcome == LINEAR_FACTORED, err, ISCHIA_E_NUMERIC,
          "the tangent is not positive definite");
    TRY(linear_reduce(b->assembly.linear, 1, rhs, err));
    TRY(solve_tail(&b->assembly, rhs + b->assembly.seat_first, err));
    TRY(linear_expand(b->assembly.linear, rhs, err));
    for (int n = 0; n < b->mesh.node_count; n++)
        for (int c = 0; c < 3; c++)
            if (b->assembly.equation[n][c] >= 0)
                b->state.u_mm[n][c] += rhs[b->assembly.equation[n][c]];
    return ISCHIA_OK;
}

/* rhs = share * load - force of the body; returns its norm over that of the load. */
static double unbalanced(const struct bench *b, const double (*load)[3], double share,
                         const double (*force)[3], double *rhs)
{
    double residual = 0, scale = 0;
    for (int n = 0; n < b->mesh.node_count; n++)
        for (int c = 0; c < 3; c++) {
            const int eq = b->assembly.equation[n][c];
            if (eq < 0) continue;
            rhs[eq] = share * load[n][c] - force[n][c];
            residual += rhs[eq] * rhs[eq];
            scale += load[n][c] * load[n][c];
        }
    return sqrt(residual / scale);
}

/* Full Newton steps from the present state to equilibrium with share * load. */
static enum ischia_code load_step(struct bench *b, const double (*load)[3], double share,
                                  struct body_derivatives *work, double *rhs,
                                  struct ischia_error *err)
{
    for (int iteration = 0; iteration < 30; iteration++) {
        const double(*u)[3] = (const double(*)[3])b->state.u_mm;
        body_reset_pressure(&b->body, u);
        const double elastic = body_linearise(&b->body, &b->assembly, u, 0, work);
        CHECK(elastic < HUGE_VAL, err, ISCHIA_E_NUMERIC, "an element is inverted");
        if (unbalanced(b, load, share, (const double(*)[3])work->force, rhs) <= 1e-6)
            return ISCHIA_OK;
        TRY(apply_step(b, rhs, err));
    }
    return FAIL(err, ISCHIA_E_NUMERIC, "no equilibrium at %g of the load", share);
}

enum ischia_code bench_load(struct bench *b, const double (*load_N)[3], int steps,
                            struct ischia_error *err)
{
    enum ischia_code code = ISCHIA_OK;
    struct body_derivatives work = {.force = calloc((size_t)b->mesh.node_count, sizeof *work.force),
                                    .border = calloc((size_t)b->assembly.n, sizeof *work.border)};
    double *rhs = calloc((size_t)b->assembly.n, sizeof *rhs);
    if (!work.force || !work.border || !rhs)
        code = FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the load");
    for (int s = 1; s <= steps && code == ISCHIA_OK; s++)
        code = load_step(b, load_N, (double)s / steps, &work, rhs, err);
    free(work.force);
    free(work.border);
    free(rhs);
    return code;
}
