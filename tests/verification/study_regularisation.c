/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What the model's regularisations do to eps_max: the point-wise share kappa_s of the bulk modulus
 * and the corners' kappa_c (element.h), and the stiffness k of the friction springs (seat.h). Each
 * is varied with the others at their shipped values; nothing but these numbers changes from run to
 * run. A last line takes the load path, whose friction history depends on the steps, in SMALL_STEPS
 * equal steps to the same travel; it and its change are of the resolution's own mesh, the others'
 * eps_max is extrapolated with the companion mesh as ischia_solve does.
 *
 * usage: study_regularisation RESOLUTION SIDE ...    e.g. study_regularisation standard 1R 9R
 * Fails when the shipped values are not those of ischia_solve, a run does not converge, or when
 * taking a regularisation away (kappa_s and kappa_c towards 0, k towards infinity) moves eps_max by
 * more than effect_max, or an energy balance is off.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "solver/axis.h"
#include "solver/path.h"
#include "solver/units.h"

static const double effect_max = 5e-3, energy_residual_max = 5e-3, path_effect = 1e-3;
enum { SMALL_STEPS = 200 };
struct variant {
    double kappa_point_over_mu, kappa_corner_over_mu;
    double stick_factor; /* on what seat.c sets */
    bool less;           /* regularised than the shipped one */
};
/* solver.c's constants first, then one varied at a time. */
static const struct variant variants[] = {
    {1, 0.5, 1, false}, {0.1, 0.5, 1, true},   {0.3, 0.5, 1, true},
    {5, 0.5, 1, false}, {1, 0.05, 1, true},    {1, 0.2, 1, true},
    {1, 2, 1, false},   {1, 0.5, 0.25, false}, {1, 0.5, 4, true},
};

struct side {
    const char *name;
    double param[ISCHIA_PARAM_COUNT]; /* Table 2 of Macron et al. (2020) */
};
static const struct side sides[] = {
    {"1R", {6.9, 19.7, 28, 10, 8.00, 5.00, 196}},
    {"9R", {7.3, 30.3, 19, 35, 4.50, 2.75, 429}},
};

struct outcome {
    struct axis_strain strain;
    double eps_max; /* extrapolated from the resolution's mesh and its companion, as shipped */
    struct path_report path;
    double d_mm, det_F_min;
};

/* Everything one solve needs. */
struct run {
    struct mesh mesh;
    struct assembly assembly;
    struct body body;
    struct seat seat;
    struct equilibrium state;
};

static void run_finish(struct run *r)
{
    free(r->state.u_mm);
    seat_finish(&r->seat);
    body_finish(&r->body);
    assembly_finish(&r->assembly);
    mesh_finish(&r->mesh);
}

static enum ischia_code run_init(struct run *r, const struct ischia_case *c,
                                 const struct mesh_divisions *divisions, const struct variant *v,
                                 struct ischia_error *err)
{
    const double mu_kPa[TISSUE_COUNT] = {[TISSUE_MUSCLE] = c->param[ISCHIA_MUM],
                                         [TISSUE_FAT] = c->param[ISCHIA_MUF],
                                         [TISSUE_SKIN] = c->option[ISCHIA_SKIN_MU]};
    struct element_material material[TISSUE_COUNT];
    for (int t = 0; t < TISSUE_COUNT; t++) {
        const double mu = MPa_from_kPa(mu_kPa[t]);
        material[t] =
            (struct element_material){mu, mu * c->option[ISCHIA_BULK_RATIO],
                                      mu * v->kappa_point_over_mu, mu * v->kappa_corner_over_mu};
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

static void measure(const struct run *r, struct outcome *ret)
{
    const double(*u)[3] = (const double(*)[3])r->state.u_mm;
    ret->strain = axis_strain_of(&r->mesh, u);
    ret->eps_max = (ret->strain.raw + ret->strain.recovered) / 2;
    ret->d_mm = r->state.d_mm;
    ret->det_F_min = body_det_F_min(&r->body, u);
}

static enum ischia_code solve_on(const struct mesh_divisions *divisions,
                                 const struct ischia_case *c, const struct variant *v,
                                 struct outcome *ret, struct ischia_error *err)
{
    struct run r = {0};
    enum ischia_code code = run_init(&r, c, divisions, v, err);
    if (code == ISCHIA_OK)
        code = path_follow(&r.body, &r.assembly, &r.seat, quarter_force_N(c->param[ISCHIA_F]), 1,
                           NULL, &r.state, &ret->path, err);
    if (code == ISCHIA_OK) measure(&r, ret);
    run_finish(&r);
    return code;
}

static enum ischia_code solve(const struct ischia_case *c, const struct variant *v,
                              struct outcome *ret, struct ischia_error *err)
{
    const struct mesh_divisions *divisions = &mesh_divisions[c->resolution];
    const struct mesh_divisions *coarser = &mesh_companions[c->resolution];
    struct outcome companion = {0};
    TRY(solve_on(divisions, c, v, ret, err));
    if (coarser->across == 0) return ISCHIA_OK;
    TRY(solve_on(coarser, c, v, &companion, err));
    const double ratio = (double)divisions->across / coarser->across;
    if (companion.path.reason < 0) ret->path.reason = companion.path.reason;
    ret->eps_max += (ret->eps_max - companion.eps_max) / (ratio * ratio - 1);
    return ISCHIA_OK;
}

/* Moves the bone alone down to d, as far in one go as leaves no element inverted. */
static enum ischia_code press(struct run *r, struct newton *newton, double d_mm,
                              const struct newton_control *control, struct newton_report *ret,
                              struct ischia_error *err)
{
    double step = d_mm - r->state.d_mm;
    ret->reason = ISCHIA_CONVERGED;
    while (r->state.d_mm < d_mm && ret->reason > 0) {
        const double from_mm = r->state.d_mm;
        r->state.d_mm = fmin(d_mm, from_mm + step);
        for (int n = 0; n < r->mesh.node_count; n++)
            if (r->mesh.node_flags[n] & NODE_ON_BONE) r->state.u_mm[n][2] = -r->state.d_mm;
        if (body_det_F_min(&r->body, (const double(*)[3])r->state.u_mm) > 0) {
            TRY(newton_minimise(newton, &r->state, control, NULL, NULL, ret, err));
        } else {
            r->state.d_mm = from_mm;
            step /= 2;
        }
    }
    return ISCHIA_OK;
}

/* Steps of displacement to travel d, each to a residual of 1e-6 of force_N. The work is summed by
 * the trapezium rule. */
static enum ischia_code small_steps(struct run *r, struct newton *newton, double d_mm,
                                    double force_N, struct path_report *ret,
                                    struct ischia_error *err)
{
    const struct newton_control control = {
        .force_N = force_N, .tolerance = 1e-6, .iterations_max = 100};
    double *before_N = calloc((size_t)r->mesh.node_count, sizeof *before_N);
    enum ischia_code code = ISCHIA_OK;
    double work = 0, friction = 0;
    struct newton_report report = {.reason = ISCHIA_CONVERGED};
    CHECK(before_N != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the contact forces");
    for (int s = 1; s <= SMALL_STEPS && code == ISCHIA_OK && report.reason > 0; s++) {
        const double last_N = r->state.force_N;
        code = press(r, newton, d_mm * s / SMALL_STEPS, &control, &report, err);
        work += d_mm / SMALL_STEPS * (last_N + r->state.force_N) / 2;
        friction += seat_advance(&r->seat, (const double(*)[3])r->state.u_mm, before_N);
        memcpy(before_N, r->seat.normal_N, sizeof *before_N * (size_t)r->mesh.node_count);
        ret->newton_iterations += report.iterations;
    }
    const double stored =
        r->state.elastic_Nmm + seat_energy(&r->seat, (const double(*)[3])r->state.u_mm);
    ret->reason = report.reason;
    ret->energy_residual = (work - stored - friction) / work;
    free(before_N);
    return code;
}

static enum ischia_code solve_in_small_steps(const struct ischia_case *c, const struct variant *v,
                                             double d_mm, struct outcome *ret,
                                             struct ischia_error *err)
{
    struct run r = {0};
    struct newton *newton = NULL;
    struct path_report report = {0};
    const double force_N = quarter_force_N(c->param[ISCHIA_F]);
    enum ischia_code code = run_init(&r, c, &mesh_divisions[c->resolution], v, err);
    if (code == ISCHIA_OK) code = newton_create(&newton, &r.body, &r.assembly, &r.seat, err);
    if (code == ISCHIA_OK) code = small_steps(&r, newton, d_mm, force_N, &report, err);
    if (code == ISCHIA_OK) {
        measure(&r, ret);
        ret->path = report;
    }
    newton_destroy(newton);
    run_finish(&r);
    return code;
}

/* eps_max of the resolution's own mesh. */
static double eps_max_of(const struct outcome *o)
{
    return (o->strain.raw + o->strain.recovered) / 2;
}

static bool is_sound(const struct outcome *o)
{
    return o->path.reason > 0 && fabs(o->path.energy_residual) <= energy_residual_max;
}

static void print_line(const char *side, const struct variant *v, const struct outcome *o,
                       double change)
{
    printf("%-4s %10g %10g %9g  %-10s %8.5f %+7.3f %% %8.5f %9.5f %8.4f %6.4f %+9.2e %10d\n", side,
           v->kappa_point_over_mu, v->kappa_corner_over_mu, v->stick_factor,
           ischia_reason_name(o->path.reason), o->eps_max, 100 * change, o->strain.raw,
           o->strain.recovered, o->d_mm, o->det_F_min, o->path.energy_residual,
           o->path.newton_iterations);
    (void)fflush(stdout);
}

/* Solves and prints a variant of the shipped model; takes note in *ret_passed when it is too far
 * from it. */
static enum ischia_code compare(const struct ischia_case *c, const char *side,
                                const struct variant *v, const struct outcome *shipped,
                                bool *ret_passed, struct ischia_error *err)
{
    struct outcome other = {0};
    TRY(solve(c, v, &other, err));
    const double change = other.eps_max / shipped->eps_max - 1;
    print_line(side, v, &other, change);
    if (!is_sound(&other) || (v->less && fabs(change) > effect_max)) *ret_passed = false;
    return ISCHIA_OK;
}

static enum ischia_code study_shipped(const struct ischia_case *c, const char *side,
                                      struct outcome *ret, struct ischia_error *err)
{
    struct ischia_solver *solver = NULL;
    struct ischia_result result = {0};
    TRY(solve(c, &variants[0], ret, err));
    print_line(side, &variants[0], ret, 0);
    TRY(ischia_solver_create(&solver, err));
    const enum ischia_code code = ischia_solve(solver, c, NULL, &result, NULL, err);
    ischia_solver_destroy(solver);
    TRY(code);
    CHECK(fabs(result.strain.eps_max - ret->eps_max) < path_effect, err, ISCHIA_E_STATE,
          "ischia_solve finds %.9f: this study's values are not the shipped ones",
          result.strain.eps_max);
    return ISCHIA_OK;
}

static enum ischia_code study(const struct side *side, enum ischia_resolution resolution,
                              bool *ret_passed, struct ischia_error *err)
{
    struct ischia_case c = ischia_case_default();
    struct outcome shipped;
    memcpy(c.param, side->param, sizeof side->param);
    c.resolution = resolution;
    TRY(study_shipped(&c, side->name, &shipped, err));
    for (size_t i = 1; i < sizeof variants / sizeof *variants; i++)
        TRY(compare(&c, side->name, &variants[i], &shipped, ret_passed, err));
    struct outcome steady = {0};
    TRY(solve_in_small_steps(&c, &variants[0], shipped.d_mm, &steady, err));
    const double change = eps_max_of(&steady) / eps_max_of(&shipped) - 1;
    print_line(side->name, &variants[0], &steady, change);
    if (!is_sound(&steady) || fabs(change) > effect_max) *ret_passed = false;
    return ISCHIA_OK;
}

static const struct side *find_side(const char *name)
{
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++)
        if (strcmp(sides[i].name, name) == 0) return &sides[i];
    return NULL;
}

int main(int argc, char **argv)
{
    int resolution = -1;
    for (int i = 0; argc > 2 && i < ISCHIA_RESOLUTION_COUNT; i++)
        if (strcmp(argv[1], ischia_resolution_names[i]) == 0) resolution = i;
    if (resolution < 0) {
        (void)fprintf(stderr, "usage: study_regularisation coarse|standard|fine SIDE ...\n");
        return 2;
    }
    bool passed = true;
    printf("side kappa_s/mu kappa_c/mu k/shipped  reason      eps_max    change      raw recovered "
           " d_mm     "
           "det F    energy iterations\n");
    for (int i = 2; i < argc; i++) {
        struct ischia_error err;
        const struct side *side = find_side(argv[i]);
        if (side == NULL ||
            study(side, (enum ischia_resolution)resolution, &passed, &err) != ISCHIA_OK) {
            (void)fprintf(stderr, "%s: %s\n", argv[i], side == NULL ? "no such side" : err.message);
            return 1;
        }
    }
    return passed ? 0 : 1;
}
