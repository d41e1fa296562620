#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The emulator from training data to its check, on a stand-in for the solver that is a known
polynomial: training repeats its bytes, the service says what the training says, the held-out test
and brute force write their page. Usage: emulator_test.py PROGRAM SOURCE_ROOT; needs NumPy.
"""

import gzip
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as emulator/kriging.py asks for, before NumPy
try:
    import numpy as np
except ImportError:
    print("skipped: no NumPy (python3-numpy)")
    sys.exit(77)

PROGRAM, ROOT = os.path.abspath(sys.argv.pop(1)), os.path.abspath(sys.argv.pop(1))
sys.path[:0] = [os.path.join(ROOT, "emulator"), os.path.join(ROOT, "tests/api")]
import held_out  # noqa: E402
import service  # noqa: E402
import train  # noqa: E402

TRAINING = (("table1_default", "design_training", 90), ("training_default", "design_training", 5),
            ("training_wide_default", "design_training_wide", 120))
FRESH = (("sobol_default", "design_table1_sobol", 60),)


def run(*words, **more):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, check=False, **more)
    if done.returncode != 0:
        raise AssertionError(f"{words}: {done.returncode}: {done.stderr}")
    return done.stdout


def make_rows(folder, name, design, points):
    plan = json.loads(pathlib.Path(ROOT, "examples", design + ".json").read_text())
    plan["design"].update(points=points, seed=plan["design"]["seed"] + len(name))
    path, out = folder / f"{name}.json", folder / f"{name}.csv"
    path.write_text(json.dumps(plan))
    subprocess.run([PROGRAM, "study", "factorial", path, "-o", out, "-q", "-j", "1"], check=False)
    with gzip.open(folder / f"{name}.csv.gz", "wb") as packed:
        packed.write(out.read_bytes())


def train_into(folder, data, name):
    rows = [data / f"{n}.csv.gz" for n, _, _ in TRAINING]
    out = ("-o", folder / f"{name}.txt", "--manifest", folder / "manifest.json")
    tool = os.path.join(ROOT, "emulator/train.py")
    run(sys.executable, tool, *rows, *out, "--program", PROGRAM, "--rounds", "8")


class Emulator(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.data, cls.out = cls.folder / "data", cls.folder / "out"
        cls.data.mkdir()
        cls.out.mkdir()
        for row in TRAINING + FRESH:
            make_rows(cls.data, *row)
        train_into(cls.out, cls.data, "emulator")
        cls.path = cls.out / "emulator.txt"
        cls.document = held_out.load(cls.path)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def fresh(self):
        return train.read_rows([self.data / "sobol_default.csv.gz"])

    def test_the_same_data_give_the_same_bytes(self):
        train_into(self.out, self.data, "again")
        self.assertEqual(self.path.read_bytes(), (self.out / "again.txt").read_bytes())

    def test_the_manifest_names_what_it_was_made_from(self):
        manifest = json.loads((self.out / "manifest.json").read_text())
        self.assertEqual(manifest["sha256"], self.path.read_text().split("\n")[0].split()[-1])
        self.assertEqual(manifest["data"], self.document["data"])
        self.assertEqual(len(manifest["data"]), 3)

    def test_a_known_polynomial_is_found_and_its_band_holds(self):
        trained = train.read_rows([self.data / f"{n}.csv.gz" for n, _, _ in TRAINING])
        results = held_out.test(self.document, trained, self.fresh())
        eps = next(r for r in results if r["output"] == "eps_max")
        self.assertGreaterEqual(eps["points"], 55)
        self.assertLess(eps["rms"], 0.01)  # eps_max itself spreads by 0.3
        self.assertGreater(eps["in_band"], 0.85)

    def test_the_service_says_what_the_training_says(self):
        emulator = held_out.Emulator(self.document)
        rows = held_out.inside(self.fresh(), emulator.box)[:8]
        output = next(o for o in self.document["outputs"] if o["name"] == "eps_max")
        expected = np.array(emulator.predict(output, rows))
        with service.Service("--emulator", str(self.path), worker=PROGRAM) as daemon:
            daemon.until_ready()
            for row, (value, low, high) in zip(rows, expected.T):
                case = {k: float(row[k]) for k in train.INPUTS}
                said = daemon.ask("POST", "/v1/estimates", case).json()["strain"]["eps_max"]
                self.assertAlmostEqual(said["value"], value, places=6)
                self.assertAlmostEqual(said["low"], low, places=6)
                self.assertAlmostEqual(said["high"], high, places=6)

    def test_one_command_checks_it_and_writes_the_page(self):
        make = os.path.join(ROOT, "emulator/make.py")
        page, work = self.folder / "CHECK.md", self.folder / "work"
        words = ("--work", work, "--data", self.data, "--out", self.out, "--page", page)
        run(sys.executable, make, "--program", PROGRAM, *words, "--only", "held_out,page")
        self.assertIn("| eps_max |", page.read_text())
        self.assertIn("Not made yet", page.read_text())
        brute = os.path.join(ROOT, "emulator/monte_carlo.py")
        figures = self.out / "check/monte_carlo.json"
        words_of_brute = (
            *("--emulator", self.path, "--work", work, "--json", figures),
            *("--persons", "11,left", "--samples", "60"),
        )
        run(sys.executable, brute, "--program", PROGRAM, *words_of_brute)
        blocks = {p: p.stat().st_mtime_ns for p in work.glob("11-left-*0.csv")}
        self.assertEqual(len(blocks), 3)
        before = figures.read_text()
        run(sys.executable, brute, "--program", PROGRAM, *words_of_brute)
        self.assertEqual({p: p.stat().st_mtime_ns for p in blocks}, blocks)  # kept
        self.assertEqual(figures.read_text(), before)
        eps = json.loads(before)["results"][0]["quantities"]["eps_max"]
        for difference, error in zip(eps["difference"], eps["standard_error"]):
            self.assertLess(abs(difference), 0.01 + 4 * error)
        run(sys.executable, make, "--program", PROGRAM, *words, "--only", "page")
        self.assertIn("### Table 2, 11,left", page.read_text())

    def test_missing_data_are_named(self):
        make = os.path.join(ROOT, "emulator/make.py")
        words = ("--work", self.folder, "--data", self.folder, "--out", self.out)
        with self.assertRaisesRegex(AssertionError, "run.py --only table1_default"):
            run(sys.executable, make, "--program", PROGRAM, *words, "--only", "train")


if __name__ == "__main__":
    unittest.main()
