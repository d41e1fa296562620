/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Every allocation of what looks at a solved field fails once, in turn: the call must say so, leave
 * its outputs alone and leak nothing (the sanitizer build and valgrind look for leaks). The linker
 * sends malloc and calloc through here (-Wl,--wrap).
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "solver/clusters.h"
#include "solver/inp.h"
#include "solver/seat_pressure.h"
#include "solver/section_svg.h"
#include "solver/vtu.h"
#include "tests/unit/box_mesh.h"
#include "tests/unit/labels.h"

enum { NEVER = -1, ALLOCATIONS_MAX = 100 };

static int allocations_left = NEVER;

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);

static bool is_refused(void)
{
    if (allocations_left == NEVER) return false;
    return allocations_left-- == 0;
}

void *__wrap_malloc(size_t size) { return is_refused() ? NULL : __real_malloc(size); }

void *__wrap_calloc(size_t count, size_t size)
{
    return is_refused() ? NULL : __real_calloc(count, size);
}

struct world {
    struct mesh mesh;
    double *u;
    struct strain_field field;
    struct ischia_case c;
    FILE *out;
};

static enum ischia_code strains(struct world *w, struct ischia_error *err)
{
    struct strain_field field;
    TRY(strain_field_init(&field, &w->mesh, w->u, err));
    strain_field_finish(&field);
    return ISCHIA_OK;
}

static enum ischia_code clusters(struct world *w, struct ischia_error *err)
{
    struct ischia_cluster_set sets[ISCHIA_CRITERION_COUNT];
    memset(sets, 0x5a, sizeof sets);
    const enum ischia_code code = clusters_find_all(&w->mesh, &w->field, sets, err);
    if (code != ISCHIA_OK) assert_int_equal(sets[0].count, 0x5a5a5a5a);
    return code;
}

static enum ischia_code pressure(struct world *w, struct ischia_error *err)
{
    const struct seat_state state = {w->u, w->u};
    struct ischia_seat seat = {.contact_area_mm2 = -7};
    const enum ischia_code code = seat_pressure(&w->mesh, &state, &seat, err);
    if (code != ISCHIA_OK) assert_true(seat.contact_area_mm2 == -7);
    return code;
}

static enum ischia_code vtu(struct world *w, struct ischia_error *err)
{
    return vtu_write(w->out, &w->c, &w->mesh, w->u, err);
}

static enum ischia_code section(struct world *w, struct ischia_error *err)
{
    return section_svg_write(w->out, &w->c, &w->mesh, w->u, &labels, err);
}

static enum ischia_code deck(struct world *w, struct ischia_error *err)
{
    const struct inp_tissue soft = {0.01, 0.1};
    const struct inp_model model = {
        .tissue = {soft, soft, soft}, .alpha = 5, .drive_value = 1, .title = "box"};
    return inp_write(w->out, &w->mesh, &model, err);
}

static struct world world_make(void)
{
    const struct box box = {{2, 2, 3}, {4, 4, 6}, 1, 1};
    double A[3][3] = {{2, 0, 0}, {0, 2, 0}, {0, 0, 0.25}};
    struct world w = {.mesh = box_mesh(&box), .c = ischia_case_default()};
    w.u = box_displacement(&w.mesh, A);
    assert_int_equal(strain_field_init(&w.field, &w.mesh, w.u, NULL), ISCHIA_OK);
    w.out = fopen("/dev/null", "w");
    assert_non_null(w.out);
    return w;
}

static void world_free(struct world *w)
{
    (void)fclose(w->out);
    strain_field_finish(&w->field);
    free(w->u);
    box_mesh_free(&w->mesh);
}

/* Fails allocation 0, 1, ... until the operation gets all that it asks for. */
static int failures_of(struct world *w,
                       enum ischia_code (*run)(struct world *w, struct ischia_error *err))
{
    struct ischia_error err;
    for (int n = 0; n < ALLOCATIONS_MAX; n++) {
        err.message[0] = '\0';
        allocations_left = n;
        const enum ischia_code code = run(w, &err);
        const bool reached = allocations_left < 0;
        allocations_left = NEVER;
        if (!reached) {
            assert_int_equal(code, ISCHIA_OK);
            return n;
        }
        assert_int_equal(code, ISCHIA_E_MEMORY);
        assert_non_null(strstr(err.message, "memory"));
    }
    return ALLOCATIONS_MAX;
}

static void every_failed_allocation_is_reported(void **state)
{
    (void)state;
    static const struct {
        enum ischia_code (*run)(struct world *w, struct ischia_error *err);
        int allocations_min;
    } operations[] = {{strains, 1}, {clusters, 12}, {pressure, 1},
                      {vtu, 8},     {section, 7},   {deck, 2}};
    struct world w = world_make();
    for (size_t i = 0; i < sizeof operations / sizeof operations[0]; i++) {
        const int failures = failures_of(&w, operations[i].run);
        assert_in_range(failures, operations[i].allocations_min, ALLOCATIONS_MAX - 1);
    }
    world_free(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_failed_allocation_is_reported)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
