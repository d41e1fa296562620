#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""kill -9 of ischiad itself at random moments while clients use it over HTTP:
kill_service.py MOMENTS [SEED], the daemon in $ISCHIAD.

Defends invariants I1 to I4, I6, I11 to I13 and I18 of docs/INVARIANTS.md from where a client
stands. Four clients submit, wait, cancel, erase and follow the changes; what was answered is a
promise. What was cut off is asked again with the same Idempotency-Key after the restart, as a
client should.
Before some of the kills a worker is killed as well; some fall while the daemon starts.
"""
import http.client
import itertools
import json
import os
import random
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time

from crash import PATIENCE_S, kill_one_worker

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../api"))
from service import PROGRAM, Service, command_line, side  # noqa: E402  (the path comes first)

CLIENTS = 4
FINAL = ("succeeded", "failed", "cancelled")
ERASE_EVERY, CANCEL_EVERY, WAIT_EVERY = 7, 5, 3


class CutOff(Exception):
    """The daemon was killed in the middle of a request."""


class World:
    """What has been promised to the clients, in all lives of the daemon."""

    def __init__(self):
        self.lock = threading.Lock()
        self.numbers = itertools.count(1)
        self.accepted = {}  # number -> id
        self.cancelled, self.perhaps_cancelled = set(), set()  # ids
        self.erased, self.perhaps_erased = set(), set()
        self.again = []  # numbers that were never answered
        self.changes = {}  # seq -> (change, id)
        self.faults = []

    def next_number(self):
        with self.lock:
            return self.again.pop() if self.again else next(self.numbers)


def deed_of(number):
    """The force by which fake_worker.py is told what to do, different for each number."""
    assert number < 100000, "more numbers than forces"
    if number % 10 == 4:
        return "failed", 598 + number / 1e5
    if number % 20 == 7:
        return "failed", 597 + number / 1e5
    return "succeeded", round(100 + number / 1e3, 3)


def ask(service, method, path, body=None, headers=None):
    try:
        return service.ask(method, path, body, headers)
    except (OSError, http.client.HTTPException) as error:
        raise CutOff from error


def submit(service, world, number):
    headers = {"Idempotency-Key": "k-%d" % number}
    if number % WAIT_EVERY == 0:
        headers["Prefer"] = "wait=5"
    body = side(F=deed_of(number)[1], subject="N-%d" % number)
    try:
        answer = ask(service, "POST", "/v1/assessments", body, headers)
    except CutOff:
        with world.lock:
            world.again.append(number)
        raise
    if answer.status not in (201, 202):
        with world.lock:
            world.again.append(number)
        assert answer.status == 429, (answer.status, answer.body)
        time.sleep(0.02)
        return None
    identity = answer.json()["id"]
    with world.lock:
        known = world.accepted.setdefault(number, identity)
        if known != identity:
            world.faults.append("number %d is %s and %s" % (number, known, identity))
    return identity


def change(service, sure, perhaps, method, path, identity, good):
    """Asks for a change; it is promised when it was answered, possible when it was not."""
    perhaps.add(identity)
    answer = ask(service, method, path)
    if answer.status == good:
        sure.add(identity)
    else:
        perhaps.discard(identity)
        assert answer.status in (404, 409), (answer.status, answer.body)


def follow(service, world):
    """One page of changes behind the last one seen."""
    since = max(world.changes, default=0)
    page = ask(service, "GET", "/v1/changes?since=%d&limit=500" % since).json()
    with world.lock:
        for item in page["items"]:
            world.changes[item["seq"]] = (item["change"], item["id"])


def use(service, world):
    """One client, until the daemon is gone."""
    try:
        while True:
            number = world.next_number()
            identity = submit(service, world, number)
            if identity is None:
                continue
            path = "/v1/assessments/" + identity
            if number % CANCEL_EVERY == 0:
                change(service, world.cancelled, world.perhaps_cancelled, "POST",
                       path + "/cancel", identity, 200)
            if number % ERASE_EVERY == 0:
                change(service, world.erased, world.perhaps_erased, "DELETE", path, identity, 204)
            if number % 4 == 0:
                follow(service, world)
    except CutOff:
        pass
    except Exception as error:  # a thread's failure must not go unseen
        world.faults.append("a client: %r" % error)


def wait_for(holds, service, world, what):
    until = time.monotonic() + PATIENCE_S
    while not holds():
        assert service.process.poll() is None, "it ended by itself: " + service.errors()[-2000:]
        assert not world.faults, world.faults[0]
        assert time.monotonic() < until, "waited %d s for %s" % (PATIENCE_S, what)
        time.sleep(0.005)


def long_life(state, world):
    goal = len(world.accepted) + random.randint(0, 25)
    service = Service(state=state)
    clients = [threading.Thread(target=use, args=(service, world)) for _ in range(CLIENTS)]
    for client in clients:
        client.start()
    wait_for(lambda: len(world.accepted) >= goal, service, world, "accepted requests")
    time.sleep(random.uniform(0, 0.1))
    if random.random() < 0.5:
        kill_one_worker(service.process.pid)
        time.sleep(random.uniform(0, 0.03))
    assert service.process.poll() is None, "it ended by itself: " + service.errors()[-2000:]
    service.kill()
    for client in clients:
        client.join()


def short_life(state):
    """Killed while it opens, recovers and begins to listen."""
    process = subprocess.Popen(command_line(state), stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
    time.sleep(random.uniform(0, 0.15))
    process.kill()
    process.wait()


def rows_of(service):
    """Every assessment there is, page by page."""
    cursor, rows = "", {}
    while cursor is not None:
        page = service.get("/v1/assessments?limit=500&cursor=" + cursor).json()
        rows.update({item["id"]: item for item in page["items"]})
        cursor = page["next_cursor"]
    return rows


def all_changes(service):
    since, seen = 0, {}
    while items := service.get("/v1/changes?since=%d&limit=500" % since).json()["items"]:
        seen.update({item["seq"]: (item["change"], item["id"]) for item in items})
        since = items[-1]["seq"]
    return seen


def judge_one(number, row, world):
    expected, force = deed_of(number)
    name, status, faults = "number %d" % number, row["status"], []
    identity = row["id"]
    killed = "killed by signal 9" in json.dumps(row["problem"])  # by this test, twice in a row
    if status != expected and not (status == "failed" and killed) and not (
            status == "cancelled" and identity in world.perhaps_cancelled):
        faults.append("%s is %s, not %s: %s" % (name, status, expected, row["problem"]))
    if identity in world.cancelled and status != "cancelled":
        faults.append("%s was cancelled and is %s" % (name, status))
    if row["parameters"]["F"] != force:
        faults.append("%s has another's force" % name)
    if status == "succeeded" and (row["result"]["numerics"]["newton_iterations"]
                                  != round(force * 1e3)):
        faults.append("%s has another's result" % name)
    if status == "failed" and not row["problem"]["detail"]:
        faults.append("%s failed without a reason" % name)
    return faults


def judge(service, world):
    rows, faults = rows_of(service), list(world.faults)
    for number, identity in world.accepted.items():
        if identity in world.erased:
            if identity in rows:
                faults.append("number %d was erased and is back" % number)
        elif identity not in rows:
            if identity not in world.perhaps_erased:
                faults.append("number %d was accepted and is lost" % number)
        else:
            row = service.get("/v1/assessments/" + identity).json()
            faults += judge_one(number, row, world)
    subjects = [row["subject"] for row in rows.values()]
    twice = {subject for subject in subjects if subjects.count(subject) > 1}
    faults += ["%s is there twice, under one Idempotency-Key" % subject for subject in twice]
    changes = all_changes(service)
    faults += ["change %d was seen as %s and is %s" % (seq, seen, changes.get(seq))
               for seq, seen in world.changes.items() if changes.get(seq) != seen]
    for identity, row in rows.items():
        ends = [what for what, whose in changes.values() if whose == identity and what in FINAL]
        if ends != [row["status"]]:
            faults.append("%s is %s, but its ends are %s" % (identity, row["status"], ends))
    return faults, rows


def judge_file(state):
    said = subprocess.run([PROGRAM, "--state-dir", state, "audit", "verify"], capture_output=True,
                          text=True)
    faults = [] if said.returncode == 0 else ["the audit log: " + said.stdout + said.stderr]
    database = sqlite3.connect("file:%s/ischia.sqlite?mode=ro" % state, uri=True)
    if database.execute("PRAGMA integrity_check").fetchall() != [("ok",)]:
        faults.append("the database is damaged")
    if database.execute("PRAGMA foreign_key_check").fetchall():
        faults.append("a row refers to nothing")
    database.close()
    return faults


def finish(state, world):
    """Asks again for what was never answered, and waits for the end of everything."""
    with Service(state=state) as service:
        while world.again:
            submit(service, world, world.next_number())
        wait_for(lambda: not any(service.get("/v1/assessments?limit=1&status=" + status).json()
                                 ["items"] for status in ("queued", "running")),
                 service, world, "the queue to be empty")
        faults, rows = judge(service, world)
    return faults + judge_file(state), rows


def main(moments, seed):
    random.seed(seed)
    world = World()
    with tempfile.TemporaryDirectory(prefix="ischia-crash-") as state:
        for _ in range(moments):
            if random.random() < 0.9:
                long_life(state, world)
            else:
                short_life(state)
        faults, rows = finish(state, world)
    states = {status: sum(row["status"] == status for row in rows.values()) for status in FINAL}
    print("%d kills (seed %d): %d accepted, %d erased; states %s; %d changes followed" %
          (moments, seed, len(world.accepted), len(world.erased), states, len(world.changes)))
    for fault in faults[:20]:
        print("FAULT", fault)
    assert len(world.accepted) > moments, "hardly anything was accepted: no load"
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]),
                  int(sys.argv[2]) if len(sys.argv) > 2 else random.randrange(10**6)))
