#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/validation: keep.py, readings.py and make.py over the double whose eps_max is a known
polynomial. Run as report_test.py PROGRAM SOURCE_ROOT [unittest arguments]."""

import gzip
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree

PROGRAM = sys.argv[1]
ROOT = pathlib.Path(sys.argv[2])
VALIDATION = ROOT / "docs/validation"


def run(*command, status=0):
    done = subprocess.run(
        [str(c) for c in command], capture_output=True, text=True, timeout=600, check=False
    )
    if done.returncode != status:
        raise AssertionError(
            f"exit {done.returncode}, expected {status}: {command}\n{done.stderr}"
        )
    return done


class Report(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        cls.data = cls.path / "data"
        cohort, table1 = cls.path / "cohort.csv", cls.path / "table1.csv"
        run(PROGRAM, "cohort", ROOT / "examples/table2.csv", "-o", cohort)
        run(
            PROGRAM,
            "study",
            "factorial",
            ROOT / "examples/design_table1.json",
            "-o",
            table1,
            "-q",
            status=1,
        )
        for name, file in (("cohort_default", cohort), ("table1_default", table1)):
            run(
                sys.executable,
                VALIDATION / "keep.py",
                name,
                file,
                "--program",
                PROGRAM,
                "--command",
                "ischia …",
                "--data",
                cls.data,
            )
        run(
            sys.executable,
            VALIDATION / "readings.py",
            "--program",
            PROGRAM,
            "--work",
            cls.path / "work",
            "--design",
            ROOT / "examples/design_table1_composite.json",
            "--only",
            "default,bulk_30",
            "--keep",
            "--data",
            cls.data,
        )
        run(
            *(sys.executable, VALIDATION / "readings.py", "--program", PROGRAM, "--keep"),
            *("--subset", "standard", "--only", "bulk_100", "--work", cls.path / "work_standard"),
            *("--data", cls.data),
        )

        cls.out = cls.path / "out"
        cls.make(cls.out)
        cls.page = (cls.out / "VALIDATION.md").read_text()

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def make(cls, out, status=0):
        return run(
            sys.executable,
            VALIDATION / "make.py",
            "--program",
            PROGRAM,
            "--data",
            cls.data,
            "--out",
            out,
            status=status,
        )

    def test_the_page_says_what_the_files_say(self):
        out, page = self.out, self.page
        for words in (
            "26 of 26 sides converged",
            "**2106 of 2187** solves converged",
            "| μM | −0.1770 | −0.18",
            "| R2² | +0.0985 | +0.1000 |",
            "bulk ratio 30",
            "## All points of Table 1",
            "double: the step fell",
        ):
            self.assertIn(words, page)
        # the misprint of Table 3 is arithmetic on the paper alone: 0.177 sqrt(10 / 38) = 0.0908
        self.assertIn("needs a magnitude of 0.091", page)
        figures = sorted(p.name for p in (out / "validation").iterdir())
        self.assertEqual(
            figures,
            [
                "coefficients_1.svg",
                "coefficients_2.svg",
                "cohort_default.svg",
                "emulator_default.svg",
                "main_effects_default.svg",
                "pressure_default.svg",
                "readings.svg",
            ],
        )
        for name in figures:
            self.assertIn(f"validation/{name}", page)
            root = ElementTree.parse(out / "validation" / name).getroot()
            self.assertTrue(root.find("{http://www.w3.org/2000/svg}title").text)

    def test_the_page_says_what_has_not_been_run(self):
        page = self.page
        missing = page.split("## What has not been run yet")[1].split("\n## ")[0]
        for name in ("cohort_as_published", "table1_as_published", "sobol_default"):
            self.assertIn(f"`{name}`", missing)
        self.assertIn("13 of 15 readings, coarse", missing)
        self.assertIn("3 of 4 readings, standard", missing)
        for name in ("cohort_default", "table1_default"):
            self.assertNotIn(f"`{name}`", missing)

    def test_a_27th_has_the_main_effects_of_the_whole(self):
        section = self.page.split("## Compressibility at standard resolution")[1].split("\n## ")[0]
        row = next(r for r in section.splitlines() if r.startswith("| bulk ratio 100 |"))
        cells = [c.strip() for c in row.strip("|").split("|")]
        doubles = (-0.18, -0.16, 0.12, -0.09, 0.02, 0.02, -0.02)  # μM, R2, F, R1, eM, eF, μF
        for theta, cell in zip(doubles, cells[2:9]):
            self.assertAlmostEqual(float(cell.replace("−", "-")), theta, delta=0.01)
        self.assertIn("| printed |  | −0.1770 | −0.1604 |", section)

    def test_the_runs_that_the_paper_lost_are_left_out_once(self):
        section = self.page.split("## The runs that the paper lost")[1].split("\n## ")[0]
        self.assertIn("| default, all | 2106 | −0.18", section)
        self.assertIn("| default, without 239 | 1948 |", section)

    def test_the_leading_effects_are_said(self):
        page = self.page
        self.assertIn("Table 3 prints μM > R2 > F > R1", page)
        self.assertIn("- default: μM > R2 > F > R1; the order of Table 3, with its signs.", page)
        self.assertIn("Not converged: 81 `diverged_step`", page)

    def test_one_command_makes_what_is_missing(self):
        run_all = [sys.executable, VALIDATION / "run.py", "--program", PROGRAM]
        run_all += ["--work", self.path / "work", "--data", self.path / "all"]
        run_all += ["--out", self.path / "run", "--only", "cohort_default,cohort_as_published"]
        listed = run(*run_all, "--list").stdout
        self.assertEqual(listed.count("to do"), 2)
        run(*run_all)
        self.assertEqual(run(*run_all, "--list").stdout.count("kept"), 2)
        page = (self.path / "run/VALIDATION.md").read_text()
        self.assertEqual(page.count("26 of 26 sides converged"), 2)
        # what is kept and of this version is not made again
        self.assertNotIn("cohort_default", run(*run_all).stderr)

    def test_the_same_files_give_the_same_bytes(self):
        self.make(self.path / "again")
        for path in self.out.rglob("*.*"):
            again = self.path / "again" / path.relative_to(self.out)
            self.assertEqual(path.read_bytes(), again.read_bytes())

    def test_a_changed_file_stops_the_run(self):
        kept = self.data / "cohort_default.csv.gz"
        good = kept.read_bytes()
        kept.write_bytes(
            gzip.compress(gzip.decompress(good).replace(b"table2-1,", b"table2-99,"))
        )
        try:
            self.assertIn(
                "does not match its checksum", self.make(self.path / "bad", status=1).stderr
            )
        finally:
            kept.write_bytes(good)

    def test_the_manifest_says_where_files_come_from(self):
        entry = json.loads((self.data / "manifest.json").read_text())["table1_default"]
        self.assertEqual((entry["rows"], entry["command"]), (2187, "ischia …"))
        self.assertIn("ischia", entry["version"])
        self.assertIn("processors", entry["machine"])


unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
