/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "server/cli/field_blob.h"

enum { NODES = 4000 };

/* Smooth along the node numbers, as a field on a structured mesh is. */
static double *make_field(void)
{
    double *field = malloc(3 * NODES * sizeof *field);
    assert_non_null(field);
    for (int node = 0; node < NODES; node++) {
        field[3 * node] = sin(node * 0.01) * 7.3;
        field[3 * node + 1] = -cos(node * 0.013) * 900.0;
        field[3 * node + 2] = node % 2 == 0 ? 0.0 : -1e-7 * node;
    }
    return field;
}

static void test_comes_back_within_half_a_unit(void **state)
{
    (void)state;
    double *field = make_field(), *back = NULL;
    unsigned char *bytes = NULL;
    size_t size = 0, nodes = 0;
    struct ischia_error err = {0};
    assert_int_equal(field_blob_encode(field, NODES, &bytes, &size, &err), ISCHIA_OK);
    assert_true(size < 3 * NODES * 4); /* smaller than single precision */
    assert_int_equal(field_blob_decode(bytes, size, &back, &nodes, &err), ISCHIA_OK);
    assert_int_equal(nodes, NODES);
    for (int i = 0; i < 3 * NODES; i++) assert_true(fabs(back[i] - field[i]) <= 0.5 / 1048576);
    unsigned char *again = NULL;
    size_t again_size = 0; /* what was kept once is kept the same for ever */
    assert_int_equal(field_blob_encode(back, NODES, &again, &again_size, &err), ISCHIA_OK);
    assert_int_equal(again_size, size);
    assert_memory_equal(again, bytes, size);
    free(field);
    free(back);
    free(bytes);
    free(again);
}

static void test_what_cannot_be_kept_is_refused(void **state)
{
    (void)state;
    unsigned char *bytes = NULL;
    size_t size = 0;
    struct ischia_error err;
    static const double bad[] = {1000.0, -1e300, (double)NAN, (double)INFINITY};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        const double field[6] = {0, 0, 0, 0, bad[i], 0};
        assert_int_equal(field_blob_encode(field, 2, &bytes, &size, &err), ISCHIA_E_LIMIT);
    }
    assert_int_equal(field_blob_encode(NULL, 0, &bytes, &size, &err), ISCHIA_E_LIMIT);
}

static void expect_refused(const unsigned char *bytes, size_t size)
{
    double *back = NULL;
    size_t nodes = 0;
    struct ischia_error err;
    assert_int_equal(field_blob_decode(bytes, size, &back, &nodes, &err), ISCHIA_E_INPUT);
    assert_null(back);
}

static void test_damaged_blobs_are_refused(void **state)
{
    (void)state;
    double *field = make_field();
    unsigned char *bytes = NULL;
    size_t size = 0;
    struct ischia_error err;
    assert_int_equal(field_blob_encode(field, NODES, &bytes, &size, &err), ISCHIA_OK);
    expect_refused(bytes, 0);
    for (size_t cut = 1; cut < size; cut = cut * 3 / 2 + 1) expect_refused(bytes, cut);
    static const size_t heads[] = {0, 3, 4, 5, 6, 7, 11};
    for (size_t i = 0; i < sizeof heads / sizeof heads[0]; i++) {
        bytes[heads[i]] ^= 0x10;
        expect_refused(bytes, size);
        bytes[heads[i]] ^= 0x10;
    }
    bytes[size / 2] ^= 0x10; /* zlib's own check */
    expect_refused(bytes, size);
    free(field);
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_comes_back_within_half_a_unit),
        cmocka_unit_test(test_what_cannot_be_kept_is_refused),
        cmocka_unit_test(test_damaged_blobs_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
