/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "server/store/store_sqlite.h"

enum { LOCK_PAUSE_MS = 20 };

enum ischia_code sqlite_paths_of(const char *location, struct sqlite_paths *ret,
                                 struct ischia_error *err)
{
    const size_t room = sizeof ret->directory - sizeof "/ischia.sqlite-journal";
    CHECK(location != NULL && location[0] != '\0', err, ISCHIA_E_INPUT,
          "the state directory has no name");
    CHECK(strlen(location) < room, err, ISCHIA_E_INPUT, "the state directory's name is too long");
    (void)stpcpy(ret->directory, location);
    (void)stpcpy(stpcpy(ret->database, location), "/ischia.sqlite");
    (void)stpcpy(stpcpy(ret->lock, location), "/ischia.lock");
    return ISCHIA_OK;
}

enum ischia_code sqlite_make_directory(const struct sqlite_paths *paths, struct ischia_error *err)
{
    if (mkdir(paths->directory, 0700) == 0) return sqlite_sync_directory(paths->directory, err);
    struct stat status;
    CHECK(errno == EEXIST, err, ISCHIA_E_IO, "the state directory %s cannot be made: %s",
          paths->directory, strerror(errno));
    CHECK(stat(paths->directory, &status) == 0 && S_ISDIR(status.st_mode), err, ISCHIA_E_IO,
          "%s is not a directory", paths->directory);
    return ISCHIA_OK;
}

enum ischia_code sqlite_sync_directory(const char *file_path, struct ischia_error *err)
{
    char copy[SQLITE_PATH_BYTES];
    CHECK(strlen(file_path) < sizeof copy, err, ISCHIA_E_INPUT, "the path is too long");
    (void)stpcpy(copy, file_path);
    const int fd = open(dirname(copy), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    CHECK(fd >= 0, err, ISCHIA_E_IO, "the directory of %s cannot be opened: %s", file_path,
          strerror(errno));
    const bool synced = fsync(fd) == 0;
    const int saved = errno;
    (void)close(fd);
    CHECK(synced, err, ISCHIA_E_IO, "the directory of %s cannot be synchronised: %s", file_path,
          strerror(saved));
    return ISCHIA_OK;
}

/*
 * Waits a little for a lock that somebody has: a worker that was forked in the moment in which the
 * daemon before was killed has the lock as well, until it first runs and sees that it is alone.
 */
static bool lock_patiently(int fd, int patience_ms)
{
    const struct timespec pause = {.tv_nsec = LOCK_PAUSE_MS * 1000000};
    for (int waited_ms = 0; flock(fd, LOCK_EX | LOCK_NB) != 0; waited_ms += LOCK_PAUSE_MS) {
        if (errno != EWOULDBLOCK || waited_ms >= patience_ms) return false;
        (void)nanosleep(&pause, NULL);
    }
    return true;
}

enum ischia_code sqlite_lock(const struct sqlite_paths *paths, int patience_ms, int *ret_fd,
                             struct ischia_error *err)
{
    const int fd = open(paths->lock, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    CHECK(fd >= 0, err, ISCHIA_E_IO, "%s cannot be opened: %s", paths->lock, strerror(errno));
    if (!lock_patiently(fd, patience_ms)) {
        const int saved = errno;
        (void)close(fd);
        CHECK(saved != EWOULDBLOCK, err, ISCHIA_E_STATE,
              "another ischiad is using the state directory %s", paths->directory);
        return FAIL(err, ISCHIA_E_IO, "%s cannot be locked: %s", paths->lock, strerror(saved));
    }
    *ret_fd = fd;
    return ISCHIA_OK;
}

enum ischia_code sqlite_make_file(const char *path, struct ischia_error *err)
{
    const int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    CHECK(fd >= 0, err, ISCHIA_E_IO, "%s cannot be opened for writing: %s", path, strerror(errno));
    (void)close(fd);
    return sqlite_sync_directory(path, err);
}

/* --------------------------------------------------------------- look before touching */

static enum ischia_code judge_version(struct db *db, const char *path, int *ret_version,
                                      struct ischia_error *err)
{
    int64_t application = 0, version = 0, tables = 0;
    TRY(db_number(db, "PRAGMA application_id", &application, err));
    TRY(db_number(db, "PRAGMA user_version", &version, err));
    TRY(db_number(db, "SELECT count(*) FROM sqlite_schema", &tables, err));
    const bool empty = application == 0 && version == 0 && tables == 0;
    CHECK(empty || application == SQLITE_APPLICATION_ID, err, ISCHIA_E_INPUT,
          "%s is an SQLite database, but not one of Ischia's; it was left as it is", path);
    CHECK(version <= store_migration_count, err, ISCHIA_E_STATE,
          "%s was written by a newer Ischia (schema %d, this program knows %d): "
          "use that program, or restore a backup made by this one; it was left as it is",
          path, (int)version, store_migration_count);
    *ret_version = (int)version;
    return ISCHIA_OK;
}

static enum ischia_code judge_pages(struct db *db, const char *path, struct ischia_error *err)
{
    struct query query;
    query_begin_text(&query, db, "PRAGMA integrity_check(1)");
    bool row = false;
    enum ischia_code code = query_step(&query, &row, err);
    const char *verdict = row ? query_peek_text(&query, 0) : "no verdict";
    if (code == ISCHIA_OK && (verdict == NULL || strcmp(verdict, "ok") != 0))
        code = FAIL(err, ISCHIA_E_INPUT,
                    "%s is damaged (%.200s): restore a backup with `ischiad restore`; "
                    "it was left as it is",
                    path, verdict == NULL ? "unreadable" : verdict);
    query_end(&query);
    return code;
}

/* A damaged file may already fail to open or to be read: the same answer as for a bad verdict. */
static enum ischia_code damaged(const char *path, int sqlite_code, struct ischia_error *err)
{
    const int kind = sqlite_code & 0xff;
    if (kind == SQLITE_CORRUPT || kind == SQLITE_NOTADB)
        return FAIL(err, ISCHIA_E_INPUT,
                    "%s is damaged or not a database (%s): restore a backup with "
                    "`ischiad restore`; it was left as it is",
                    path, sqlite3_errstr(sqlite_code));
    return err == NULL ? ISCHIA_E_IO : err->code;
}

/* *ret_unfinished: a write that was cut off must be taken back before the file can be read. */
static enum ischia_code look_once(const char *path, bool whole, int *ret_version,
                                  bool *ret_unfinished, struct ischia_error *err)
{
    struct db *db = NULL;
    const enum ischia_code opened = sqlite_open(path, DB_LOOK, 5000, &db, err);
    if (opened != ISCHIA_OK)
        return opened == ISCHIA_E_INPUT ? damaged(path, SQLITE_NOTADB, err) : opened;
    enum ischia_code code = judge_version(db, path, ret_version, err);
    if (code == ISCHIA_OK && whole) code = judge_pages(db, path, err);
    const int sqlite_code = sqlite3_extended_errcode(sqlite_handle(db));
    sqlite_close(db);
    *ret_unfinished = code != ISCHIA_OK && sqlite_code == SQLITE_READONLY_ROLLBACK;
    return code == ISCHIA_OK ? ISCHIA_OK : damaged(path, sqlite_code, err);
}

/* Cut off while the file was made or its journal mode set: SQLite left the means to take it back,
 * and does so when the file is first read by someone who may write. */
static enum ischia_code take_back_unfinished(const char *path, struct ischia_error *err)
{
    struct db *db = NULL;
    int64_t tables;
    TRY(sqlite_open(path, DB_READ, 5000, &db, err));
    const enum ischia_code code = db_number(db, "SELECT count(*) FROM sqlite_schema", &tables, err);
    sqlite_close(db);
    return code;
}

enum ischia_code sqlite_look(const char *path, bool whole, int *ret_version,
                             struct ischia_error *err)
{
    struct ischia_error own;
    bool unfinished = false;
    if (err == NULL) err = &own;
    const enum ischia_code code = look_once(path, whole, ret_version, &unfinished, err);
    if (!unfinished) return code;
    TRY(take_back_unfinished(path, err));
    return look_once(path, whole, ret_version, &unfinished, err);
}

/* --------------------------------------------------------------------------- migrations */

static enum ischia_code migrate_one(struct db *db, const struct migration *migration,
                                    struct ischia_error *err)
{
    char mark[64];
    (void)sqlite3_snprintf(sizeof mark, mark, "PRAGMA user_version = %d", migration->version);
    TRY(sqlite_begin(NULL, db, err));
    enum ischia_code code = sqlite_execute(db, migration->sqlite, err);
    if (code == ISCHIA_OK) code = sqlite_execute(db, mark, err);
    if (code == ISCHIA_OK) code = sqlite_commit(db, err);
    if (code != ISCHIA_OK) sqlite_roll_back(db);
    return code;
}

enum ischia_code sqlite_migrate(struct db *db, int from, int to, struct ischia_error *err)
{
    for (int version = from + 1; version <= to; version++)
        TRY(migrate_one(db, &store_migrations[version - 1], err));
    return ISCHIA_OK;
}
