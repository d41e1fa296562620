#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""A disk that is full, then read-only: full_disk.py HARNESS FAKE_WORKER. Needs root (tmpfs).

Defends invariant I7 of docs/INVARIANTS.md. The disk is filled by a ballast file of the test's own
until not a byte is free, so that the next write that needs room is refused, however fast or slow
the machine: what happens is waited for, and every wait ends as soon as the harness does.
"""
import contextlib
import os
import subprocess
import sys
import tempfile
import time

from crash import PATIENCE_S, Harness, Promises, count, judge, wait_while_alive

SKIPPED = 77
SIZE = "size=64m"
STARTS_ON_A_FULL_DISK = 8
REFUSAL = "database or disk is full (free some disk space)"


class Ballast:
    """A file beside the state directory that takes what room the disk has left."""

    def __init__(self, top):
        self.path = top + "/ballast"
        self.file = None

    def fill(self, leave=0):
        """Takes every free byte but `leave`; others may give back and take room meanwhile."""
        self.empty()
        self.file = open(self.path, "wb", buffering=0)
        self.refill()
        if leave:
            self.file.truncate(max(0, self.file.tell() - leave))

    def refill(self):
        """Takes the room that was given back since; the number of bytes."""
        before = self.file.tell()
        with contextlib.suppress(OSError):  # no space left on device
            while self.file.write(bytes(1 << 20)):
                pass
        return self.file.tell() - before

    def empty(self):
        if self.file is not None:
            self.file.close()
            os.unlink(self.path)
            self.file = None


@contextlib.contextmanager
def small_disk():
    with tempfile.TemporaryDirectory(prefix="ischia-disk-") as top:
        made = subprocess.run(["mount", "-t", "tmpfs", "-o", SIZE, "tmpfs", top],
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


def serve(arguments, top):
    return Harness("serve", arguments[0], top + "/state", arguments[1])


def refuse_when_full(harness, ballast):
    """Fills the disk under a running harness until it refuses; room that it had (pages of the
    write-ahead log that are used again) is used up by its own going on."""
    wait_while_alive(harness, lambda: count(harness, "accepted") >= 20, "20 requests accepted")
    before = count(harness, "refused")
    ballast.fill()
    wait_while_alive(harness, lambda: ballast.refill() == 0 and
                     count(harness, "refused") >= before + 5, "five refusals on a full disk")
    for line in list(harness.lines):
        assert not line.startswith("refused") or REFUSAL in line, line


def fill_and_empty(arguments, top, ballast, promises):
    """Refuses while the disk is full, goes on by itself when there is room again."""
    harness = serve(arguments, top)
    refuse_when_full(harness, ballast)
    ballast.empty()
    before = count(harness, "accepted")
    wait_while_alive(harness, lambda: count(harness, "accepted") >= before + 20, "it to go on")
    harness.kill()
    promises.add(harness.lines)


def die_on_full_disk(arguments, top, ballast, promises):
    """Killed while the disk is full."""
    harness = serve(arguments, top)
    refuse_when_full(harness, ballast)
    harness.kill()
    promises.add(harness.lines)


def start_on_full_disk(arguments, top, ballast, promises):
    """With no room or a little: serves (and may refuse), or ends at once and says why."""
    outcomes = {"served": 0, "would not start": 0}
    for start in range(STARTS_ON_A_FULL_DISK):
        ballast.fill(leave=start * 4096)
        harness = serve(arguments, top)
        assert harness.ready.wait(PATIENCE_S), "it neither started nor ended"
        time.sleep(0.1)
        if harness.process.poll() is None:
            outcomes["served"] += 1
            harness.kill()
        else:
            outcomes["would not start"] += 1
            assert harness.wait() == 1 and REFUSAL in harness.error, harness.error
            print("with %d bytes left:" % (start * 4096), harness.error.strip())
        promises.add(harness.lines)
    ballast.empty()
    return outcomes


def read_only(arguments, top):
    remount(top, "ro")
    harness = serve(arguments, top)
    status = harness.wait(PATIENCE_S)
    assert status == 1, "it serves from a read-only disk (%d)" % status
    assert "Read-only file system" in harness.error or "read-only" in harness.error, harness.error
    print("read-only:", harness.error.strip())
    remount(top, "rw," + SIZE)


def main(arguments):
    if os.geteuid() != 0:
        print("skipped: a small disk can only be mounted by root")
        return SKIPPED
    promises = Promises()
    with small_disk() as top:
        ballast = Ballast(top)
        fill_and_empty(arguments, top, ballast, promises)
        die_on_full_disk(arguments, top, ballast, promises)
        outcomes = start_on_full_disk(arguments, top, ballast, promises)
        read_only(arguments, top)
        last = Harness("finish", arguments[0], top + "/state", arguments[1])
        status = last.wait(PATIENCE_S)
        assert status == 0 and "finished" in last.lines, last.error
        faults, states = judge(top + "/state", promises)
    print("%d accepted, %d refused; states %s; starts on a full disk: %s" %
          (len(promises.accepted), len(promises.refusals), states, outcomes))
    for fault in faults[:20]:
        print("FAULT", fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
