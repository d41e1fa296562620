#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the world does to ischiad, over HTTP: a full disk, a read-only one, no descriptors left, a
worker that hangs, workers that are killed or out of memory, a damaged database. The daemon in
$ISCHIAD; full and read-only disks need root (tmpfs).

Defends invariants I3 and I6 to I9 of docs/INVARIANTS.md from where a client stands.
"""
import fcntl
import hashlib
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from crash import workers_of
from full_disk import Ballast, remount, small_disk

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../api"))
from service import (PATIENCE_S, Service, command_line, eventually,  # noqa: E402
                     side)

HANG, MEMORY, GATE = 599, 594, 595


def post(service, **changes):
    return service.ask("POST", "/v1/assessments", side(**changes))


def metric(service, name):
    text = service.get("/metrics").body.decode()
    return float(re.search(r"^%s (\S+)" % name, text, re.M).group(1))


def refused_start(state, *options):
    """Runs the daemon, which must end by itself; its exit status and what it says."""
    done = subprocess.run(command_line(state, *options), capture_output=True, text=True,
                          timeout=PATIENCE_S)
    return done.returncode, done.stderr


@unittest.skipIf(os.geteuid() != 0, "a small disk can only be mounted by root")
class Disks(unittest.TestCase):
    def test_full_disk(self):
        with small_disk() as top:
            os.mkdir(top + "/state")
            with Service(state=top + "/state") as service:
                service.until_ready()
                self.fill_and_empty(service, Ballast(top))

    def fill_and_empty(self, service, ballast):
        kept = service.submit(F=100.5)["links"]["self"]
        running = service.submit(wait=0, F=GATE)["id"]
        service.until(running, "running")
        ballast.fill()
        answer = eventually(lambda: self.refusal(service, ballast), "a refusal")
        self.assertEqual(answer.type, "application/problem+json")
        self.assertEqual(answer.json()["type"], "/docs#problem-unavailable")
        self.assertTrue(answer.headers["Retry-After"])
        self.assertEqual(service.get("/readyz").status, 503)
        self.assertEqual(service.get("/healthz").status, 200)
        self.assertEqual(service.get(kept).status, 200)  # what is there can be read
        failures = metric(service, "ischia_store_failures_total")
        with open("/tmp/ischia-gate-%d" % service.process.pid, "xb") as gate:
            self.addCleanup(os.unlink, gate.name)
        eventually(lambda: metric(service, "ischia_store_failures_total") > failures,
                   "the end of the solve to be refused by the disk")
        self.assertEqual(service.get("/v1/assessments/" + running).json()["status"], "running")
        ballast.empty()
        service.until(running, "succeeded")  # kept in memory meanwhile, not solved again
        solved = 'ischia_solve_seconds_count{outcome="succeeded"}'  # counted once it is stored
        eventually(lambda: metric(service, solved) >= 2, "the second solve to be counted")
        self.assertEqual(metric(service, solved), 2)
        eventually(lambda: post(service, F=101.5).status == 202, "room to be used again")
        eventually(lambda: service.get("/readyz").status == 200, "it to be ready again")

    @staticmethod
    def refusal(service, ballast):
        ballast.refill()
        answer = post(service, F=100 + time.monotonic() % 1)
        return answer if answer.status == 503 else None

    def test_read_only_disk(self):
        with small_disk() as top:
            with Service(state=top) as service:
                service.until_ready()
                service.submit(F=100.5)
            remount(top, "ro")
            status, said = refused_start(top)
            self.assertEqual(status, 1, said)
            self.assertIn("Read-only file system", said)
            remount(top, "rw")
            with Service(state=top) as service:
                self.assertEqual(len(service.get("/v1/assessments").json()["items"]), 1)


class Descriptors(unittest.TestCase):
    """More clients than descriptors: those who are in are served, and nobody spins."""

    def test_no_descriptors_left(self):
        with Service(within=["prlimit", "--nofile=128:128"]) as service:
            service.until_ready()
            self.assertIn("fewer connections than configured", service.errors())
            inside = service.connect()
            inside.request("GET", "/healthz")
            self.assertEqual(inside.getresponse().read().strip(), b'{"status":"alive"}')
            host, port = service.address.split(":")
            crowd = [socket.create_connection((host, int(port)), PATIENCE_S) for _ in range(200)]
            # a worker that dies now is replaced, and its job done
            os.kill(workers_of(service.process.pid)[0], signal.SIGKILL)
            before = self.cpu_s(service)
            begun = time.monotonic()
            time.sleep(2)
            spent = (self.cpu_s(service) - before) / (time.monotonic() - begun)
            self.assertLess(spent, 0.3, "it is busy although nobody asks for anything")
            inside.request("GET", "/v1/parameters")
            self.assertEqual(inside.getresponse().status, 200)
            inside.close()
            for connection in crowd:
                connection.close()
            self.assertEqual(service.submit(F=100.5)["status"], "succeeded")

    @staticmethod
    def cpu_s(service):
        with open("/proc/%d/stat" % service.process.pid) as file:
            user, system = file.read().rsplit(")", 1)[1].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def test_too_few_to_start(self):
        with tempfile.TemporaryDirectory() as state:
            done = subprocess.run(["prlimit", "--nofile=40:40", *command_line(state)],
                                  capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("raise the limit", done.stderr)


class Workers(unittest.TestCase):
    def after(self, service):
        """The next one is solved all the same."""
        self.assertEqual(service.submit(F=100.5)["status"], "succeeded")
        self.assertIsNone(service.process.poll())

    def test_one_that_hangs(self):
        with Service("--worker-time", "2") as service:
            service.until_ready()
            document = service.submit(F=HANG)
            self.assertEqual(document["status"], "failed")
            self.assertEqual(document["problem"]["type"], "/docs#problem-time-limit")
            self.after(service)

    def test_one_that_is_killed_as_by_the_system_for_memory(self):
        with Service() as service:
            service.until_ready()
            identity = service.submit(wait=0, F=HANG)["id"]
            for kill in range(2):  # the first time it is tried again
                service.until(identity, "running")
                # one that dies before it has said hello has not tried
                eventually(lambda tries=kill: service.errors().count('"worker ready"') > tries,
                           "the worker to be ready")
                time.sleep(0.2)  # and to have taken the job
                died = metric(service, "ischia_worker_deaths_total")
                victim = eventually(lambda: workers_of(service.process.pid), "a worker")[0]
                os.kill(victim, signal.SIGKILL)
                eventually(lambda: metric(service, "ischia_worker_deaths_total") > died,
                           "the death to be seen")
                if kill == 0:
                    eventually(lambda: metric(service, "ischia_workers_busy") == 1, "a second try")
            document = service.until(identity, "failed")
            self.assertEqual(document["problem"]["type"], "/docs#problem-worker-died")
            self.assertIn("killed by signal 9", document["problem"]["detail"])
            self.assertIn("for want of memory", document["problem"]["detail"])
            self.after(service)

    def test_one_that_takes_more_memory_than_allowed(self):
        with Service("--worker-memory", "256") as service:
            service.until_ready()
            document = service.submit(F=MEMORY)
            self.assertEqual(document["status"], "failed")
            self.assertEqual(document["problem"]["type"], "/docs#problem-worker-died")
            self.assertEqual(metric(service, "ischia_worker_deaths_total"), 2)
            self.after(service)


class DamagedDatabase(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.state = folder.name
        with Service(state=self.state) as service:
            service.until_ready()
            for i in range(20):
                service.submit(F=100.5 + i)
        self.path = self.state + "/ischia.sqlite"

    def digest(self):
        """Of the database and what its log holds; a reader may leave an empty log."""
        found = {}
        for name in ("ischia.sqlite", "ischia.sqlite-wal"):
            path = os.path.join(self.state, name)
            if os.path.exists(path) and os.path.getsize(path) > 0:
                with open(path, "rb") as file:
                    found[name] = hashlib.sha256(file.read()).hexdigest()
        return found

    def expect_refusal(self, damage, *words):
        with open(self.path, "r+b") as file:
            damage(file)
        before = self.digest()
        status, said = refused_start(self.state)
        self.assertEqual(status, 2, said)
        for word in words:
            self.assertIn(word, said)
        self.assertEqual(self.digest(), before, "the damaged file was changed")

    def test_damaged_pages(self):
        def damage(file):
            for page in range(2, 12):
                file.seek(page * 4096)
                file.write(b"\xa5" * 512)
        self.expect_refusal(damage, "is damaged", "ischiad restore", "left as it is")

    def test_cut_off(self):
        self.expect_refusal(lambda file: file.truncate(os.path.getsize(self.path) // 2),
                            "is damaged", "ischiad restore")

    def test_not_a_database(self):
        def damage(file):
            file.truncate(0)
            file.write(b"subject,side\nP-1,left\n" * 1000)
        self.expect_refusal(damage, "not a database", "left as it is")


class Restart(unittest.TestCase):
    def test_lock_that_a_killed_daemon_left_to_a_child(self):
        """A process forked at the last moment has the lock too, until it runs and sees."""
        with tempfile.TemporaryDirectory(prefix="ischia-crash-") as state:
            with open(state + "/ischia.lock", "w", encoding="ascii") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                release = threading.Timer(1, fcntl.flock, (lock, fcntl.LOCK_UN))
                release.start()
                with Service(state=state) as service:
                    self.assertFalse(release.is_alive(), "it did not wait for the lock")
                    service.until_ready()


if __name__ == "__main__":
    unittest.main()
