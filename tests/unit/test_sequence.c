/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "data_file.h"
#include "near.h"
#include "solver/study/sequence.h"

static void plain_sequences_agree_with_scipy(void **state)
{
    (void)state;
    struct data_file file;
    int rows = 0;
    assert_true(data_open(&file, "sequence.csv"));
    for (; data_next(&file); rows++) {
        const uint32_t index = (uint32_t)data_number(&file, 0);
        const int dimension = (int)data_number(&file, 1);
        assert_near(sequence_sobol(index, dimension, 0), data_number(&file, 2), 1e-9);
        assert_near(sequence_halton(index, dimension, 0), data_number(&file, 3), 1e-15);
    }
    (void)fclose(file.in);
    assert_int_equal(rows, 64 * 14);
}

/* Each interval [i/64, (i+1)/64) of each coordinate holds one of the first 64 Sobol' points. */
static void a_shift_keeps_sobol_stratified(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 5; seed++) {
        for (int d = 0; d < SEQUENCE_DIMENSIONS_MAX; d++) {
            int hits[64] = {0};
            for (uint32_t i = 0; i < 64; i++) hits[(int)(sequence_sobol(i, d, seed) * 64)]++;
            for (int k = 0; k < 64; k++) assert_int_equal(hits[k], 1);
        }
    }
}

/* The same for Halton, whose first base^k points are stratified in base^k intervals. */
static void permutations_keep_halton_stratified(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 5; seed++) {
        int hits2[32] = {0}, hits3[27] = {0}, hits43[43] = {0};
        for (uint32_t i = 0; i < 32; i++) hits2[(int)(sequence_halton(i, 0, seed) * 32)]++;
        for (uint32_t i = 0; i < 27; i++) hits3[(int)(sequence_halton(i, 1, seed) * 27 + 1e-9)]++;
        for (uint32_t i = 0; i < 43; i++) hits43[(int)(sequence_halton(i, 13, seed) * 43 + 1e-9)]++;
        for (int k = 0; k < 32; k++) assert_int_equal(hits2[k], 1);
        for (int k = 0; k < 27; k++) assert_int_equal(hits3[k], 1);
        for (int k = 0; k < 43; k++) assert_int_equal(hits43[k], 1);
    }
}

static void seeds_differ_and_repeat(void **state)
{
    (void)state;
    assert_true(sequence_sobol(7, 3, 1) != sequence_sobol(7, 3, 2));
    assert_true(sequence_sobol(7, 3, 1) == sequence_sobol(7, 3, 1));
    assert_true(sequence_halton(7, 3, 1) != sequence_halton(7, 3, 2));
    for (uint32_t i = 0; i < 100; i++) {
        assert_in_range((int)(sequence_halton(i, 4, 9) * 1e6), 0, 999999);
        assert_in_range((int)(sequence_sobol(i, 4, 9) * 1e6), 0, 999999);
    }
}

static void random_numbers_follow_splitmix64(void **state)
{
    (void)state;
    /* The published generator's first outputs from state 1234567. */
    struct sequence_random random = {1234567};
    assert_true(sequence_random_next(&random) == UINT64_C(6457827717110365317));
    assert_true(sequence_random_next(&random) == UINT64_C(3203168211198807973));
    for (int i = 0; i < 1000; i++) assert_in_range(sequence_random_below(&random, 7), 0, 6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plain_sequences_agree_with_scipy),
        cmocka_unit_test(a_shift_keeps_sobol_stratified),
        cmocka_unit_test(permutations_keep_halton_stratified),
        cmocka_unit_test(seeds_differ_and_repeat),
        cmocka_unit_test(random_numbers_follow_splitmix64),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
