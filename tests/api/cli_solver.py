# SPDX-License-Identifier: GPL-3.0-or-later
"""The program on the real solver: coarse solves of rows of Table 2."""
import csv
import io
import json
import os
import xml.dom.minidom

import cli
from cli import GOOD, HEADER, run

COARSE = json.dumps({**GOOD, "resolution": "coarse"})
ROWS = ["6.9,19.7,28,10,8.0,5.0,196", "7.1,22.8,31,10,8.0,5.0,258", "6.9,20.3,26,33,4.8,3.75,251"]


def without_clock(rows):
    return [{k: v for k, v in r.items() if k != "wall_s"} for r in rows]


class Solver(cli.Case):
    def test_a_side(self):
        done = run("solve", "--vtu", self.path("a.vtu"), "--svg", self.path("a.svg"), stdin=COARSE,
                   timeout=1200)
        self.assertEnds(done, 0, 0)
        result = json.loads(done.stdout)
        numerics, strain = result["numerics"], result["strain"]
        self.assertTrue(numerics["converged"])
        self.assertLessEqual(numerics["force_residual"], 1e-8)
        self.assertGreater(numerics["det_F_min"], 0)
        self.assertLessEqual(abs(numerics["energy_residual"]), 0.005)
        self.assertGreater(numerics["wall_s"], 0)
        self.assertGreater(numerics["cpu_s"], 0)
        self.assertTrue(0.5 < strain["eps_max"] < 3)
        self.assertLessEqual(abs(result["load_curve"][-1]["F_N"] / 258 - 1), 1e-8)
        for name in ("a.vtu", "a.svg"):
            with open(self.path(name), "rb") as file:
                xml.dom.minidom.parseString(file.read())

    def test_the_same_bits_from_solve_and_from_cohort_with_1_and_2_processes(self):
        text = HEADER + "\n" + "\n".join(ROWS + ROWS[:1])
        tables = []
        for jobs in ("1", "2"):
            done = run("cohort", "--resolution", "coarse", "-j", jobs, stdin=text, timeout=1200)
            self.assertEnds(done, 0, 0)
            tables.append(without_clock(csv.DictReader(io.StringIO(done.stdout.decode()))))
        self.assertEqual(tables[0], tables[1])
        first, last = tables[0][0], tables[0][3]
        self.assertEqual(first, last)
        alone = json.loads(run("solve", stdin=COARSE, timeout=1200).stdout)
        self.assertEqual(repr(alone["strain"]["eps_max"]), tables[0][1]["eps_max"])
        self.assertEqual(repr(alone["seat"]["displacement_mm"]), tables[0][1]["seat_displacement_mm"])

    def test_export_and_check_tangent(self):
        deck = run("export", "--inp", stdin=COARSE)
        self.assertEnds(deck, 0, 0)
        self.assertIn(b"*NODE", deck.stdout.upper())
        self.assertEnds(run("check-tangent", timeout=1200), 0, 0)

    def test_one_blas_thread_whatever_the_environment_says(self):
        for threads in ("1", "8"):
            env = {**os.environ, "OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads}
            done = run("version", env=env)
            self.assertRegex(done.stdout.decode(), r"CHOLMOD [0-9.]+")


if __name__ == "__main__":
    cli.main()
