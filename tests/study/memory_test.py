#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`ischia study` with its 1st, 2nd, 3rd ... allocation failing: it says so and ends, or does
without; what it leaves behind is whole. Run as memory_test.py STARVED_PROGRAM SOURCE_ROOT."""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv[1]
ROOT = pathlib.Path(sys.argv[2])
DESIGN = ROOT / "examples/design_table1_composite.json"
PUBLISHED = ROOT / "docs/validation/published/macron2020.json"


def run(*arguments, nth=0):
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    if nth:
        environment["FAIL_ALLOCATION"] = str(nth)
    return subprocess.run(
        [PROGRAM, "study", *map(str, arguments)],
        capture_output=True,
        text=True,
        env=environment,
        timeout=600,
        check=False,
    )


class Memory(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.folder.name)
        self.results = self.path / "results.csv"
        done = run("factorial", DESIGN, "-o", self.results, "-q", "-j", 1)
        self.assertEqual(done.returncode, 0, done.stderr)

    def tearDown(self):
        self.folder.cleanup()

    def fail_each(self, runs, at_least, *arguments, output=None):
        """The output file is there, whole, when the status is 0, and not there otherwise."""
        good = run(*arguments)
        self.assertEqual(good.returncode, 0, good.stderr)
        whole = output.read_bytes() if output else None
        short = 0
        for nth in runs:
            if output:
                output.unlink(missing_ok=True)
            done = run(*arguments, nth=nth)
            if done.returncode == 0:
                self.assertEqual(done.stdout, good.stdout, nth)
            else:
                self.assertEqual(done.returncode, 1, (nth, done.stderr))
                self.assertRegex(done.stderr, "out of memory|Cannot allocate memory", nth)
                short += 1
            if output:
                there = output.read_bytes() if output.exists() else None
                self.assertEqual(there, whole if done.returncode == 0 else None, nth)
        self.assertGreaterEqual(short, at_least)

    def test_points(self):
        out = self.path / "points.csv"
        self.fail_each(range(1, 90), 20, "factorial", DESIGN, "--points", "-o", out, output=out)

    def test_emulate(self):
        out = self.path / "fit.json"
        self.fail_each(
            [*range(1, 40), *range(2600, 2700, 2)],
            20,
            "emulate",
            self.results,
            "--design",
            DESIGN,
            "--published",
            PUBLISHED,
            "-o",
            out,
            output=out,
        )

    def test_compare(self):
        out = self.path / "compare.json"
        self.fail_each(
            [*range(1, 20), *range(2540, 2600)],
            20,
            "compare",
            self.results,
            self.results,
            "-o",
            out,
            output=out,
        )

    def test_merge(self):
        out = self.path / "merged.csv"
        self.fail_each(range(1, 200, 3), 20, "merge", DESIGN, self.results, "-o", out, output=out)

    def test_factorial_goes_on_after_running_short(self):
        out = self.path / "short.csv"
        short = 0
        for nth in range(60, 400, 12):
            short += run("factorial", DESIGN, "-o", out, "-q", "-j", 2, nth=nth).returncode == 1
        self.assertGreater(short, 3)
        self.assertEqual(run("factorial", DESIGN, "-o", out, "-q", "-j", 2).returncode, 0)
        self.assertEqual(out.read_bytes(), self.results.read_bytes())


unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
