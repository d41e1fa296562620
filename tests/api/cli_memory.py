# SPDX-License-Identifier: GPL-3.0-or-later
"""The program with its 1st, 2nd, 3rd ... allocation failing: it says so and ends, or copes."""
import json
import os

import cli
from cli import GOOD, HEADER, run

TEXT = json.dumps(GOOD)
ROWS = HEADER + "\n" + "7.1,22.8,31,10,8,5,258\nx,22.8,31,10,8,5,258\n" * 2


class Memory(cli.Case):
    def starve(self, nth, and_all_after, *arguments, stdin):
        more = {"FAIL_ALLOCATION": str(nth), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        if and_all_after:
            more["FAIL_ALLOCATION_ON"] = "1"
        return run(*arguments, stdin=stdin, env={**os.environ, **more})

    def fail_each(self, status, at_least, *arguments, stdin):
        """Each run either says that memory was short and ends with 1, or does what it does otherwise
        (the C library gets by without a buffer). at_least: how many runs are to end so."""
        short = 0
        for nth in range(1, 60):
            done = self.starve(nth, nth % 2, *arguments, stdin=stdin)
            if b"out of memory" in done.stderr or b"Cannot allocate memory" in done.stderr:
                self.assertIn(done.returncode, (1, 2) if status == 2 else (1,), (nth, done.stderr))
                short += 1
            else:
                self.assertEqual(done.returncode, status, (nth, done.stderr))
        self.assertGreaterEqual(short, at_least)
        self.assertEqual(self.starve(10000, False, *arguments, stdin=stdin).returncode, status)

    def test_solve(self):
        self.fail_each(0, 5, "solve", stdin=TEXT)
        self.fail_each(0, 5, "solve", "--summary", "--vtu", self.path("a.vtu"), stdin=TEXT)
        self.assertEqual(os.listdir(self.folder.name), ["a.vtu"])

    def test_cohort(self):
        self.fail_each(2, 3, "cohort", "-o", self.path("out.csv"), stdin=ROWS)

    def test_export(self):
        self.fail_each(0, 3, "export", "--inp", "-o", self.path("a.inp"), stdin=TEXT)


if __name__ == "__main__":
    cli.main()
