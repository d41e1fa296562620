#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""A disk that is full, then read-only: full_disk.py HARNESS FAKE_WORKER. Needs root (tmpfs).

Defends invariant I7 of docs/INVARIANTS.md.
"""
import contextlib
import os
import subprocess
import sys
import tempfile
import time

from crash import Harness, Promises, judge, wait_for

SKIPPED = 77
SMALL, LARGE = "size=1m", "size=64m"


@contextlib.contextmanager
def small_disk():
    with tempfile.TemporaryDirectory(prefix="ischia-disk-") as top:
        made = subprocess.run(["mount", "-t", "tmpfs", "-o", SMALL, "tmpfs", top],
                              capture_output=True, text=True)
        if made.returncode != 0:
            print("skipped: no tmpfs can be mounted: " + made.stderr.strip())
            sys.exit(SKIPPED)
        try:
            yield top
        finally:
            subprocess.run(["umount", "-l", top], check=True)


def remount(top, options):
    subprocess.run(["mount", "-o", "remount," + options, top], check=True)


def count(harness, word):
    return sum(line.startswith(word + " ") for line in list(harness.lines))


def fill_and_enlarge(arguments, top, promises):
    harness = Harness("serve", arguments[0], top + "/state", arguments[1])
    wait_for(lambda: count(harness, "refused") >= 20, 120, "the disk to be full")
    assert harness.process.poll() is None, "it gave up on a full disk"
    assert any("full" in line and "free some disk space" in line for line in harness.lines
               if line.startswith("refused io")), harness.lines[-1]
    before = count(harness, "accepted")
    assert before > 20, "it refused before the disk can have been full"
    remount(top, LARGE)
    wait_for(lambda: count(harness, "accepted") > before + 50, 60, "it to go on by itself")
    harness.kill()
    promises.add(harness.lines)


def die_on_full_disk(arguments, top, promises):
    """Killed while the disk is full; may refuse to start on it, but clearly."""
    used = sum(os.path.getsize(top + "/state/" + name) for name in os.listdir(top + "/state"))
    remount(top, "size=%dk" % (used // 1024 + 200))
    harness = Harness("serve", arguments[0], top + "/state", arguments[1])
    wait_for(lambda: count(harness, "refused") >= 5, 120, "the disk to be full again")
    harness.kill()
    promises.add(harness.lines)
    again = Harness("serve", arguments[0], top + "/state", arguments[1])
    again.ready.wait(30)
    time.sleep(0.3)
    if again.process.poll() is None:
        again.kill()
    else:
        assert again.wait() == 1 and "the store cannot" in again.error, again.error
    promises.add(again.lines)
    remount(top, LARGE)


def read_only(arguments, top):
    remount(top, "ro")
    harness = Harness("serve", arguments[0], top + "/state", arguments[1])
    status = harness.wait(30)
    assert status == 1, "it serves from a read-only disk (%d)" % status
    assert "Read-only file system" in harness.error or "read-only" in harness.error, harness.error
    print("read-only:", harness.error.strip())
    remount(top, "rw," + LARGE)


def main(arguments):
    if os.geteuid() != 0:
        print("skipped: a small disk can only be mounted by root")
        return SKIPPED
    promises = Promises()
    with small_disk() as top:
        fill_and_enlarge(arguments, top, promises)
        die_on_full_disk(arguments, top, promises)
        read_only(arguments, top)
        last = Harness("finish", arguments[0], top + "/state", arguments[1])
        status = last.wait(300)
        assert status == 0 and "finished" in last.lines, last.error
        faults, states = judge(top + "/state", promises)
    print("%d accepted, %d refused; states %s; first refusal: %s" %
          (len(promises.accepted), len(promises.refusals), states, promises.refusals[0]))
    for fault in faults[:20]:
        print("FAULT", fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
