/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What the numerical choices of the model do to eps_max: the corners' share c in the rule for the
 * isochoric energy (element.h), a point-wise share kappa_s of the bulk modulus, which is not
 * shipped, and the stiffness k of the friction springs (seat.h). Each is varied with the others at
 * their shipped values; nothing but these numbers changes from run to run. A last line takes the
 * load path, whose friction history depends on the steps, in SMALL_STEPS equal steps to the same
 * travel.
 *
 * usage: study_regularisation RESOLUTION SIDE ...    e.g. study_regularisation standard 1R 9R
 * Fails when the shipped values are not those of ischia_solve, a run does not converge, when
 * stiffer friction springs or shorter steps move eps_max by more than effect_max, when a
 * neighbouring rule moves it by more than the shipped result's own error estimate, or when an
 * energy balance is off.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "solver/units.h"
#include "tests/verification/sides.h"

static const double effect_max = 5e-3, path_effect = 1e-3;
enum { SMALL_STEPS = 200 };
/* solver.c's constants first, then one varied at a time. */
/* OTHER_RULE: about as good as the shipped one, so within its error. SHOWN: worse, not judged. */
enum variant_kind { OTHER_RULE, LESS_REGULARISED, SHOWN };
static const struct {
    struct variant variant;
    enum variant_kind kind;
} variants[] = {
    {{0.4, 0, 1}, OTHER_RULE},
    {{0.2, 0, 1}, OTHER_RULE},
    {{0.7, 0, 1}, OTHER_RULE},
    {{1, 0, 1}, SHOWN},
    {{0.4, 1, 1}, SHOWN},
    {{0.4, 0, 0.25}, SHOWN},
    {{0.4, 0, 4}, LESS_REGULARISED},
};

static enum ischia_code solve(const struct ischia_case *c, const struct variant *v,
                              struct outcome *ret, struct ischia_error *err)
{
    return solve_on(&mesh_divisions[c->resolution], c, v, ret, err);
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
        run_measure(&r, ret);
        ret->path = report;
    }
    newton_destroy(newton);
    run_finish(&r);
    return code;
}

static void print_line(const char *side, const struct variant *v, const struct outcome *o,
                       double change)
{
    printf("%-4s %10g %10g %9g  %-10s %8.5f %+7.3f %% %8.5f %9.5f %8.4f %6.4f %+9.2e %10d\n", side,
           v->corner_share, v->kappa_point_over_mu, v->stick_factor,
           ischia_reason_name(o->path.reason), o->eps_max, 100 * change, o->strain.raw,
           o->strain.recovered, o->d_mm, o->det_F_min, o->path.energy_residual,
           o->path.newton_iterations);
    (void)fflush(stdout);
}

/* What a result says by itself. */
struct shipped {
    struct outcome outcome;
    double error; /* of eps_max, absolute */
};

/* How far a kind of variant may move eps_max, relative. */
static double change_max(enum variant_kind kind, const struct shipped *shipped)
{
    const double most[] = {[OTHER_RULE] = shipped->error / shipped->outcome.eps_max,
                           [LESS_REGULARISED] = effect_max,
                           [SHOWN] = HUGE_VAL};
    return most[kind];
}

/* Solves and prints variants[i]; takes note in *ret_passed when it is too far from the shipped. */
static enum ischia_code compare(const struct ischia_case *c, const char *side, size_t i,
                                const struct shipped *shipped, bool *ret_passed,
                                struct ischia_error *err)
{
    struct outcome other = {0};
    TRY(solve(c, &variants[i].variant, &other, err));
    const double change = other.eps_max / shipped->outcome.eps_max - 1;
    print_line(side, &variants[i].variant, &other, change);
    if (!is_sound(&other) || fabs(change) > change_max(variants[i].kind, shipped))
        *ret_passed = false;
    return ISCHIA_OK;
}

static enum ischia_code study_shipped(const struct ischia_case *c, const char *side,
                                      struct shipped *ret, struct ischia_error *err)
{
    struct ischia_solver *solver = NULL;
    struct ischia_result result = {0};
    TRY(solve(c, &variants[0].variant, &ret->outcome, err));
    print_line(side, &variants[0].variant, &ret->outcome, 0);
    TRY(ischia_solver_create(&solver, err));
    const enum ischia_code code = ischia_solve(solver, c, NULL, &result, NULL, err);
    ischia_solver_destroy(solver);
    TRY(code);
    CHECK(fabs(result.strain.eps_max - ret->outcome.eps_max) < path_effect, err, ISCHIA_E_STATE,
          "ischia_solve finds %.9f: this study's values are not the shipped ones",
          result.strain.eps_max);
    ret->error = result.numerics.eps_max_error;
    return ISCHIA_OK;
}

static enum ischia_code study(const struct side *side, enum ischia_resolution resolution,
                              bool *ret_passed, struct ischia_error *err)
{
    const struct ischia_case c = side_case(side, resolution);
    struct shipped shipped = {0};
    TRY(study_shipped(&c, side->name, &shipped, err));
    for (size_t i = 1; i < sizeof variants / sizeof *variants; i++)
        TRY(compare(&c, side->name, i, &shipped, ret_passed, err));
    struct outcome steady = {0};
    TRY(solve_in_small_steps(&c, &variants[0].variant, shipped.outcome.d_mm, &steady, err));
    const double change = steady.eps_max / shipped.outcome.eps_max - 1;
    print_line(side->name, &variants[0].variant, &steady, change);
    if (!is_sound(&steady) || fabs(change) > effect_max) *ret_passed = false;
    return ISCHIA_OK;
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
    printf("side    corners kappa_s/mu k/shipped  reason      eps_max    change      raw recovered "
           " d_mm     "
           "det F    energy iterations\n");
    for (int i = 2; i < argc; i++) {
        struct ischia_error err;
        const struct side *side = side_of(argv[i]);
        if (side == NULL ||
            study(side, (enum ischia_resolution)resolution, &passed, &err) != ISCHIA_OK) {
            (void)fprintf(stderr, "%s: %s\n", argv[i], side == NULL ? "no such side" : err.message);
            return 1;
        }
    }
    return passed ? 0 : 1;
}
