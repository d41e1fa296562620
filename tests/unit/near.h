/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_UNIT_NEAR_H
#define ISCHIA_TESTS_UNIT_NEAR_H

#include <math.h>

/* cmocka's own comparison of doubles rounds them to float first. Include after cmocka.h. */
#define assert_near(got, expected, tolerance)                                                      \
    do {                                                                                           \
        const double got_ = (got), expected_ = (expected);                                         \
        if (!(fabs(got_ - expected_) <= (tolerance)))                                              \
            fail_msg("%s is %.17g, expected %.17g", #got, got_, expected_);                        \
    } while (0)

#endif
