/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_DOUBLE_FAILING_MALLOC_H
#define ISCHIA_TESTS_DOUBLE_FAILING_MALLOC_H

#include <stdbool.h>

/*
 * malloc, calloc and realloc of this program and of every library it has loaded, in front of those
 * of glibc: one of them can be made to fail, and what is not freed is counted. In a program of its
 * own, FAIL_ALLOCATION=N in the environment makes the Nth allocation fail, and every one after it
 * when FAIL_ALLOCATION_ON is set as well.
 */
void failing_malloc_arm(long nth, bool and_all_after); /* the nth from now on, 1 ... */
void failing_malloc_disarm(void);
bool failing_malloc_happened(void); /* since it was armed */
long failing_malloc_live(void);     /* allocations that are not freed */

#endif
