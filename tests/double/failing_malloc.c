/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/double/failing_malloc.h"

#include <errno.h>
#include <malloc.h>
#include <stddef.h>
#include <stdlib.h>

extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *old, size_t size);
extern void *__libc_memalign(size_t alignment, size_t size);
extern void __libc_free(void *memory);

static long armed;    /* how many allocations until one fails; 0: none is to fail */
static bool on_after; /* all after it fail too                                     */
static bool happened;
static long live;

static bool fails(void)
{
    if (armed == 0) return false;
    if (armed > 1) {
        armed--;
        return false;
    }
    if (!on_after) armed = 0;
    happened = true;
    errno = ENOMEM;
    return true;
}

/* NOLINTBEGIN(readability-inconsistent-declaration-parameter-name): glibc uses reserved names */
void *malloc(size_t size)
{
    void *memory = fails() ? NULL : __libc_malloc(size);
    live += memory != NULL;
    return memory;
}

void *calloc(size_t count, size_t size)
{
    void *memory = fails() ? NULL : __libc_calloc(count, size);
    live += memory != NULL;
    return memory;
}

void *realloc(void *old, size_t size)
{
    if (fails()) return NULL;
    void *memory = __libc_realloc(old, size);
    live += old == NULL && memory != NULL;
    return memory;
}

void *aligned_alloc(size_t alignment, size_t size)
{
    void *memory = fails() ? NULL : __libc_memalign(alignment, size);
    live += memory != NULL;
    return memory;
}

/* Never made to fail: only libgomp asks for it, and ends the program when it is refused. */
void *memalign(size_t alignment, size_t size)
{
    void *memory = __libc_memalign(alignment, size);
    live += memory != NULL;
    return memory;
}

void free(void *memory)
{
    live -= memory != NULL;
    __libc_free(memory);
}

/* NOLINTEND(readability-inconsistent-declaration-parameter-name) */

void failing_malloc_arm(long nth, bool and_all_after)
{
    armed = nth;
    on_after = and_all_after;
    happened = false;
}

void failing_malloc_disarm(void) { armed = 0; }
bool failing_malloc_happened(void) { return happened; }
long failing_malloc_live(void) { return live; }

__attribute__((constructor)) static void arm_from_environment(void)
{
    const char *nth = getenv("FAIL_ALLOCATION");
    if (nth != NULL)
        failing_malloc_arm(strtol(nth, NULL, 10), getenv("FAIL_ALLOCATION_ON") != NULL);
}
