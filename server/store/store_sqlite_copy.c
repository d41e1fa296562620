/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Backup and restore, both through SQLite's own page copy, which reads one consistent state and
 * writes in one transaction.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "server/store/store_sqlite.h"

enum { COPY_BUSY_TIMEOUT_MS = 30000 };

/* All of it in one step: a copy in several would start again whenever someone writes. */
static enum ischia_code copy_pages(struct db *to, struct db *from, struct ischia_error *err)
{
    sqlite3_backup *backup =
        sqlite3_backup_init(sqlite_handle(to), "main", sqlite_handle(from), "main");
    if (backup == NULL) return sqlite_fail(to, "be copied", err);
    /* both report through the connection; finish repeats the failure of step */
    (void)sqlite3_backup_step(backup, -1);
    if (sqlite3_backup_finish(backup) != SQLITE_OK) return sqlite_fail(to, "be copied", err);
    return ISCHIA_OK;
}

static enum ischia_code make_temporary(const char *beside, char ret_path[SQLITE_PATH_BYTES],
                                       struct ischia_error *err)
{
    CHECK(strlen(beside) < SQLITE_PATH_BYTES - 16, err, ISCHIA_E_INPUT, "the path is too long");
    (void)stpcpy(stpcpy(ret_path, beside), ".part-XXXXXX");
    const int fd = mkstemp(ret_path); /* mode 0600 */
    CHECK(fd >= 0, err, ISCHIA_E_IO, "no file can be made beside %s: %s", beside, strerror(errno));
    (void)close(fd);
    return ISCHIA_OK;
}

static void remove_temporary(const char *path)
{
    static const char *const suffixes[] = {"", "-journal", "-wal", "-shm"};
    for (size_t i = 0; i < sizeof suffixes / sizeof suffixes[0]; i++) {
        char name[SQLITE_PATH_BYTES + 16];
        (void)stpcpy(stpcpy(name, path), suffixes[i]);
        (void)unlink(name);
    }
}

/* ------------------------------------------------------------------------------- backup */

static enum ischia_code copy_to_file(const char *source, const char *path, int busy_timeout_ms,
                                     struct ischia_error *err)
{
    struct db *from = NULL, *to = NULL;
    TRY(sqlite_open(source, DB_READ, busy_timeout_ms, &from, err));
    enum ischia_code code = sqlite_open(path, DB_READ, busy_timeout_ms, &to, err);
    if (code == ISCHIA_OK) code = sqlite_execute(to, "PRAGMA synchronous = FULL", err);
    if (code == ISCHIA_OK) code = copy_pages(to, from, err);
    /* a single file that can be read from a read-only directory */
    if (code == ISCHIA_OK) code = sqlite_execute(to, "PRAGMA journal_mode = DELETE", err);
    sqlite_close(to);
    sqlite_close(from);
    return code;
}

static enum ischia_code publish(const char *temporary, const char *path, struct ischia_error *err)
{
    if (link(temporary, path) != 0) {
        const enum ischia_code code = errno == EEXIST ? ISCHIA_E_STATE : ISCHIA_E_IO;
        return FAIL(err, code, "the backup cannot be named %s: %s", path, strerror(errno));
    }
    return sqlite_sync_directory(path, err);
}

enum ischia_code sqlite_backup(struct store *store, const char *path, struct ischia_error *err)
{
    const struct sqlite_place *place = store->place;
    char temporary[SQLITE_PATH_BYTES];
    CHECK(access(path, F_OK) != 0, err, ISCHIA_E_STATE, "%s exists already", path);
    TRY(make_temporary(path, temporary, err));
    int version = 0;
    enum ischia_code code =
        copy_to_file(place->paths.database, temporary, store->busy_timeout_ms, err);
    if (code == ISCHIA_OK) code = sqlite_look(temporary, true, &version, err);
    if (code == ISCHIA_OK) code = publish(temporary, path, err);
    remove_temporary(temporary);
    return code;
}

/* ------------------------------------------------------------------------------ restore */

static enum ischia_code recover_alone(struct db *db, struct ischia_error *err)
{
    struct store clock = {0}; /* the system's: all that recover_run needs of one */
    int requeued = 0;
    TRY(sqlite_begin(NULL, db, err));
    TRY(recover_run(&clock, db, &requeued, err));
    return sqlite_commit(db, err);
}

/* A copy of the backup, brought to this program's schema, with nothing running. */
static enum ischia_code prepare_copy(const char *backup_path, const char *temporary,
                                     struct ischia_error *err)
{
    int version = 0;
    struct db *db = NULL;
    TRY(sqlite_look(backup_path, true, &version, err));
    CHECK(version > 0, err, ISCHIA_E_INPUT, "%s is empty, not a backup", backup_path);
    TRY(copy_to_file(backup_path, temporary, COPY_BUSY_TIMEOUT_MS, err));
    TRY(sqlite_open(temporary, DB_READ, COPY_BUSY_TIMEOUT_MS, &db, err));
    enum ischia_code code = sqlite_migrate(db, version, store_migration_count, err);
    if (code == ISCHIA_OK) code = recover_alone(db, err);
    sqlite_close(db);
    return code;
}

/* A store that is damaged cannot be written into: it is put aside, not lost. */
static enum ischia_code put_aside(const char *database, struct ischia_error *err)
{
    static const char *const suffixes[] = {"", "-wal", "-shm"};
    for (size_t i = 0; i < sizeof suffixes / sizeof suffixes[0]; i++) {
        char from[SQLITE_PATH_BYTES + 16], to[SQLITE_PATH_BYTES + 32];
        (void)stpcpy(stpcpy(from, database), suffixes[i]);
        (void)stpcpy(stpcpy(stpcpy(to, database), ".damaged"), suffixes[i]);
        if (rename(from, to) != 0 && errno != ENOENT)
            return FAIL(err, ISCHIA_E_IO, "%s cannot be put aside: %s", from, strerror(errno));
    }
    return ISCHIA_OK;
}

static enum ischia_code copy_into(const char *database, const char *temporary,
                                  struct ischia_error *err)
{
    struct db *from = NULL, *to = NULL;
    TRY(sqlite_open(temporary, DB_READ, COPY_BUSY_TIMEOUT_MS, &from, err));
    enum ischia_code code = sqlite_open(database, DB_WRITE, COPY_BUSY_TIMEOUT_MS, &to, err);
    if (code == ISCHIA_OK) code = copy_pages(to, from, err);
    sqlite_close(to);
    sqlite_close(from);
    return code;
}

static enum ischia_code replace(const struct sqlite_paths *paths, const char *temporary,
                                struct ischia_error *err)
{
    int version = 0, lock_fd = -1;
    TRY(sqlite_make_file(paths->database, err));
    enum ischia_code code = sqlite_look(paths->database, true, &version, err);
    if (code == ISCHIA_E_INPUT || code == ISCHIA_E_STATE) {
        /* nobody can be serving it, and the lock makes sure of that */
        TRY(sqlite_lock(paths, SQLITE_LOCK_PATIENCE_MS, &lock_fd, err));
        code = put_aside(paths->database, err);
        if (code == ISCHIA_OK) code = sqlite_make_file(paths->database, err);
    }
    if (code == ISCHIA_OK) code = copy_into(paths->database, temporary, err);
    if (lock_fd >= 0) (void)close(lock_fd);
    return code;
}

enum ischia_code sqlite_restore(const char *location, const char *backup_path,
                                struct ischia_error *err)
{
    struct sqlite_paths paths;
    char temporary[SQLITE_PATH_BYTES];
    CHECK(access(backup_path, R_OK) == 0, err, ISCHIA_E_IO, "%s cannot be read: %s", backup_path,
          strerror(errno));
    TRY(sqlite_paths_of(location, &paths, err));
    TRY(sqlite_make_directory(&paths, err));
    TRY(make_temporary(paths.database, temporary, err));
    enum ischia_code code = prepare_copy(backup_path, temporary, err);
    if (code == ISCHIA_OK) code = replace(&paths, temporary, err);
    remove_temporary(temporary);
    return code;
}
