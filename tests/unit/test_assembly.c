/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/assembly.h"
#include "tests/unit/box_mesh.h"
#include "tests/unit/near.h"

static const struct box small = {{2, 3, 2}, {4, 6, 4}, 0, 0};

static struct assembly assembly_of(const struct mesh *mesh)
{
    struct assembly a = {0};
    struct ischia_error err;
    if (assembly_init(&a, mesh, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    return a;
}

static void equations_follow_the_flags(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&small);
    struct assembly a = assembly_of(&mesh);
    int expected = 0;
    unsigned char *taken = calloc((size_t)a.n, 1); /* the order is the factorisation's affair */
    assert_non_null(taken);
    for (int n = 0; n < mesh.node_count; n++) {
        static const unsigned plane[3] = {NODE_ON_X0, NODE_ON_Y0, 0};
        const unsigned flags = mesh.node_flags[n];
        for (int c = 0; c < 3; c++) {
            if (flags & NODE_ON_BONE)
                assert_int_equal(a.equation[n][c], c == 2 ? EQUATION_BONE : EQUATION_FIXED);
            else if (flags & plane[c])
                assert_int_equal(a.equation[n][c], EQUATION_FIXED);
            else {
                assert_in_range(a.equation[n][c], 0, a.n - 1);
                assert_false(taken[a.equation[n][c]]++);
                expected++;
            }
        }
    }
    assert_int_equal(a.n, expected);
    free(taken);
    assembly_finish(&a);
    box_mesh_free(&mesh);
}

/* Symmetric, another one for each element. */
static double element_entry(int e, int p, int q)
{
    return sin(3.0 * e + 0.7 * (p + q) + 0.11 * p * q);
}

static void scatter_all(const struct assembly *a, const struct mesh *mesh, double *dense)
{
    double *values = linear_values(a->linear);
    linear_clear(a->linear);
    for (int e = 0; e < mesh->element_count; e++) {
        int eq[HEX_DOFS];
        const int *scatter = assembly_element_scatter(a, e);
        assembly_element_equations(a, mesh->hex[e], HEX_NODES, eq);
        for (int p = 0, k = 0; p < HEX_DOFS; p++)
            for (int q = 0; q <= p; q++, k++) {
                const int place = scatter[k];
                assert_true((place >= 0) == (eq[p] >= 0 && eq[q] >= 0));
                if (place < 0) continue;
                values[place] += element_entry(e, p, q);
                dense[eq[p] * a->n + eq[q]] += element_entry(e, p, q);
                if (p != q) dense[eq[q] * a->n + eq[p]] += element_entry(e, p, q);
            }
    }
}

/* The sparse matrix, column by column, is what a dense assembly gives. */
static void matrix_is_the_dense_one(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&small);
    struct assembly a = assembly_of(&mesh);
    const size_t n = (size_t)a.n;
    double *dense = box_alloc(n * n, sizeof *dense);
    double *unit = box_alloc(n, sizeof *unit), *column = box_alloc(n, sizeof *column);
    scatter_all(&a, &mesh, dense);
    for (size_t j = 0; j < n; j++) {
        unit[j] = 1;
        linear_multiply(a.linear, unit, column);
        unit[j] = 0;
        for (size_t i = 0; i < n; i++) assert_near(column[i], dense[i * n + j], 1e-13);
    }
    free(dense);
    free(unit);
    free(column);
    assembly_finish(&a);
    box_mesh_free(&mesh);
}

/* Writing through diagonal and tangential changes exactly those entries. */
static void places_of_a_node_are_its_own(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&small);
    struct assembly a = assembly_of(&mesh);
    double *unit = box_alloc((size_t)a.n, sizeof *unit);
    double *column = box_alloc((size_t)a.n, sizeof *column);
    for (int node = 0; node < mesh.node_count; node++) {
        const int *eq = a.equation[node];
        assert_true((a.tangential[node] >= 0) == (eq[0] >= 0 && eq[1] >= 0));
        for (int c = 0; c < 3; c++) {
            assert_true((a.diagonal[node][c] >= 0) == (eq[c] >= 0));
            if (eq[c] < 0) continue;
            linear_clear(a.linear);
            linear_values(a.linear)[a.diagonal[node][c]] = 2;
            if (c < 2 && a.tangential[node] >= 0) linear_values(a.linear)[a.tangential[node]] = 5;
            unit[eq[c]] = 1;
            linear_multiply(a.linear, unit, column);
            unit[eq[c]] = 0;
            assert_true(column[eq[c]] == 2);
            if (c < 2 && a.tangential[node] >= 0) assert_true(column[eq[1 - c]] == 5);
        }
    }
    free(unit);
    free(column);
    assembly_finish(&a);
    box_mesh_free(&mesh);
}

/* One element of all nodes of a box of 2 x 2 x 2: all its equations act on each other. */
static void other_elements_take_the_nodes_of_the_mesh(void **state)
{
    (void)state;
    static const struct box eight = {{2, 2, 2}, {4, 4, 4}, 0, 0};
    enum { NODES = 27, ENTRIES = 3 * NODES * (3 * NODES + 1) / 2 };
    struct mesh mesh = box_mesh(&eight);
    struct assembly a = {0};
    struct ischia_error err;
    int node[NODES], eq[3 * NODES], last = -1;
    for (int n = 0; n < NODES; n++) node[n] = NODES - 1 - n;
    const struct connectivity whole = {1, NODES, node};
    assert_int_equal(mesh.node_count, NODES);
    assert_int_equal(assembly_init_elements(&a, &mesh, &whole, &err), ISCHIA_OK);
    assert_int_equal(a.entries, ENTRIES);
    assembly_element_equations(&a, node, NODES, eq);
    const int *place = assembly_element_scatter(&a, 0);
    for (int p = 0; p < 3 * NODES; p++)
        for (int q = 0; q <= p; q++, place++) {
            assert_int_equal(eq[p], a.equation[node[p % NODES]][p / NODES]);
            assert_true((*place >= 0) == (eq[p] >= 0 && eq[q] >= 0));
            if (*place > last) last = *place;
        }
    assert_int_equal(last + 1, a.n * (a.n + 1) / 2);
    assembly_finish(&a);
    box_mesh_free(&mesh);
}

static void success_leaves_the_error_alone(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&small);
    struct assembly a;
    struct ischia_error err = {.code = ISCHIA_OK, .message = "as it was", .line = 7};
    assert_int_equal(assembly_init(&a, &mesh, &err), ISCHIA_OK);
    assert_int_equal(err.code, ISCHIA_OK);
    assert_string_equal(err.message, "as it was");
    assert_int_equal(err.line, 7);
    assembly_finish(&a);
    assembly_finish(&(struct assembly){0});
    box_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equations_follow_the_flags),
        cmocka_unit_test(matrix_is_the_dense_one),
        cmocka_unit_test(places_of_a_node_are_its_own),
        cmocka_unit_test(other_elements_take_the_nodes_of_the_mesh),
        cmocka_unit_test(success_leaves_the_error_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
