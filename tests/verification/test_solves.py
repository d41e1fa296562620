#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What `ischia` promises about whole solves: convergence, determinism, resolution, domain.

usage: test_solves.py ISCHIA CLASS [unittest arguments]   CLASS: Quick, or one of those that take
       minutes: Cohort, Corners, Domain, Readings
"""
import csv
import itertools
import json
import math
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KEYS = ("R1", "R2", "eM", "eF", "muM", "muF", "F")
COLUMNS = ("R1_mm", "R2_mm", "eM_mm", "eF_mm", "muM_kPa", "muF_kPa", "F_N")
ISCHIA = None
# Factorial levels of Table 1 of Macron et al. (2020); its F is the quarter model's.
LEVELS = ((5, 7, 9), (15, 39, 63), (19, 29, 39), (9, 22, 35), (1, 4.5, 8), (2.8, 5.4, 8),
          (4 * 48, 4 * 77.5, 4 * 107))


def ischia(*arguments, stdin=""):
    return subprocess.run([ISCHIA, *arguments], input=stdin, capture_output=True, text=True,
                          env={**os.environ, "OPENBLAS_NUM_THREADS": "1"}, check=False)


def table2():
    """{"1R": {"R1": 6.9, ...}, ...}"""
    with open(ROOT / "examples/table2.csv", newline="", encoding="utf-8") as file:
        return {row["subject"].removeprefix("table2-") + row["side"][0].upper():
                {k: float(row[c]) for k, c in zip(KEYS, COLUMNS)} for row in csv.DictReader(file)}


def solve(side, **options):
    done = ischia("solve", "-", stdin=json.dumps({**side, **options}))
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def cohort(rows, jobs):
    """The result rows of `ischia cohort` over these parameter rows, as dictionaries."""
    with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
        file.write("\n".join(",".join(str(x) for x in row) for row in [KEYS, *rows]) + "\n")
        file.flush()
        done = ischia("cohort", file.name, "-j", str(jobs))
    return list(csv.DictReader(done.stdout.splitlines())), done


def numbers(result):
    """The result without what a clock measured."""
    kept = json.loads(json.dumps(result))
    for key in ("wall_s", "cpu_s"):
        kept["numerics"].pop(key, None)
    return kept


class Quick(unittest.TestCase):
    def test_three_sides_converge_to_what_is_promised(self):
        for name in ("1R", "7L", "9L"):
            with self.subTest(side=name):
                numerics = solve(table2()[name])["numerics"]
                self.assertTrue(numerics["converged"])
                self.assertLessEqual(numerics["force_residual"], 1e-8)
                self.assertLessEqual(numerics["energy_residual"], 0.005)

    def test_the_same_input_gives_the_same_bits(self):
        first, second = (numbers(solve(table2()["1R"])) for _ in range(2))
        self.assertEqual(first, second)

    def test_neighbours_and_jobs_do_not_change_a_row(self):
        rows = [[table2()[name][k] for k in KEYS] for name in ("1R", "7L", "9L")]
        runs = []
        for order, jobs in ((rows, 1), (rows[::-1], 2)):
            found, done = cohort(order, jobs)
            self.assertEqual(done.returncode, 0, done.stderr)
            runs.append(sorted(tuple(v for k, v in row.items() if k != "wall_s") for row in found))
        self.assertEqual(runs[0], runs[1])

    def test_a_later_attempt_says_so(self):
        """Corners of Table 1 whose paths do not arrive with the usual rule, on the coarse mesh. Which
        fold a path takes may depend on how the BLAS rounds: one of them is enough."""
        corners = ((5, 63, 39, 35, 1, 8, 428), (5, 15, 19, 9, 1, 8, 428))
        found = [solve(dict(zip(KEYS, c)), resolution="coarse")["numerics"] for c in corners]
        self.assertTrue(all(numerics["converged"] for numerics in found))
        said = [numerics["detail"] for numerics in found if numerics["detail"] is not None]
        self.assertGreater(len(said), 0)
        for detail in said:
            self.assertRegex(detail, r"^solved with the corners .* weighing [0-9.]+, not 0.4$")
        self.assertIsNone(solve(table2()["1R"], resolution="coarse")["numerics"]["detail"])

    def test_strain_and_travel_grow_with_the_force(self):
        results = [solve({**table2()["1R"], "F": F}) for F in (50, 100, 196)]
        for key, part in (("eps_max", "strain"), ("displacement_mm", "seat")):
            values = [r[part][key] for r in results]
            self.assertEqual(values, sorted(values))


class Cohort(unittest.TestCase):
    def test_every_side_of_table_2_converges(self):
        rows = [[side[k] for k in KEYS] for side in table2().values()]
        found, done = cohort(rows, os.cpu_count())
        self.assertEqual(len(found), 26)
        failed = [row for row in found if row["status"] != "succeeded"]
        self.assertEqual(failed, [], done.stderr)


class Corners(unittest.TestCase):
    def test_corners_and_centre_of_table_1(self):
        corners = [list(c) for c in itertools.product(*((low, high) for low, _, high in LEVELS))]
        found, _ = cohort(corners + [[middle for _, middle, _ in LEVELS]], os.cpu_count())
        self.assertEqual(len(found), 129)
        failed = [row for row in found if row["status"] != "succeeded"]
        for row in failed:
            print("failed:", *(f"{k}={row[k]}" for k in KEYS), row["reason"])
        self.assertLessEqual(len(failed), 5)
        self.assertEqual({float(row["muM"]) for row in failed} - {1.0}, set())


class Domain(unittest.TestCase):
    def test_a_wider_box_lowers_eps_max_a_little(self):
        for name in ("1R", "9L", "10R"):
            values = [solve(table2()[name], model={"L_over_h": ratio})["strain"]["eps_max"]
                      for ratio in (2, 3, 4)]
            print(f"{name}: L/h 2, 3, 4: " + ", ".join(f"{v:.4f}" for v in values))
            self.assertTrue(all(math.isfinite(v) for v in values))
            self.assertLess(abs(values[2] / values[0] - 1), 0.10)
            self.assertLess(abs(values[2] - values[1]), abs(values[1] - values[0]))


class Readings(unittest.TestCase):
    """What the paper leaves open, one reading at a time: the table in docs/VERIFICATION.md."""
    SIDES = ("1R", "9L", "10R")
    # name, options, and what the reading does to eps_max: raises it (1), lowers it (-1), either (0)
    READINGS = (("R2 of the surface", {"model": {"R2_surface": 1}}, 1),
                ("bone embedded by 1.25 R1", {"model": {"embed_over_R1": 1.25}}, 0),
                ("bone embedded by 1.5 R1", {"model": {"embed_over_R1": 1.5}}, 0),
                ("skin 20 kPa", {"skin": {"mu": 20}}, 0),
                ("skin 200 kPa", {"skin": {"mu": 200}}, 0),
                ("bulk_ratio 20", {"model": {"bulk_ratio": 20}}, -1),
                ("bulk_ratio 50", {"model": {"bulk_ratio": 50}}, -1),
                ("bulk_ratio 200", {"model": {"bulk_ratio": 200}}, -1),
                ("bulk_ratio 10000", {"model": {"bulk_ratio": 10000}}, 1),
                ("no friction", {"model": {"friction": 0}}, 0),
                ("friction 0.2", {"model": {"friction": 0.2}}, 0),
                ("friction 2", {"model": {"friction": 2}}, 0),
                ("L/h 3", {"model": {"L_over_h": 3}}, -1),
                ("L/h 4", {"model": {"L_over_h": 4}}, -1))

    def test_each_reading_moves_eps_max_as_it_should(self):
        usual = {n: solve(table2()[n])["strain"]["eps_max"] for n in self.SIDES}
        print("| reading | " + " | ".join(f"{n} ({v:.4f})" for n, v in usual.items()) + " |")
        for name, options, sign in self.READINGS:
            change = [solve(table2()[n], **options)["strain"]["eps_max"] / v - 1
                      for n, v in usual.items()]
            print(f"| {name} | " + " | ".join(f"{c:+.1%}" for c in change) + " |", flush=True)
            with self.subTest(name):
                self.assertTrue(all(abs(c) < 0.5 for c in change))
                self.assertTrue(all(sign * c > -0.01 for c in change))  # a mesh's error


if __name__ == "__main__":
    ISCHIA = sys.argv.pop(1)
    unittest.main()
