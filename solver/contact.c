/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A primal-dual active set (Hintermueller, Ito and Kunisch 2003) on the condensed system: each
 * round solves with the nodes on the seat of the round before, until they stay the same. Friction
 * is linear about the present state; the normal force of a slipping node is the row of its z, so
 * that Coulomb's mu N enters the matrix as a multiple of that row (Alart and Curnier 1991).
 */
#include "solver/contact.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/dense.h"

enum { ROUNDS_MAX = 12 };
/* Less than this is rounding: a node on the seat that is moved along it. */
static const double through_seat_mm = 1e-12;

/* LANDS: comes to the seat within this solution, with friction limits held: it feels none yet. */
enum status { STATUS_OFF, STATUS_LANDS, STATUS_STICKS, STATUS_SLIPS };

/* A node that rests on the seat, in one round. */
struct place {
    int node;
    int row[3]; /* in the condensed system; -1: held in the body */
    enum status status;
    double gap_mm;
    double stick_N_mm;
    double normal_N;   /* of the seat, at the present state */
    double stretch[2]; /* of the spring at the present state, mm                  */
};

struct contact {
    const struct mesh *mesh;
    int rows, count;
    struct place *place;
    struct contact_model model;
    double *matrix; /* [rows + 1][rows + 1] */
    double *rhs;    /* [rows + 1]           */
    double *forces; /* [rows] f             */
    int *pivot;
};

static void find_places(struct contact *c, const struct assembly *a)
{
    for (int n = 0; n < c->mesh->node_count; n++) {
        const int *eq = a->equation[n];
        if (eq[2] < a->seat_first) continue; /* negative ones too */
        struct place *p = &c->place[c->count++];
        p->node = n;
        for (int k = 0; k < 3; k++) p->row[k] = eq[k] >= 0 ? eq[k] - a->seat_first : -1;
    }
}

enum ischia_code contact_create(struct contact **ret, const struct mesh *mesh,
                                const struct assembly *assembly, struct ischia_error *err)
{
    const size_t rows = (size_t)(assembly->n - assembly->seat_first), size = rows + 1;
    struct contact *c = calloc(1, sizeof *c);
    CHECK(c != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the contact");
    *c = (struct contact){.mesh = mesh, .rows = (int)rows};
    c->place = calloc(size, sizeof *c->place);
    c->model.stiffness = calloc(size * size, sizeof(double));
    c->model.load = calloc(size, sizeof(double));
    c->model.border = calloc(size, sizeof(double));
    c->matrix = calloc(size * size, sizeof *c->matrix);
    c->rhs = calloc(size, sizeof *c->rhs);
    c->forces = calloc(size, sizeof *c->forces);
    c->pivot = calloc(size, sizeof *c->pivot);
    if (!c->place || !c->model.stiffness || !c->model.load || !c->model.border || !c->matrix ||
        !c->rhs || !c->forces || !c->pivot) {
        contact_destroy(c);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the contact");
    }
    find_places(c, assembly);
    *ret = c;
    return ISCHIA_OK;
}

void contact_destroy(struct contact *c)
{
    if (c == NULL) return;
    free(c->place);
    free(c->model.stiffness);
    free(c->model.load);
    free(c->model.border);
    free(c->matrix);
    free(c->rhs);
    free(c->forces);
    free(c->pivot);
    free(c);
}

struct contact_model *contact_model_of(struct contact *c) { return &c->model; }

/* --- one round -------------------------------------------------------------------------------- */

static int size_of(const struct contact *c) { return c->rows + c->model.force_controlled; }

/* A symmetric matrix is the same by rows. */
static const double *stiffness_row(const struct contact *c, int row)
{
    return c->model.stiffness + (size_t)row * (size_t)c->rows;
}

static double *entry(const struct contact *c, int row, int column)
{
    return &c->matrix[(size_t)column * (size_t)size_of(c) + (size_t)row];
}

/* Stick, or slip: by the spring's stretch and the normal force. */
static enum status friction_status(const struct place *p, double friction)
{
    const double r = hypot(p->stretch[0], p->stretch[1]);
    return p->stick_N_mm * r <= friction * p->normal_N ? STATUS_STICKS : STATUS_SLIPS;
}

static void start(struct contact *c, const struct seat *seat, const double (*u)[3])
{
    for (int i = 0; i < c->count; i++) {
        struct place *p = &c->place[i];
        const int n = p->node;
        p->gap_mm = seat_gap_mm(c->mesh, u, n);
        p->stick_N_mm = seat->stick_stiffness_N_mm[n];
        p->normal_N = seat->normal_N[n];
        for (int k = 0; k < 2; k++) p->stretch[k] = u[n][k] - seat->anchor_mm[n][k];
        p->status = p->normal_N > 0 ? friction_status(p, seat->friction) : STATUS_OFF;
    }
}

static void slip_direction(const struct place *p, double ret_t[2])
{
    const double r = hypot(p->stretch[0], p->stretch[1]);
    for (int k = 0; k < 2; k++) ret_t[k] = r > 0 ? p->stretch[k] / r : 0;
}

/* Hessian of the friction potential for a held normal force, N/mm. */
static void friction_hessian(const struct place *p, double friction, double ret[2][2])
{
    seat_spring_hessian(p->stick_N_mm, friction * p->normal_N, p->status == STATUS_SLIPS,
                        p->stretch, ret);
}

static void add_friction_hessian(struct contact *c, const struct place *p, double friction)
{
    double hessian[2][2];
    friction_hessian(p, friction, hessian);
    for (int k = 0; k < 2; k++)
        for (int l = 0; l < 2; l++)
            if (p->row[k] >= 0 && p->row[l] >= 0) *entry(c, p->row[k], p->row[l]) += hessian[k][l];
}

/* share of the normal force that the model gives, on the left of the equation `row`. */
static void add_normal_force(struct contact *c, const struct place *p, int row, double share)
{
    const double *normal_row = stiffness_row(c, p->row[2]);
    for (int j = 0; j < c->rows; j++) *entry(c, row, j) += share * normal_row[j];
    if (c->model.force_controlled) *entry(c, row, c->rows) += share * c->model.border[p->row[2]];
    c->rhs[row] += share * c->model.load[p->row[2]];
}

/* Friction forces of a stick are k (stretch + du), of a slip mu N t, linear about the present. */
static void load_friction(struct contact *c, const struct place *p, double friction, bool lagged)
{
    double t[2];
    slip_direction(p, t);
    for (int k = 0; k < 2; k++) {
        const int row = p->row[k];
        if (row < 0) continue;
        if (p->status == STATUS_STICKS)
            c->rhs[row] -= p->stick_N_mm * p->stretch[k];
        else if (lagged)
            c->rhs[row] -= friction * p->normal_N * t[k];
        else
            add_normal_force(c, p, row, friction * t[k]);
    }
}

/* The equation of a node on the seat: du_z = -gap. */
static void hold_normal(struct contact *c, const struct place *p)
{
    const int size = size_of(c), row = p->row[2];
    for (int j = 0; j < size; j++) *entry(c, row, j) = row == j;
    c->rhs[row] = -p->gap_mm;
}

static void copy_model(struct contact *c)
{
    const size_t rows = (size_t)c->rows, size = (size_t)size_of(c);
    for (size_t j = 0; j < rows; j++)
        memcpy(c->matrix + j * size, c->model.stiffness + j * rows, sizeof(double) * rows);
    memcpy(c->rhs, c->model.load, sizeof(double) * rows);
    if (!c->model.force_controlled) return;
    for (size_t j = 0; j < rows; j++) c->matrix[j * size + rows] = c->model.border[j];
    memcpy(c->matrix + rows * size, c->model.border, sizeof(double) * rows);
    c->matrix[rows * size + rows] = c->model.corner;
    c->rhs[rows] = c->model.d_load;
}

static bool solve_round(struct contact *c, double friction, bool lagged)
{
    copy_model(c);
    for (int i = 0; i < c->count; i++) {
        const struct place *p = &c->place[i];
        if (p->status <= STATUS_LANDS) continue;
        add_friction_hessian(c, p, friction);
        load_friction(c, p, friction, lagged);
    }
    for (int i = 0; i < c->count; i++)
        if (c->place[i].status != STATUS_OFF) hold_normal(c, &c->place[i]);
    return dense_solve(size_of(c), c->matrix, c->pivot, c->rhs);
}

static double approach_of(const struct contact *c)
{
    return c->model.force_controlled ? c->rhs[c->rows] : 0;
}

/* f of the round's solution. */
static void find_forces(struct contact *c)
{
    dense_multiply(c->rows, c->model.stiffness, c->rhs, c->forces);
    for (int i = 0; i < c->rows; i++)
        c->forces[i] += c->model.border[i] * approach_of(c) - c->model.load[i];
}

/* What the solution makes of a node; true when that differs from the guess. */
static bool update(const struct contact *c, struct place *p, bool lagged)
{
    const enum status before = p->status;
    if (p->status != STATUS_OFF && c->forces[p->row[2]] < 0) p->status = STATUS_OFF;
    if (before == STATUS_OFF && p->gap_mm + c->rhs[p->row[2]] < -through_seat_mm)
        p->status = lagged ? STATUS_LANDS : STATUS_STICKS;
    return p->status != before;
}

bool contact_solve(struct contact *c, const struct seat *seat, const double (*u)[3],
                   enum contact_friction kind, double *ret_du, double *ret_dd, double *ret_normal_N)
{
    const bool lagged = kind == CONTACT_LAGGED;
    start(c, seat, u);
    for (int round = 0, changed = 1; changed > 0 && round < ROUNDS_MAX; round++) {
        if (!solve_round(c, seat->friction, lagged)) return false;
        find_forces(c);
        changed = 0;
        for (int i = 0; i < c->count; i++) changed += update(c, &c->place[i], lagged);
    }
    memcpy(ret_du, c->rhs, sizeof *ret_du * (size_t)c->rows);
    *ret_dd = approach_of(c);
    for (int i = 0; i < c->count; i++)
        ret_normal_N[c->place[i].node] =
            c->place[i].status != STATUS_OFF ? fmax(0, c->forces[c->place[i].row[2]]) : 0;
    return true;
}

bool contact_is_stable(struct contact *c, const struct seat *seat)
{
    copy_model(c);
    const int size = size_of(c);
    for (int i = 0; i < c->count; i++) {
        const struct place *p = &c->place[i];
        if (p->status == STATUS_OFF) continue;
        if (p->status > STATUS_LANDS) add_friction_hessian(c, p, seat->friction);
        for (int j = 0; j < size; j++) *entry(c, p->row[2], j) = *entry(c, j, p->row[2]) = 0;
        *entry(c, p->row[2], p->row[2]) = 1;
    }
    return dense_is_definite(size, c->matrix);
}

bool contact_rate(struct contact *c, const struct seat *seat, const double (*u)[3], double *ret_du,
                  double *ret_normal_rate)
{
    start(c, seat, u);
    for (int i = 0; i < c->count; i++) { /* a rate has no gap to close and no spring to relax */
        struct place *p = &c->place[i];
        p->gap_mm = 0;
        if (p->status == STATUS_STICKS) p->stretch[0] = p->stretch[1] = 0;
    }
    if (!solve_round(c, seat->friction, false)) return false;
    find_forces(c);
    memcpy(ret_du, c->rhs, sizeof *ret_du * (size_t)c->rows);
    for (int i = 0; i < c->count; i++)
        ret_normal_rate[c->place[i].node] =
            c->place[i].status != STATUS_OFF ? c->forces[c->place[i].row[2]] : 0;
    return true;
}
