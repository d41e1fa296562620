# SPDX-License-Identifier: GPL-3.0-or-later
"""What the crash tests share: the harness as a process, its promises, and a judge of its store."""
import json
import os
import random
import signal
import sqlite3
import subprocess
import threading
import time
import uuid

STATES = ("queued", "running", "succeeded", "failed", "cancelled")
PATIENCE_S = 600  # no expectation of speed: only something that hangs takes so long
CANCEL_EVERY = 11  # as in harness.c
FINAL_KINDS = {3: "succeeded", 4: "failed", 5: "cancelled"}


class Harness:
    """One run of tests/crash/harness; every line that it managed to say is kept."""

    def __init__(self, mode, program, directory, worker):
        self.lines = []
        self.ready = threading.Event()
        self.process = subprocess.Popen([program, mode, directory, worker], text=True,
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.reader = threading.Thread(target=self._read)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))
            if line == "ready\n":
                self.ready.set()
        self.ready.set()

    def kill(self):
        self.process.kill()
        return self.wait()

    def wait(self, timeout=None):
        status = self.process.wait(timeout)
        self.reader.join()
        self.error = self.process.stderr.read()
        self.process.stderr.close()
        self.process.stdout.close()
        return status


class Promises:
    """What the harness has said that must stay true."""

    def __init__(self):
        self.accepted = {}
        self.cancelled = set()
        self.refusals = []

    def add(self, lines):
        for line in lines:
            word, _, rest = line.partition(" ")
            if word == "accepted":
                name, n, deed = rest.split()
                assert name not in self.accepted, "the same id was given out twice"
                self.accepted[name] = (int(n), deed)
            elif word == "cancelled":
                self.cancelled.add(rest)
            elif word == "refused":
                self.refusals.append(rest)


def judge(directory, promises):
    """Reads the finished store with a library of its own; returns the faults and some numbers."""
    database = sqlite3.connect("file:%s/ischia.sqlite?mode=ro" % directory, uri=True)
    faults = []
    if database.execute("PRAGMA integrity_check").fetchall() != [("ok",)]:
        faults.append("the database is damaged")
    if database.execute("PRAGMA foreign_key_check").fetchall():
        faults.append("a row refers to nothing")
    rows = {str(uuid.UUID(bytes=row[0])): row[1:] for row in database.execute(
        "SELECT a.id, state, attempt, case_json, problem_json, result_json, a.seq FROM assessment a"
        " LEFT JOIN solution s ON s.rowid = a.solution")}
    ends = {}
    for number, kind in database.execute("SELECT id, kind FROM change ORDER BY seq"):
        if kind in FINAL_KINDS:
            ends.setdefault(str(uuid.UUID(bytes=number)), []).append(FINAL_KINDS[kind])
    for name, (n, deed) in promises.accepted.items():
        if name not in rows:
            faults.append("%s was accepted and is lost" % name)
            continue
        faults += judge_one(name, n, deed, rows[name], ends.get(name, []),
                            name in promises.cancelled)
    counted = dict(database.execute("SELECT state, count(*) FROM assessment GROUP BY state"))
    tally = {state: n for state, n in database.execute("SELECT state, n FROM tally") if n}
    if counted != tally:
        faults.append("tally %s, but there are %s" % (tally, counted))
    database.close()
    return faults, {STATES[state]: n for state, n in counted.items()}


def judge_one(name, n, deed, row, ends, cancelled):
    state, attempt, case, problem, result, _ = row
    word = STATES[state]
    faults = []
    if ends != [word]:
        faults.append("%s is %s, but its ends are %s" % (name, word, ends))
    if json.loads(case)["n"] != n:
        faults.append("%s has another's case" % name)
    if cancelled and word != "cancelled":
        faults.append("%s was cancelled and is %s" % (name, word))
    if word == "cancelled" and n % CANCEL_EVERY != 0:  # perhaps killed before it could say so
        faults.append("%s was never to be cancelled" % name)
    expected = "succeeded" if deed in ("solve", "slow") else "failed"
    # two workers in a row may have been killed by the test itself
    killed = word == "failed" and "killed by signal 9" in problem
    if word not in (expected, "cancelled") and not killed:
        faults.append("%s was to %s and is %s: %s" % (name, deed, word, problem))
    if word == "succeeded" and json.loads(result)["numerics"]["newton_iterations"] != n:
        faults.append("%s has another's result" % name)
    if word == "failed" and not json.loads(problem)["detail"]:
        faults.append("%s failed without a reason" % name)
    if attempt < 1 and word != "cancelled":
        faults.append("%s ended without an attempt" % name)
    return faults


def workers_of(pid):
    """Its children, whichever thread started them."""
    found = []
    try:
        for task in os.listdir("/proc/%d/task" % pid):
            with open("/proc/%d/task/%s/children" % (pid, task)) as children:
                found += [int(child) for child in children.read().split()]
    except OSError:
        pass  # a thread that has just ended
    return found


def kill_one_worker(pid):
    workers = workers_of(pid)
    if workers:
        try:
            os.kill(random.choice(workers), signal.SIGKILL)
        except ProcessLookupError:
            pass


def count(harness, word):
    return sum(line.startswith(word + " ") for line in list(harness.lines))


def wait_while_alive(harness, condition, what):
    """Waits for the condition; when the harness ends before, says what it said last."""
    until = time.monotonic() + PATIENCE_S
    while not condition():
        if harness.process.poll() is not None:
            harness.wait()
            raise AssertionError("waiting for %s: it ended with %d: %s; its last lines: %s" % (
                what, harness.process.returncode, harness.error.strip(), harness.lines[-5:]))
        assert time.monotonic() < until, "waited %d s for %s" % (PATIENCE_S, what)
        time.sleep(0.01)
