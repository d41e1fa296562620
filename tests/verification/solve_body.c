/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Solves a small body on the seat with the solver's own parts and prints mesh and solution, so that
 * another program can solve the same discrete problem: tests/verification/test_calculix.py.
 *
 * The whole bulk modulus acts at the points (kappa_point = kappa), which makes the element the
 * plain fully integrated hexahedron that other codes have. The approach d is prescribed.
 *
 * usage: solve_body PROBLEM [DECK]   DECK: also write the problem as an input deck for CalculiX
 * Lines: material TISSUE MU KAPPA | friction F | node X Y Z FLAGS UX UY UZ | hex TISSUE N0 ... N7 |
 *        approach D | force F (of the model as meshed, N) | det_F_min J
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "solver/inp.h"
#include "solver/ogden.h"
#include "solver/units.h"
#include "tests/verification/bodies.h"

struct problem {
    const char *name;
    double size_mm[3]; /* of a block; 0: the local model of `param` */
    int divisions[3];
    double param[ISCHIA_PARAM_COUNT];
    unsigned top_flags;
    int steps;
    double mu_kPa, bulk_ratio;
    double friction;
    double d_mm;
    double contact_stiffness_MPa_mm, stick_slope_MPa_mm; /* CalculiX's; 0: the exporter's own */
};

static const struct problem problems[] = {
    {.name = "uniaxial_block",
     .size_mm = {10, 10, 10},
     .divisions = {2, 2, 2},
     .top_flags = NODE_ON_PLATE,
     .mu_kPa = 5,
     .bulk_ratio = 20,
     .d_mm = 4,
     .steps = 10},
    {.name = "frictional_block",
     .size_mm = {10, 10, 10},
     .divisions = {4, 4, 4},
     .top_flags = NODE_ON_BONE,
     .mu_kPa = 5,
     .bulk_ratio = 20,
     .friction = 0.4,
     .d_mm = 4,
     .steps = 40},
    {.name = "sticking_block",
     .size_mm = {10, 10, 10},
     .divisions = {4, 4, 4},
     .top_flags = NODE_ON_BONE,
     .mu_kPa = 5,
     .bulk_ratio = 20,
     .friction = 100,
     .d_mm = 4,
     .steps = 40},
    {.name = "local_model",
     .param = {6.9, 19.7, 28, 10, 8.0, 5.0, 196}, /* row 1R of Table 2 */
     .bulk_ratio = 15,
     .friction = 0.4,
     .d_mm = 10,
     .steps = 40,
     .contact_stiffness_MPa_mm = 1,
     .stick_slope_MPa_mm = 0.5},
};

static const struct problem *find_problem(const char *name)
{
    for (size_t i = 0; i < sizeof problems / sizeof problems[0]; i++)
        if (strcmp(problems[i].name, name) == 0) return &problems[i];
    return NULL;
}

static enum ischia_code problem_mesh(struct mesh *ret, const struct problem *p,
                                     struct ischia_error *err)
{
    if (p->size_mm[0] > 0) return block_init(ret, p->size_mm, p->divisions, p->top_flags, err);
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, p->param, sizeof c.param);
    /* Few layers: the element of CalculiX, by Gauss points alone, folds in thin ones. */
    const struct mesh_divisions few = {.across = 4, .around = 2, .radial = 5, .fat = 2, .skin = 1};
    return mesh_local_init(ret, &c, &few, err);
}

static void problem_materials(const struct problem *p, struct element_material ret[TISSUE_COUNT])
{
    const struct ischia_case defaults = ischia_case_default();
    const double mu_kPa[TISSUE_COUNT] = {
        [TISSUE_MUSCLE] = p->mu_kPa > 0 ? p->mu_kPa : p->param[ISCHIA_MUM],
        [TISSUE_FAT] = p->mu_kPa > 0 ? p->mu_kPa : p->param[ISCHIA_MUF],
        [TISSUE_SKIN] = defaults.option[ISCHIA_SKIN_MU],
    };
    for (int t = 0; t < TISSUE_COUNT; t++) {
        const double mu = MPa_from_kPa(mu_kPa[t]), kappa = mu * p->bulk_ratio;
        ret[t] = (struct element_material){mu, kappa, kappa, 0};
    }
}

static void print_solution(const struct mesh *mesh, const struct body *body,
                           const struct problem *p, const struct equilibrium *state)
{
    for (int t = 0; t < TISSUE_COUNT; t++)
        printf("material %d %.17g %.17g\n", t, body->material[t].mu_MPa,
               body->material[t].kappa_MPa);
    printf("friction %.17g\n", p->friction);
    for (int n = 0; n < mesh->node_count; n++)
        printf("node %.17g %.17g %.17g %d %.17g %.17g %.17g\n", mesh->X_mm[n][0], mesh->X_mm[n][1],
               mesh->X_mm[n][2], mesh->node_flags[n], state->u_mm[n][0], state->u_mm[n][1],
               state->u_mm[n][2]);
    for (int e = 0; e < mesh->element_count; e++) {
        printf("hex %d", mesh->tissue[e]);
        for (int k = 0; k < HEX_NODES; k++) printf(" %d", mesh->hex[e][k]);
        printf("\n");
    }
    printf("approach %.17g\nforce %.17g\ndet_F_min %.17g\n", state->d_mm, state->force_N,
           body_det_F_min(body, (const double(*)[3])state->u_mm));
}

static enum ischia_code bench_run(struct bench *b, const struct problem *p,
                                  struct ischia_error *err)
{
    struct element_material material[TISSUE_COUNT];
    problem_materials(p, material);
    TRY(problem_mesh(&b->mesh, p, err));
    TRY(bench_init(b, material, p->friction, err));
    for (int s = 1; s <= p->steps; s++) {
        TRY(bench_press(b, p->d_mm * s / p->steps, err));
        (void)bench_end_step(b);
    }
    return ISCHIA_OK;
}

/* The exporter knows the plate as a bone that slides. */
static enum ischia_code write_deck(const char *path, const struct problem *p, struct bench *b,
                                   struct ischia_error *err)
{
    struct inp_model model = {.alpha = OGDEN_ALPHA,
                              .friction = p->friction,
                              .bone_slides = p->top_flags & NODE_ON_PLATE,
                              .contact_stiffness_MPa_mm = p->contact_stiffness_MPa_mm,
                              .stick_slope_MPa_mm = p->stick_slope_MPa_mm,
                              .drive = INP_DISPLACEMENT_MM,
                              .drive_value = p->d_mm,
                              .title = p->name};
    for (int t = 0; t < TISSUE_COUNT; t++)
        model.tissue[t] =
            (struct inp_tissue){b->body.material[t].mu_MPa, b->body.material[t].kappa_MPa};
    for (int n = 0; n < b->mesh.node_count; n++)
        if (b->mesh.node_flags[n] & NODE_ON_PLATE) b->mesh.node_flags[n] |= NODE_ON_BONE;
    FILE *out = fopen(path, "w");
    CHECK(out != NULL, err, ISCHIA_E_IO, "cannot write %s: %s", path, strerror(errno));
    const enum ischia_code code = inp_write(out, &b->mesh, &model, err);
    if (fclose(out) != 0 && code == ISCHIA_OK)
        return FAIL(err, ISCHIA_E_IO, "cannot write %s: %s", path, strerror(errno));
    return code;
}

int main(int argc, char **argv)
{
    struct ischia_error err;
    struct bench bench = {0};
    const struct problem *p = argc == 2 || argc == 3 ? find_problem(argv[1]) : NULL;
    if (p == NULL) {
        (void)fprintf(stderr, "usage: solve_body PROBLEM [DECK]\n");
        return 2;
    }
    enum ischia_code code = bench_run(&bench, p, &err);
    if (code == ISCHIA_OK) print_solution(&bench.mesh, &bench.body, p, &bench.state);
    if (code == ISCHIA_OK && argc == 3) code = write_deck(argv[2], p, &bench, &err);
    if (code != ISCHIA_OK) (void)fprintf(stderr, "%s\n", err.message);
    bench_finish(&bench);
    return code == ISCHIA_OK ? 0 : 1;
}
