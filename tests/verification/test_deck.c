/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The exported deck, solved by CalculiX: a sliding block against the closed form of uniaxial
 * compression, and a layered block on a frictional seat, whose strains as CalculiX prints them must
 * be those that our kinematics finds from its displacements.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "solver/inp.h"
#include "solver/kinematics.h"
#include "tests/unit/box_mesh.h"

enum { CALCULIX_SECONDS_MAX = 120, PATH_BYTES = 256, LINE_BYTES = 256, SKIPPED = 77 };

static const double mu_MPa = 8e-3, kappa_over_mu = 20, alpha = 5;

struct run {
    char folder[64];
    FILE *dat;
};

static void path_of(const struct run *run, const char *name, char ret[PATH_BYTES])
{
    (void)snprintf(ret, PATH_BYTES, "%s/%s", run->folder, name);
}

static void write_deck(const struct run *run, const struct mesh *mesh,
                       const struct inp_model *model)
{
    char path[PATH_BYTES];
    path_of(run, "job.inp", path);
    FILE *out = fopen(path, "w");
    assert_non_null(out);
    assert_int_equal(inp_write(out, mesh, model, NULL), ISCHIA_OK);
    assert_int_equal(fclose(out), 0);
}

static void become_calculix(const struct run *run)
{
    if (chdir(run->folder) != 0 || freopen("job.log", "w", stdout) == NULL) _exit(127);
    (void)setenv("OMP_NUM_THREADS", "1", 1);
    (void)alarm(CALCULIX_SECONDS_MAX);
    (void)execlp("ccx", "ccx", "-i", "job", (char *)NULL);
    _exit(127);
}

static struct run run_calculix(const struct mesh *mesh, const struct inp_model *model)
{
    struct run run = {.folder = "/tmp/ischia_deck_XXXXXX"};
    char path[PATH_BYTES];
    int status = -1;
    assert_non_null(mkdtemp(run.folder));
    write_deck(&run, mesh, model);
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) become_calculix(&run);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
    path_of(&run, "job.dat", path);
    run.dat = fopen(path, "r");
    assert_non_null(run.dat);
    return run;
}

static void run_finish(struct run *run)
{
    static const char *const left[] = {"job.inp", "job.dat", "job.log", "job.frd",
                                       "job.sta", "job.cvg", "job.12d", "spooles.out"};
    char path[PATH_BYTES];
    (void)fclose(run->dat);
    for (size_t i = 0; i < sizeof left / sizeof left[0]; i++) {
        path_of(run, left[i], path);
        (void)unlink(path);
    }
    (void)rmdir(run->folder);
}

/* Goes to the rows of the last table whose heading holds the words: after it and an empty line. */
static void seek_last_table(FILE *dat, const char *words)
{
    char line[LINE_BYTES];
    long found = -1;
    rewind(dat);
    while (fgets(line, sizeof line, dat) != NULL)
        if (strstr(line, words) != NULL) found = ftell(dat);
    assert_true(found >= 0);
    assert_int_equal(fseek(dat, found, SEEK_SET), 0);
    assert_non_null(fgets(line, sizeof line, dat));
}

/* The numbers of the next line, exactly so many. */
static void read_numbers(FILE *dat, double *ret, int count)
{
    char line[LINE_BYTES];
    assert_non_null(fgets(line, sizeof line, dat));
    char *at = line;
    for (int i = 0; i < count; i++) {
        char *end = at;
        ret[i] = strtod(at, &end);
        assert_true(end != at);
        at = end;
    }
    assert_int_equal(strspn(at, " \n"), strlen(at));
}

static double *displacements(const struct run *run, const struct mesh *mesh)
{
    double *u = box_alloc((size_t)mesh->node_count * 3, sizeof *u), row[4];
    seek_last_table(run->dat, "for set BODY");
    for (int n = 0; n < mesh->node_count; n++) {
        read_numbers(run->dat, row, 4);
        assert_true(row[0] == n + 1);
        memcpy(&u[3 * n], &row[1], 3 * sizeof *u);
    }
    return u;
}

/* Force of the body on the seat. */
static void seat_force(const struct run *run, double ret_N[3])
{
    seek_last_table(run->dat, "total force");
    read_numbers(run->dat, ret_N, 3);
}

static struct inp_tissue tissue(double factor)
{
    return (struct inp_tissue){factor * mu_MPa, factor * mu_MPa * kappa_over_mu};
}

/* Nominal stresses under stretches (side, side, along), from the energy by hand. */
static void nominal_stress(double side, double along, double *ret_side, double *ret_along)
{
    const double J = side * side * along, scale = pow(J, -1.0 / 3);
    const double b_side = pow(scale * side, alpha), b_along = pow(scale * along, alpha);
    const double mean = (2 * b_side + b_along) / 3, kappa = kappa_over_mu * mu_MPa;
    *ret_side = 2 * mu_MPa / alpha * (b_side - mean) / side + kappa * (J - 1) * side * along;
    *ret_along = 2 * mu_MPa / alpha * (b_along - mean) / along + kappa * (J - 1) * side * side;
}

/* The lateral stretch at which the sides are free of stress. */
static double free_side_stretch(double along, double *ret_along_MPa)
{
    double low = 1, high = 3, side_MPa = 0;
    for (int i = 0; i < 100; i++) {
        const double side = 0.5 * (low + high);
        nominal_stress(side, along, &side_MPa, ret_along_MPa);
        if (side_MPa > 0)
            high = side;
        else
            low = side;
    }
    return 0.5 * (low + high);
}

static void a_sliding_block_follows_the_closed_form(void **state)
{
    (void)state;
    const struct box cube = {{2, 2, 2}, {10, 10, 10}, 0, 0};
    const struct inp_model model = {.tissue = {tissue(1), tissue(1), tissue(1)},
                                    .alpha = alpha,
                                    .bone_slides = true,
                                    .drive = INP_DISPLACEMENT_MM,
                                    .drive_value = 4,
                                    .title = "uniaxial block"};
    struct mesh mesh = box_mesh(&cube);
    struct run run = run_calculix(&mesh, &model);
    double *u = displacements(&run, &mesh), force[3], stress = 0;
    seat_force(&run, force);
    const double side = free_side_stretch(0.6, &stress);
    for (int n = 0; n < mesh.node_count; n++) {
        const double *X = mesh.X_mm[n];
        assert_true(fabs(u[3 * n] - (side - 1) * X[0]) < 1e-3);
        assert_true(fabs(u[3 * n + 1] - (side - 1) * X[1]) < 1e-3);
        assert_true(fabs(u[3 * n + 2] - (0.6 - 1) * X[2]) < 1e-3);
    }
    assert_true(fabs(fabs(force[2]) / (-stress * 100) - 1) < 2e-4);
    free(u);
    run_finish(&run);
    box_mesh_free(&mesh);
}

/* E = (F^T F - I)/2 in CalculiX's order xx yy zz xy xz yz. */
static void green_lagrange_tensor(const struct mesh *mesh, const double *u, int element, int point,
                                  double ret[6])
{
    static const int pair[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
    const struct hex_corners X = hex_gather(mesh->hex[element], &mesh->X_mm[0][0]);
    const struct hex_corners ue = hex_gather(mesh->hex[element], u);
    const struct hex_point p = hex_point_at(&X, point);
    double F[3][3];
    deformation_gradient(&p, &ue, F);
    for (int k = 0; k < 6; k++) {
        const int i = pair[k][0], j = pair[k][1];
        ret[k] = 0.5 * (F[0][i] * F[0][j] + F[1][i] * F[1][j] + F[2][i] * F[2][j] - (i == j));
    }
}

static void compare_strains(const struct run *run, const struct mesh *mesh, const double *u)
{
    /* CalculiX counts points along x, then y, then z; ours follow the corners. */
    static const int corner_of_point[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    double largest = 0;
    seek_last_table(run->dat, "strains");
    for (int i = 0; i < 8 * mesh->element_count; i++) {
        double ours[6], row[8];
        read_numbers(run->dat, row, 8);
        const double *theirs = &row[2];
        green_lagrange_tensor(mesh, u, (int)row[0] - 1, corner_of_point[(int)row[1] - 1], ours);
        for (int k = 0; k < 6; k++) assert_true(fabs(ours[k] - theirs[k]) < 1e-5);
        largest = fmax(largest, fabs(theirs[2]));
    }
    assert_true(largest > 0.2);
}

static void a_layered_block_carries_its_force_with_friction(void **state)
{
    (void)state;
    const struct box block = {{3, 3, 4}, {9, 9, 8}, 1, 1};
    const struct inp_model model = {.tissue = {tissue(1), tissue(0.6), tissue(4)},
                                    .alpha = alpha,
                                    .friction = 0.4,
                                    .drive = INP_FORCE_N,
                                    .drive_value = 1.2,
                                    .title = "layered block"};
    struct mesh mesh = box_mesh(&block);
    struct run run = run_calculix(&mesh, &model);
    double *u = displacements(&run, &mesh), force[3];
    seat_force(&run, force);
    assert_true(fabs(fabs(force[2]) - 1.2) < 1e-4);
    assert_true(hypot(force[0], force[1]) <= 0.4 * 1.2 * sqrt(2.0));
    assert_true(hypot(force[0], force[1]) > 0.02);
    compare_strains(&run, &mesh, u);
    free(u);
    run_finish(&run);
    box_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sliding_block_follows_the_closed_form),
        cmocka_unit_test(a_layered_block_carries_its_force_with_friction),
    };
    if (access("/usr/bin/ccx", X_OK) != 0) return SKIPPED;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
