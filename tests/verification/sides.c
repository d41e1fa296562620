/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/verification/sides.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/units.h"

static const double energy_residual_max = 5e-3;
static const struct path_effort effort = {.pace = 1, .factorisations_max = 2500};

static const struct side sides[] = {
    {"1R", {6.9, 19.7, 28, 10, 8.00, 5.00, 196}},  {"7L", {8.9, 15.2, 33, 9, 8.00, 2.75, 211}},
    {"8L", {7.2, 21.3, 29, 22, 1.00, 4.50, 288}},  {"9R", {7.3, 30.3, 19, 35, 4.50, 2.75, 429}},
    {"10R", {5.5, 52.1, 36, 23, 2.75, 4.50, 268}}, {"12R", {4.8, 30.2, 22, 16, 4.50, 2.75, 305}},
};

const struct side *side_of(const char *name)
{
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++)
        if (strcmp(sides[i].name, name) == 0) return &sides[i];
    return NULL;
}

struct ischia_case side_case(const struct side *side, enum ischia_resolution resolution)
{
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, side->param, sizeof side->param);
    c.resolution = resolution;
    return c;
}

void run_finish(struct run *r)
{
    free(r->state.u_mm);
    seat_finish(&r->seat);
    body_finish(&r->body);
    assembly_finish(&r->assembly);
    mesh_finish(&r->mesh);
}

enum ischia_code run_init(struct run *r, const struct ischia_case *c,
                          const struct mesh_divisions *divisions, const struct variant *v,
                          struct ischia_error *err)
{
    const double mu_kPa[TISSUE_COUNT] = {[TISSUE_MUSCLE] = c->param[ISCHIA_MUM],
                                         [TISSUE_FAT] = c->param[ISCHIA_MUF],
                                         [TISSUE_SKIN] = c->option[ISCHIA_SKIN_MU]};
    struct element_material material[TISSUE_COUNT];
    for (int t = 0; t < TISSUE_COUNT; t++) {
        const double mu = MPa_from_kPa(mu_kPa[t]);
        material[t] = (struct element_material){mu, mu * c->option[ISCHIA_BULK_RATIO],
                                                mu * v->kappa_point_over_mu, v->corner_share};
    }
    TRY(mesh_local_init(&r->mesh, c, divisions, err));
    TRY(assembly_init(&r->assembly, &r->mesh, err));
    TRY(body_init(&r->body, &r->mesh, material, err));
    TRY(seat_init(&r->seat, &r->mesh, c->option[ISCHIA_FRICTION], err));
    for (int n = 0; n < r->seat.node_count; n++) r->seat.stick_stiffness_N_mm[n] *= v->stick_factor;
    r->state.u_mm = calloc((size_t)r->mesh.node_count, sizeof *r->state.u_mm);
    CHECK(r->state.u_mm != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the displacements");
    return ISCHIA_OK;
}

void run_measure(const struct run *r, struct outcome *ret)
{
    const double(*u)[3] = (const double(*)[3])r->state.u_mm;
    ret->strain = axis_strain_of(&r->mesh, u);
    ret->eps_max = ret->strain.eps_max;
    ret->d_mm = r->state.d_mm;
    ret->det_F_min = body_det_F_min(&r->body, u);
}

enum ischia_code solve_on(const struct mesh_divisions *divisions, const struct ischia_case *c,
                          const struct variant *v, struct outcome *ret, struct ischia_error *err)
{
    struct run r = {0};
    enum ischia_code code = run_init(&r, c, divisions, v, err);
    if (code == ISCHIA_OK)
        code = path_follow(&r.body, &r.assembly, &r.seat, quarter_force_N(c->param[ISCHIA_F]),
                           &effort, NULL, &r.state, &ret->path, err);
    if (code == ISCHIA_OK) run_measure(&r, ret);
    run_finish(&r);
    return code;
}

bool is_sound(const struct outcome *o)
{
    return o->path.reason > 0 && fabs(o->path.energy_residual) <= energy_residual_max;
}
