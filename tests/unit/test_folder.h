/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_UNIT_TEST_FOLDER_H
#define ISCHIA_TESTS_UNIT_TEST_FOLDER_H

/* A folder of a test's own, in $TMPDIR or /tmp. Each test program is one file, so everything here
 * is static. */
#include <ftw.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

/* Makes the folder; its path begins with the place and `name`. */
static inline void test_folder_make(char *ret_path, size_t size, const char *name)
{
    const char *place = getenv("TMPDIR");
    const int length = snprintf(ret_path, size, "%s/ischia-%s-XXXXXX",
                                place == NULL || *place == '\0' ? "/tmp" : place, name);
    assert_in_range(length, 1, size - 1);
    assert_non_null(mkdtemp(ret_path));
}

static inline int test_folder_remove_one(const char *path, const struct stat *status, int kind,
                                         struct FTW *ftw)
{
    (void)status;
    (void)kind;
    (void)ftw;
    return remove(path);
}

/* Removes it with all that is in it. */
static inline void test_folder_remove(const char *path)
{
    (void)nftw(path, test_folder_remove_one, 8, FTW_DEPTH | FTW_PHYS);
}

#endif
