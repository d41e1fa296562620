/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/contact.h"
#include "tests/unit/box_mesh.h"
#include "tests/unit/near.h"

/* The nodes under a box with a made-up body on them: any symmetric S will do. */
static const struct box box = {{3, 3, 1}, {6, 6, 3}, 0, 0};
static const double friction = 0.4;
enum { ROWS_MAX = 48 };

struct bench {
    struct mesh mesh;
    struct assembly assembly;
    struct seat seat;
    struct contact *contact;
    struct contact_model *model;
    int rows;
    double (*u)[3];
    double du[ROWS_MAX], dd;
    double *normal_N;
};

static void must(enum ischia_code code, const struct ischia_error *err)
{
    if (code == ISCHIA_OK) return;
    fail_msg("%s", err->message);
    abort(); /* not reached: fail_msg leaves the test */
}

/* Definite, with neighbours that pull on each other; the loads press some nodes down and others up,
 * and along the seat. */
static void fill_model(struct bench *b, int seed)
{
    struct contact_model *m = b->model;
    for (int j = 0; j < b->rows; j++) {
        for (int i = 0; i < b->rows; i++)
            m->stiffness[j * b->rows + i] =
                i == j ? 6 : 0.4 * cos(0.7 * (i + j + seed)) / (1 + abs(i - j));
        m->load[j] = sin(1.3 * j * (seed + 1) + seed);
        m->border[j] = 0.3 * cos(2.1 * j + seed);
    }
    m->corner = 5;
    m->d_load = 0.8;
}

static void bench_init(struct bench *b, int seed, bool force_controlled)
{
    struct ischia_error err;
    memset(b, 0, sizeof *b);
    b->mesh = box_mesh(&box);
    must(assembly_init(&b->assembly, &b->mesh, &err), &err);
    must(seat_init(&b->seat, &b->mesh, friction, &err), &err);
    must(contact_create(&b->contact, &b->mesh, &b->assembly, &err), &err);
    b->u = box_alloc((size_t)b->mesh.node_count, sizeof *b->u);
    b->normal_N = box_alloc((size_t)b->mesh.node_count, sizeof *b->normal_N);
    b->rows = b->assembly.n - b->assembly.seat_first;
    assert_in_range(b->rows, 1, ROWS_MAX);
    b->model = contact_model_of(b->contact);
    b->model->force_controlled = force_controlled;
    fill_model(b, seed);
    for (int n = 0; n < b->mesh.node_count; n++) {
        b->seat.stick_stiffness_N_mm[n] = 3;
        b->seat.anchor_mm[n][0] = 0.05 * sin(n);
        if (n % 3 == 1 && b->mesh.X_mm[n][2] <= 0) b->u[n][2] = 0.02; /* above the seat */
        if (b->u[n][2] > 0) b->seat.normal_N[n] = 0;
    }
}

static void bench_finish(struct bench *b)
{
    contact_destroy(b->contact);
    seat_finish(&b->seat);
    assembly_finish(&b->assembly);
    box_mesh_free(&b->mesh);
    free(b->u);
    free(b->normal_N);
}

static const double (*at(const struct bench *b))[3] { return (const double(*)[3])b->u; }

static double force_at(const struct bench *b, int row)
{
    double sum = b->model->border[row] * b->dd - b->model->load[row];
    for (int j = 0; j < b->rows; j++) sum += b->model->stiffness[j * b->rows + row] * b->du[j];
    return sum;
}

static int row_of(const struct bench *b, int node, int component)
{
    const int eq = b->assembly.equation[node][component];
    return eq >= 0 ? eq - b->assembly.seat_first : -1;
}

/* Friction by the law, linear about the present state; what lands sticks. */
static void law(const struct bench *b, int n, double ret[2])
{
    const double k = b->seat.stick_stiffness_N_mm[n], held_N = b->seat.normal_N[n];
    double stretch[2], du[2], hessian[2][2];
    for (int c = 0; c < 2; c++) {
        const int row = row_of(b, n, c);
        stretch[c] = b->u[n][c] - b->seat.anchor_mm[n][c];
        du[c] = row >= 0 ? b->du[row] : 0;
    }
    const double r = hypot(stretch[0], stretch[1]);
    const bool slips = held_N > 0 && k * r > friction * held_N;
    seat_spring_hessian(k, friction * held_N, slips, stretch, hessian);
    for (int c = 0; c < 2; c++) {
        ret[c] = slips ? friction * b->normal_N[n] * stretch[c] / r : k * stretch[c];
        ret[c] += hessian[c][0] * du[0] + hessian[c][1] * du[1];
        if (!(b->normal_N[n] > 0)) ret[c] = 0;
    }
}

/* Contact's conditions, node by node; returns how many press. */
static int check_normals(const struct bench *b)
{
    int pressed = 0;
    for (int n = 0; n < b->mesh.node_count; n++) {
        if (b->assembly.equation[n][2] < b->assembly.seat_first) continue;
        const int row = row_of(b, n, 2);
        const double gap = b->u[n][2] + b->du[row], f = force_at(b, row);
        assert_true(gap > -1e-11 && f > -1e-11);
        assert_near(gap * f, 0, 1e-11);
        assert_near(b->normal_N[n], f, 1e-11);
        pressed += f > 1e-9;
    }
    return pressed;
}

static void solution_obeys_contact_and_coulomb(void **state)
{
    (void)state;
    int pressed = 0, free_nodes = 0;
    for (int seed = 0; seed < 40; seed++) {
        struct bench b;
        bench_init(&b, seed, seed % 2 == 1);
        assert_true(
            contact_solve(b.contact, &b.seat, at(&b), CONTACT_COULOMB, b.du, &b.dd, b.normal_N));
        const int count = check_normals(&b);
        pressed += count;
        free_nodes += 16 - count;
        for (int n = 0; n < b.mesh.node_count; n++) {
            if (b.assembly.equation[n][2] < b.assembly.seat_first) continue;
            double pull[2];
            law(&b, n, pull);
            for (int k = 0; k < 2; k++) {
                const int row = row_of(&b, n, k);
                if (row >= 0) assert_near(force_at(&b, row), -pull[k], 1e-11);
            }
        }
        if (b.model->force_controlled) {
            double sum = b.model->corner * b.dd;
            for (int j = 0; j < b.rows; j++) sum += b.model->border[j] * b.du[j];
            assert_near(sum, b.model->d_load, 1e-11);
        } else {
            assert_true(b.dd == 0);
        }
        assert_true(contact_is_stable(b.contact, &b.seat));
        bench_finish(&b);
    }
    assert_true(pressed > 100 && free_nodes > 100); /* both kinds were there */
}

/* The potential with the limits held, of the model and of friction linear about the present. */
static double lagged_potential(const struct bench *b, const double *du)
{
    double sum = 0, hessian[2][2];
    for (int i = 0; i < b->rows; i++) {
        sum -= b->model->load[i] * du[i];
        for (int j = 0; j < b->rows; j++)
            sum += b->model->stiffness[j * b->rows + i] * du[i] * du[j] / 2;
    }
    double(*force)[3] = box_alloc((size_t)b->mesh.node_count, sizeof *force);
    seat_add_force(&b->seat, b->seat.normal_N, at(b), force);
    for (int n = 0; n < b->mesh.node_count; n++) {
        if (!(b->seat.normal_N[n] > 0)) continue;
        const int rx = row_of(b, n, 0), ry = row_of(b, n, 1);
        const double dx = rx >= 0 ? du[rx] : 0, dy = ry >= 0 ? du[ry] : 0;
        seat_hessian(&b->seat, at(b), n, hessian);
        sum += force[n][0] * dx + force[n][1] * dy + hessian[0][0] * dx * dx / 2 +
               hessian[1][1] * dy * dy / 2 + hessian[0][1] * dx * dy;
    }
    free(force);
    return sum;
}

static bool goes_through(const struct bench *b, const double *du)
{
    for (int n = 0; n < b->mesh.node_count; n++)
        if (b->assembly.equation[n][2] >= b->assembly.seat_first &&
            b->u[n][2] + du[row_of(b, n, 2)] < -1e-12)
            return true;
    return false;
}

/* Friction of nodes that leave the seat within the step stays in the potential, not in the
 * solution: only where none does is it a minimum. */
static bool some_leave(const struct bench *b)
{
    for (int n = 0; n < b->mesh.node_count; n++)
        if (b->seat.normal_N[n] > 0 && !(b->normal_N[n] > 0)) return true;
    return false;
}

/* No small admissible change lowers the potential. */
static void check_minimum(const struct bench *b)
{
    const double least = lagged_potential(b, b->du);
    for (int i = 0; i < 2 * b->rows; i++) {
        double other[ROWS_MAX];
        memcpy(other, b->du, sizeof other);
        other[i / 2] += i % 2 == 0 ? 1e-3 : -1e-3;
        if (!goes_through(b, other)) assert_true(lagged_potential(b, other) > least - 1e-12);
    }
}

static void lagged_solution_is_the_minimum(void **state)
{
    (void)state;
    int minima = 0;
    for (int seed = 0; seed < 40; seed++) {
        struct bench b;
        bench_init(&b, seed, false);
        for (int n = 0; n < b.mesh.node_count; n++)
            if (b.u[n][2] <= 0 && b.mesh.X_mm[n][2] <= 0) b.seat.normal_N[n] = 0.1 * (n % 4);
        for (int i = 0; i < b.rows; i++) b.model->load[i] -= 0.5; /* most stay on the seat */
        assert_true(
            contact_solve(b.contact, &b.seat, at(&b), CONTACT_LAGGED, b.du, &b.dd, b.normal_N));
        (void)check_normals(&b);
        if (!some_leave(&b)) {
            check_minimum(&b);
            minima++;
        }
        bench_finish(&b);
    }
    assert_true(minima > 0);
}

/* Takes the solution as the new state, and the model about it. */
static void move_there(struct bench *b)
{
    for (int n = 0; n < b->mesh.node_count; n++)
        for (int k = 0; k < 3; k++) {
            const int row = row_of(b, n, k);
            if (row >= 0) b->u[n][k] += b->du[row];
        }
    memcpy(b->seat.normal_N, b->normal_N, sizeof *b->normal_N * (size_t)b->mesh.node_count);
    for (int j = 0; j < b->rows; j++)
        for (int i = 0; i < b->rows; i++)
            b->model->load[i] -= b->model->stiffness[j * b->rows + i] * b->du[j];
}

/* From an equilibrium, a little more load moves it by the rate. */
static void rate_is_the_derivative(void **state)
{
    (void)state;
    static const double h = 1e-6;
    for (int seed = 0; seed < 10; seed++) {
        struct bench b;
        double rate[ROWS_MAX], *normal_rate;
        bench_init(&b, seed, false);
        normal_rate = box_alloc((size_t)b.mesh.node_count, sizeof *normal_rate);
        for (int round = 0; round < 30; round++) { /* to the equilibrium, limits and all */
            assert_true(contact_solve(b.contact, &b.seat, at(&b), CONTACT_COULOMB, b.du, &b.dd,
                                      b.normal_N));
            move_there(&b);
        }
        for (int i = 0; i < b.rows; i++) b.model->load[i] -= h * b.model->border[i];
        assert_true(
            contact_solve(b.contact, &b.seat, at(&b), CONTACT_COULOMB, b.du, &b.dd, b.normal_N));
        for (int i = 0; i < b.rows; i++) b.model->load[i] = -b.model->border[i];
        assert_true(contact_rate(b.contact, &b.seat, at(&b), rate, normal_rate));
        for (int i = 0; i < b.rows; i++) assert_near(b.du[i] / h, rate[i], 1e-4);
        for (int n = 0; n < b.mesh.node_count; n++)
            assert_near((b.normal_N[n] - b.seat.normal_N[n]) / h, normal_rate[n], 1e-4);
        free(normal_rate);
        bench_finish(&b);
    }
}

static void instability_is_found(void **state)
{
    (void)state;
    struct bench b;
    bench_init(&b, 3, false);
    const int node = box_node(&box, 1, 1, 0); /* above the seat: nothing holds it */
    b.model->stiffness[row_of(&b, node, 0) * (b.rows + 1)] = -6;
    assert_true(
        contact_solve(b.contact, &b.seat, at(&b), CONTACT_COULOMB, b.du, &b.dd, b.normal_N));
    assert_false(contact_is_stable(b.contact, &b.seat));
    memset(b.model->stiffness, 0, sizeof(double) * (size_t)(b.rows * b.rows));
    assert_false(
        contact_solve(b.contact, &b.seat, at(&b), CONTACT_COULOMB, b.du, &b.dd, b.normal_N));
    bench_finish(&b);
    contact_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solution_obeys_contact_and_coulomb),
        cmocka_unit_test(lagged_solution_is_the_minimum),
        cmocka_unit_test(rate_is_the_derivative),
        cmocka_unit_test(instability_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
