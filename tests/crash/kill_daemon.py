#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""kill -9 at random moments under load: kill_daemon.py HARNESS FAKE_WORKER MOMENTS [SEED]

Defends invariants I1 to I6 of docs/INVARIANTS.md. The moments fall while the store is opened,
recovered and filled; before some of them a worker is killed as well.
"""
import random
import signal
import sys
import tempfile
import time

from crash import (PATIENCE_S, Harness, Promises, count, judge, kill_one_worker,
                   wait_while_alive)


def one_life(program, directory, worker, promises):
    harness = Harness("serve", program, directory, worker)
    if random.random() < 0.9:
        goal = random.randint(0, 12)  # a number, not a time: a slow machine has its load too
        wait_while_alive(harness, lambda: count(harness, "accepted") >= goal, "accepted requests")
        time.sleep(random.uniform(0, 0.1))
        if random.random() < 0.5:
            kill_one_worker(harness.process.pid)
            time.sleep(random.uniform(0, 0.03))
    else:
        time.sleep(random.uniform(0, 0.02))  # while it opens and recovers
    status = harness.kill()
    assert status == -signal.SIGKILL, "it ended by itself (%d): %s" % (status, harness.error)
    promises.add(harness.lines)


def main(program, worker, moments, seed):
    random.seed(seed)
    promises = Promises()
    with tempfile.TemporaryDirectory(prefix="ischia-crash-") as top:
        directory = top + "/state"
        for _ in range(moments):
            one_life(program, directory, worker, promises)
        last = Harness("finish", program, directory, worker)
        status = last.wait(PATIENCE_S)
        assert status == 0 and "finished" in last.lines, last.error
        faults, states = judge(directory, promises)
    print("%d kills (seed %d): %d accepted, %d cancelled; states %s" %
          (moments, seed, len(promises.accepted), len(promises.cancelled), states))
    for fault in faults[:20]:
        print("FAULT", fault)
    assert len(promises.accepted) > moments, "hardly anything was accepted: no load"
    assert not promises.refusals, promises.refusals[0]
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], int(sys.argv[3]),
                  int(sys.argv[4]) if len(sys.argv) > 4 else random.randrange(10**6)))
