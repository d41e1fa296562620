#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""kill -9 of ischiad while it works through a study: kill_study.py MOMENTS [SEED], the daemon in
$ISCHIAD. In the end every point has been solved once, and the results are, byte for byte, those of
a daemon that nobody killed.
"""
import os
import random
import sys
import tempfile
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../api"))
from service import Service, eventually, side  # noqa: E402  (the path comes first)

DESIGN = {
    "name": "killed",
    "design": {"kind": "full"},
    "factors": [
        {"key": "R1", "levels": [5, 6, 7, 8]},
        {"key": "F", "levels": [100 + i for i in range(15)] + [598]},  # 598 N: a problem
    ],
    "case": side(R1=None, F=None),
    "responses": ["eps_max", "newton_iterations", "last_converged_F_N"],
}
ROWS = 64


def wait_for_end(service, study):
    eventually(lambda: service.get(study).json()["status"] == "finished", study)
    return service.get(study + "/results", Accept="text/csv").body


def undisturbed():
    with Service() as service:
        study = service.ask("POST", "/v1/studies", DESIGN).headers["Location"]
        return wait_for_end(service, study)


def ended(service, study):
    points = service.get(study).json()["points"]
    return points["succeeded"] + points["failed"]


def main(moments, seed):
    pick = random.Random(seed)
    expected = undisturbed()
    lines = expected.decode().splitlines()
    assert len(lines) == ROWS + 1
    for line in lines[1:]:  # each point has its own case's result
        cells = line.split(",")
        good = cells[8] == "succeeded" and float(cells[11]) == 1000 * float(cells[7])
        assert good or (cells[8] == "failed" and cells[7] == "598"), line
    with tempfile.TemporaryDirectory(prefix="ischia-kill-study-") as state:
        service = Service(state=state)
        study = service.ask("POST", "/v1/studies", DESIGN).headers["Location"]
        service.kill()  # what was answered 202 is there
        done = 0
        for _ in range(moments):
            service = Service(state=state)
            before = ended(service, study)
            assert before >= done, (before, done)  # nothing that had ended is lost
            eventually(lambda: ended(service, study) > before or before == ROWS, "one more point")
            time.sleep(pick.uniform(0, 0.1))
            done = ended(service, study)
            service.kill()
        with Service(state=state) as service:
            assert wait_for_end(service, study) == expected
    print(f"{moments} kills, {done} of {ROWS} points ended before the last, results the same")


main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 7)
