/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Where the time of a solve goes: bench_solve CASES.csv RESOLUTION [-w] [-r REPEATS] [ROW ...],
 * with the columns R1,R2,eM,eF,muM,muF,F in the order of the parameter table (other columns are
 * skipped by name). Each row is solved on this thread, from rest or, with -w (warm), by a solver
 * that has just solved the row with nine tenths of its force; the phases are timed around the
 * solver's own calls, put between at link time (--wrap), so that the solver itself holds no clock.
 * CPU seconds.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#include "server/blas_environment.h"
#include "solver/body.h"
#include "solver/contact.h"
#include "solver/solver.h"

static const double warm_share = 0.9; /* of a row's force, solved before it */

struct arguments {
    bool warm;
    int repeats;
};

enum phase { ASSEMBLY, ENERGY, FACTORISATION, SOLVES, CONTACT, SETUP, PHASE_COUNT };
static const char *const phase_names[] = {"assembly", "energy",  "factor",
                                          "solve",    "contact", "setup"};

static struct {
    double seconds;
    long calls;
} spent[PHASE_COUNT];

static double cpu_seconds(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void book(enum phase phase, double since)
{
    spent[phase].seconds += cpu_seconds() - since;
    spent[phase].calls++;
}

/* --- between the solver and its parts --------------------------------------------------------- */

double __real_body_linearise(struct body *, const struct assembly *, const double (*)[3], double,
                             struct body_derivatives *);
double __wrap_body_linearise(struct body *body, const struct assembly *assembly,
                             const double (*u_mm)[3], double convexity,
                             struct body_derivatives *ret);
double __wrap_body_linearise(struct body *body, const struct assembly *assembly,
                             const double (*u_mm)[3], double convexity,
                             struct body_derivatives *ret)
{
    const double since = cpu_seconds();
    const double energy = __real_body_linearise(body, assembly, u_mm, convexity, ret);
    book(ASSEMBLY, since);
    return energy;
}

double __real_body_energy(const struct body *, const double (*)[3]);
double __wrap_body_energy(const struct body *body, const double (*u_mm)[3]);
double __wrap_body_energy(const struct body *body, const double (*u_mm)[3])
{
    const double since = cpu_seconds();
    const double energy = __real_body_energy(body, u_mm);
    book(ENERGY, since);
    return energy;
}

enum ischia_code __real_linear_factor(struct linear *, const unsigned char *, enum linear_outcome *,
                                      struct ischia_error *);
enum ischia_code __wrap_linear_factor(struct linear *linear, const unsigned char *keep,
                                      enum linear_outcome *ret_outcome, struct ischia_error *err);
enum ischia_code __wrap_linear_factor(struct linear *linear, const unsigned char *keep,
                                      enum linear_outcome *ret_outcome, struct ischia_error *err)
{
    const double since = cpu_seconds();
    const enum ischia_code code = __real_linear_factor(linear, keep, ret_outcome, err);
    book(FACTORISATION, since);
    return code;
}

enum ischia_code __real_linear_reduce(struct linear *linear, int count, double *x,
                                      struct ischia_error *err);
enum ischia_code __wrap_linear_reduce(struct linear *linear, int count, double *x,
                                      struct ischia_error *err);
enum ischia_code __wrap_linear_reduce(struct linear *linear, int count, double *x,
                                      struct ischia_error *err)
{
    const double since = cpu_seconds();
    const enum ischia_code code = __real_linear_reduce(linear, count, x, err);
    book(SOLVES, since);
    return code;
}

enum ischia_code __real_linear_expand(struct linear *linear, double *x, struct ischia_error *err);
enum ischia_code __wrap_linear_expand(struct linear *linear, double *x, struct ischia_error *err);
enum ischia_code __wrap_linear_expand(struct linear *linear, double *x, struct ischia_error *err)
{
    const double since = cpu_seconds();
    const enum ischia_code code = __real_linear_expand(linear, x, err);
    book(SOLVES, since);
    return code;
}

bool __real_contact_solve(struct contact *contact, const struct seat *seat, const double (*u_mm)[3],
                          enum contact_friction friction, double *du, double *dd, double *normal_N);
bool __wrap_contact_solve(struct contact *contact, const struct seat *seat, const double (*u_mm)[3],
                          enum contact_friction friction, double *du, double *dd, double *normal_N);
bool __wrap_contact_solve(struct contact *contact, const struct seat *seat, const double (*u_mm)[3],
                          enum contact_friction friction, double *du, double *dd, double *normal_N)
{
    const double since = cpu_seconds();
    const bool code = __real_contact_solve(contact, seat, u_mm, friction, du, dd, normal_N);
    book(CONTACT, since);
    return code;
}

bool __real_contact_is_stable(struct contact *contact, const struct seat *seat);
bool __wrap_contact_is_stable(struct contact *contact, const struct seat *seat);
bool __wrap_contact_is_stable(struct contact *contact, const struct seat *seat)
{
    const double since = cpu_seconds();
    const bool code = __real_contact_is_stable(contact, seat);
    book(CONTACT, since);
    return code;
}

enum ischia_code __real_assembly_init(struct assembly *, const struct mesh *,
                                      struct ischia_error *);
enum ischia_code __wrap_assembly_init(struct assembly *ret, const struct mesh *mesh,
                                      struct ischia_error *err);
enum ischia_code __wrap_assembly_init(struct assembly *ret, const struct mesh *mesh,
                                      struct ischia_error *err)
{
    const double since = cpu_seconds();
    const enum ischia_code code = __real_assembly_init(ret, mesh, err);
    book(SETUP, since);
    return code;
}

/* --- cases ------------------------------------------------------------------------------------ */

enum { CASES_MAX = 4096, LINE_MAX_BYTES = 1024, FIELDS_MAX = 32 };

struct row {
    char label[64];
    struct ischia_case c;
    double total_s, phase_s[PHASE_COUNT];
    struct ischia_result result;
};

static int split(char *line, char **ret)
{
    int count = 0;
    line[strcspn(line, "\r\n")] = '\0';
    for (char *rest = line; rest != NULL && count < FIELDS_MAX;) ret[count++] = strsep(&rest, ",");
    return count;
}

/* Column of each parameter, by its bare name or the part of the header before "_". */
static void map_columns(char *header, int ret[ISCHIA_PARAM_COUNT])
{
    char *name[FIELDS_MAX];
    const int count = split(header, name);
    for (int i = 0; i < count; i++)
        for (int p = 0; p < ISCHIA_PARAM_COUNT; p++)
            if (strcspn(name[i], "_") == strlen(ischia_params[p].key) &&
                strncmp(name[i], ischia_params[p].key, strcspn(name[i], "_")) == 0)
                ret[p] = i;
}

static int read_rows(const char *path, enum ischia_resolution resolution, struct row *rows)
{
    char line[LINE_MAX_BYTES], *field[FIELDS_MAX];
    int column[ISCHIA_PARAM_COUNT] = {0}, count = 0;
    FILE *in = fopen(path, "r");
    if (in == NULL || fgets(line, sizeof line, in) == NULL) return -1;
    map_columns(line, column);
    while (count < CASES_MAX && fgets(line, sizeof line, in) != NULL) {
        const int fields = split(line, field);
        if (fields < ISCHIA_PARAM_COUNT) continue;
        struct row *row = &rows[count++];
        *row = (struct row){.c = ischia_case_default()};
        row->c.resolution = resolution;
        (void)snprintf(row->label, sizeof row->label, "%d", count);
        for (int p = 0; p < ISCHIA_PARAM_COUNT; p++)
            row->c.param[p] = strtod(field[column[p]], NULL);
    }
    (void)fclose(in);
    return count;
}

static void solve(struct ischia_solver *solver, const struct ischia_case *c, struct row *row)
{
    struct ischia_error err = {0};
    if (ischia_solve(solver, c, NULL, &row->result, NULL, &err) == ISCHIA_OK) return;
    (void)fprintf(stderr, "row %s: %s\n", row->label, err.message);
    exit(1);
}

static void solve_row(struct ischia_solver *solver, struct row *row, const struct arguments *a)
{
    struct ischia_case less = row->c;
    less.param[ISCHIA_F] *= warm_share;
    for (int k = 0; k < a->repeats; k++) {
        ischia_solver_forget(solver);
        if (a->warm) solve(solver, &less, row);
        memset(spent, 0, sizeof spent);
        const double since = cpu_seconds();
        solve(solver, &row->c, row);
        const double total = cpu_seconds() - since;
        if (k > 0 && total >= row->total_s) continue;
        row->total_s = total;
        for (int p = 0; p < PHASE_COUNT; p++) row->phase_s[p] = spent[p].seconds;
    }
}

static void print_row(const struct row *row)
{
    const struct ischia_numerics *n = &row->result.numerics;
    double other = row->total_s;
    (void)printf("%-5s %7.3f", row->label, row->total_s);
    for (int p = 0; p < PHASE_COUNT; p++) {
        (void)printf(" %8.3f", row->phase_s[p]);
        other -= row->phase_s[p];
    }
    (void)printf(" %7.3f %6d %6d %6d %6d  %7.4f %6.4f %8.1e %s\n", other, n->load_steps,
                 n->newton_iterations, n->factorisations, n->dof, row->result.strain.eps_max,
                 n->eps_max_error, n->energy_residual, ischia_reason_name(n->reason));
    (void)fflush(stdout);
}

static int compare_totals(const void *a, const void *b)
{
    const double x = ((const struct row *)a)->total_s, y = ((const struct row *)b)->total_s;
    return (x > y) - (x < y);
}

static void print_summary(struct row *rows, int count)
{
    struct rusage usage;
    (void)getrusage(RUSAGE_SELF, &usage);
    qsort(rows, (size_t)count, sizeof *rows, compare_totals);
    (void)printf("CPU seconds: least %.3f, median %.3f, most %.3f; peak memory %.0f MB\n",
                 rows[0].total_s, (rows[(count - 1) / 2].total_s + rows[count / 2].total_s) / 2,
                 rows[count - 1].total_s, (double)usage.ru_maxrss / 1024);
}

static bool chosen(const char *label, int argc, char **argv)
{
    for (int i = 0; i < argc; i++)
        if (strcmp(argv[i], label) == 0) return true;
    return argc == 0;
}

static void print_header(void)
{
    (void)printf("row     total");
    for (int p = 0; p < PHASE_COUNT; p++) (void)printf(" %8s", phase_names[p]);
    (void)printf("   other  steps  iters factor    dof  eps_max  error   energy outcome\n");
}

static bool resolution_from_name(const char *name, enum ischia_resolution *ret)
{
    for (int r = 0; r < ISCHIA_RESOLUTION_COUNT; r++)
        if (strcmp(name, ischia_resolution_names[r]) == 0) {
            *ret = (enum ischia_resolution)r;
            return true;
        }
    return false;
}

int main(int argc, char **argv)
{
    static struct row rows[CASES_MAX];
    enum ischia_resolution resolution;
    struct ischia_solver *solver = NULL;
    struct arguments a = {.repeats = 1};
    int first = 3;
    if (argc > first && strcmp(argv[first], "-w") == 0) {
        a.warm = true;
        first++;
    }
    if (argc > first + 1 && strcmp(argv[first], "-r") == 0) {
        a.repeats = (int)strtol(argv[first + 1], NULL, 10);
        first += 2;
    }
    blas_environment_ensure("bench_solve", argv);
    if (argc < 3 || !resolution_from_name(argv[2], &resolution)) {
        (void)fprintf(stderr,
                      "usage: bench_solve CASES.csv RESOLUTION [-w] [-r REPEATS] [ROW ...]\n");
        return 2;
    }
    const int count = read_rows(argv[1], resolution, rows);
    if (count < 1 || ischia_solver_create(&solver, NULL) != ISCHIA_OK) return 1;
    int solved = 0;
    print_header();
    for (int i = 0; i < count; i++) {
        if (!chosen(rows[i].label, argc - first, argv + first)) continue;
        solve_row(solver, &rows[i], &a);
        print_row(&rows[i]);
        rows[solved++] = rows[i];
    }
    if (solved > 0) print_summary(rows, solved);
    ischia_solver_destroy(solver);
    return 0;
}
