/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/sandbox.h"

#include <fcntl.h>
#include <linux/landlock.h>
#include <stdint.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

/* All ways of changing a file system that version 1 of Landlock knows. */
static const uint64_t changing = LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_REMOVE_DIR |
                                 LANDLOCK_ACCESS_FS_REMOVE_FILE | LANDLOCK_ACCESS_FS_MAKE_CHAR |
                                 LANDLOCK_ACCESS_FS_MAKE_DIR | LANDLOCK_ACCESS_FS_MAKE_REG |
                                 LANDLOCK_ACCESS_FS_MAKE_SOCK | LANDLOCK_ACCESS_FS_MAKE_FIFO |
                                 LANDLOCK_ACCESS_FS_MAKE_BLOCK | LANDLOCK_ACCESS_FS_MAKE_SYM;

static bool allow_below(int rules, const char *path, uint64_t access)
{
    const int fd = open(path, O_PATH | O_CLOEXEC);
    if (fd < 0) return false;
    const struct landlock_path_beneath_attr beneath = {.allowed_access = access, .parent_fd = fd};
    const long added =
        syscall(SYS_landlock_add_rule, rules, LANDLOCK_RULE_PATH_BENEATH, &beneath, 0);
    (void)close(fd);
    return added == 0;
}

static bool restrict_writing(const char *state_dir)
{
    const struct landlock_ruleset_attr handled = {.handled_access_fs = changing};
    const int rules = (int)syscall(SYS_landlock_create_ruleset, &handled, sizeof handled, 0);
    if (rules < 0) return false;
    const bool good = allow_below(rules, state_dir, changing) &&
                      allow_below(rules, "/dev/null", LANDLOCK_ACCESS_FS_WRITE_FILE) &&
                      syscall(SYS_landlock_restrict_self, rules, 0) == 0;
    (void)close(rules);
    return good;
}

struct sandbox_report sandbox_enter(const char *state_dir)
{
    struct sandbox_report report = {false, false, false};
    report.no_new_privileges = prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0;
    report.no_dumps = prctl(PR_SET_DUMPABLE, 0, 0, 0, 0) == 0;
    report.landlock = report.no_new_privileges && restrict_writing(state_dir);
    return report;
}
