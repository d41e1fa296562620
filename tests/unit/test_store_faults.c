/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Every write, truncation and fsync of the store fails once, and then for good: whatever was
 * answered OK must be there afterwards, and the database must be whole. A layer between SQLite and
 * the system does the failing.
 */
#include <sqlite3.h>

#include "tests/unit/store_room.h"

struct faulty_file {
    sqlite3_file base; /* what SQLite sees */
    sqlite3_file *real;
};

static long countdown; /* to the failure; 0: none; written while no store is open */
static bool for_good, has_failed;

static bool fails_now(void)
{
    const long left = __atomic_load_n(&countdown, __ATOMIC_SEQ_CST);
    if (left == 0) return false;
    if (left > 1) {
        (void)__atomic_sub_fetch(&countdown, 1, __ATOMIC_SEQ_CST);
        return false;
    }
    has_failed = true;
    if (!for_good) __atomic_store_n(&countdown, 0, __ATOMIC_SEQ_CST);
    return true;
}

static sqlite3_file *real(sqlite3_file *file) { return ((struct faulty_file *)(void *)file)->real; }

#define FORWARD(name, parameters, ...)                                                             \
    static int fault_##name parameters { return real(f)->pMethods->x##name(real(f), __VA_ARGS__); }
#define FORWARD_ALONE(name)                                                                        \
    static int fault_##name(sqlite3_file *f) { return real(f)->pMethods->x##name(real(f)); }

FORWARD_ALONE(Close)
FORWARD(Read, (sqlite3_file * f, void *to, int size, sqlite3_int64 at), to, size, at)
FORWARD(FileSize, (sqlite3_file * f, sqlite3_int64 *size), size)
FORWARD(Lock, (sqlite3_file * f, int kind), kind)
FORWARD(Unlock, (sqlite3_file * f, int kind), kind)
FORWARD(CheckReservedLock, (sqlite3_file * f, int *held), held)
FORWARD(FileControl, (sqlite3_file * f, int what, void *with), what, with)
FORWARD_ALONE(SectorSize)
FORWARD_ALONE(DeviceCharacteristics)
FORWARD(ShmMap, (sqlite3_file * f, int page, int size, int extend, void volatile **to), page, size,
        extend, to)
FORWARD(ShmLock, (sqlite3_file * f, int from, int count, int flags), from, count, flags)
FORWARD(ShmUnmap, (sqlite3_file * f, int remove_it), remove_it)

static void fault_ShmBarrier(sqlite3_file *f) { real(f)->pMethods->xShmBarrier(real(f)); }

static int fault_Write(sqlite3_file *f, const void *from, int size, sqlite3_int64 at)
{
    if (fails_now()) return for_good ? SQLITE_FULL : SQLITE_IOERR_WRITE;
    return real(f)->pMethods->xWrite(real(f), from, size, at);
}

static int fault_Truncate(sqlite3_file *f, sqlite3_int64 size)
{
    if (fails_now()) return SQLITE_IOERR_TRUNCATE;
    return real(f)->pMethods->xTruncate(real(f), size);
}

static int fault_Sync(sqlite3_file *f, int flags)
{
    if (fails_now()) return SQLITE_IOERR_FSYNC;
    return real(f)->pMethods->xSync(real(f), flags);
}

static const sqlite3_io_methods methods = {2,
                                           fault_Close,
                                           fault_Read,
                                           fault_Write,
                                           fault_Truncate,
                                           fault_Sync,
                                           fault_FileSize,
                                           fault_Lock,
                                           fault_Unlock,
                                           fault_CheckReservedLock,
                                           fault_FileControl,
                                           fault_SectorSize,
                                           fault_DeviceCharacteristics,
                                           fault_ShmMap,
                                           fault_ShmLock,
                                           fault_ShmBarrier,
                                           fault_ShmUnmap,
                                           NULL,
                                           NULL};

static sqlite3_vfs *system_vfs;
static sqlite3_vfs faulty_vfs;

static int fault_open(sqlite3_vfs *vfs, const char *name, sqlite3_file *file, int flags, int *out)
{
    (void)vfs;
    struct faulty_file *faulty = (struct faulty_file *)(void *)file;
    faulty->real = (sqlite3_file *)(void *)(faulty + 1);
    faulty->base.pMethods = NULL;
    const int code = system_vfs->xOpen(system_vfs, name, faulty->real, flags, out);
    if (code == SQLITE_OK) faulty->base.pMethods = &methods;
    return code;
}

static int install(void **state)
{
    (void)state;
    system_vfs = sqlite3_vfs_find(NULL);
    faulty_vfs = *system_vfs;
    faulty_vfs.zName = "faulty";
    faulty_vfs.szOsFile = (int)sizeof(struct faulty_file) + system_vfs->szOsFile;
    faulty_vfs.xOpen = fault_open;
    return sqlite3_vfs_register(&faulty_vfs, 1);
}

struct answered { /* what the store has said OK to */
    struct store_accepted first, second;
    bool has_first, has_second, succeeded, erased;
};

static bool try_accept(struct store *store, unsigned char number, struct store_accepted *ret)
{
    struct ischia_error err;
    const struct store_new what = request(number);
    return store_accept(store, &what, ret, &err) == ISCHIA_OK;
}

static void live(struct store *store, struct answered *ret)
{
    struct ischia_error err;
    struct store_claim got = {0};
    enum store_answer answer = STORE_NOT_FOUND;
    int cached = 0;
    ret->has_first = try_accept(store, 1, &ret->first);
    if (store_claim_next(store, ignore_cached, &cached, &got, &answer, &err) == ISCHIA_OK &&
        answer == STORE_DONE)
        ret->succeeded =
            store_succeed(store, &got.id, got.attempt, "{}", NULL, 0, &answer, &err) == ISCHIA_OK &&
            answer == STORE_DONE;
    free(got.case_json);
    ret->has_second = try_accept(store, 2, &ret->second);
    if (ret->succeeded) ret->erased = store_erase(store, &got.id, &answer, &err) == ISCHIA_OK;
}

static bool is_there(struct store *store, const struct uuid *id, enum queue_state *ret_state)
{
    struct ischia_error err;
    struct store_assessment a = {0};
    enum store_answer answer = STORE_NOT_FOUND;
    assert_int_equal(store_peek(store, id, &a, &answer, &err), ISCHIA_OK);
    *ret_state = a.state;
    return answer == STORE_DONE;
}

/* One life with a failure at the nth place; false when there is no nth place any more. */
static bool one_life(struct room *room, long nth, bool always)
{
    struct answered answered = {0};
    struct ischia_error err = {0};
    enum queue_state now;
    const struct store_options options = {.location = room->path, .now_ms = fake_now};
    (void)snprintf(room->path, sizeof room->path, "%s/life-%ld-%d", room->directory, nth, always);
    has_failed = false;
    for_good = always;
    countdown = nth;
    if (store_open(&options, &room->store, &err) == ISCHIA_OK) {
        live(room->store, &answered);
        store_close(room->store);
    }
    countdown = 0;
    open_room(room); /* checks the whole file */
    if (answered.has_first && !answered.succeeded)
        assert_true(is_there(room->store, &answered.first.id, &now));
    if (answered.succeeded && !answered.erased && is_there(room->store, &answered.first.id, &now))
        assert_int_equal(now, QUEUE_SUCCEEDED); /* not there: the erasing was kept, not answered */
    if (answered.erased) assert_false(is_there(room->store, &answered.first.id, &now));
    if (answered.has_second) assert_true(is_there(room->store, &answered.second.id, &now));
    store_close(room->store);
    room->store = NULL;
    return has_failed;
}

static void fail_everywhere(struct room *room, bool always)
{
    long nth = 1;
    store_close(room->store);
    room->store = NULL;
    while (one_life(room, nth, always)) nth++;
    assert_true(nth > 20); /* there were places to fail at */
}

static void test_one_failure_anywhere(void **state) { fail_everywhere(*state, false); }
static void test_failures_from_anywhere_on(void **state) { fail_everywhere(*state, true); }

int main(void)
{
    const struct CMUnitTest tests[] = {
        STORE_TEST(test_one_failure_anywhere),
        STORE_TEST(test_failures_from_anywhere_on),
    };
    return cmocka_run_group_tests(tests, install, NULL);
}
