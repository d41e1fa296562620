#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`ischia study` from outside, over the double of the solver (tests/double): run as
study_test.py PROGRAM SOURCE_ROOT [unittest arguments]."""

import csv
import json
import math
import os
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = sys.argv[1]
ROOT = pathlib.Path(sys.argv[2])
TABLE1 = ROOT / "examples/design_table1.json"
PUBLISHED = ROOT / "docs/validation/published/macron2020.json"
DOUBLE = {
    "R1": -0.09,
    "R2": -0.16,
    "eM": 0.02,
    "eF": 0.02,
    "muM": -0.18,
    "muF": -0.02,
    "F": 0.12,
    "muM^2": -0.05,
    "R2^2": 0.1,
    "F^2": -0.04,
    "R1^2": 0.02,
    "eM*muM": -0.115,
    "muM*F": 0.108,
    "1": 1.3,
}


def run(*arguments, status=0, **environment):
    done = subprocess.run(
        [PROGRAM, "study", *map(str, arguments)],
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
        timeout=600,
    )
    if done.returncode != status:
        raise AssertionError(
            f"exit {done.returncode}, expected {status}: {arguments}\n{done.stderr}"
        )
    return done


def rows_of(path):
    with open(path, newline="") as text:
        return list(csv.DictReader(text))


class InTemporaryFolder(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.folder.name)

    def tearDown(self):
        self.folder.cleanup()

    def design(self, **members):
        path = self.path / "design.json"
        base = json.loads(TABLE1.read_text())
        base.update(members)
        path.write_text(json.dumps({k: v for k, v in base.items() if v is not None}))
        return path


class Designs(InTemporaryFolder):
    def test_examples_have_the_right_number_of_points(self):
        for name, rows in (
            ("table1", 2187),
            ("table1_ninth", 243),
            ("table1_27th", 81),
            ("table1_composite", 79),
            ("table1_sobol", 256),
            ("table1_morris", 160),
        ):
            design = ROOT / f"examples/design_{name}.json"
            lines = run("factorial", design, "--points").stdout.splitlines()
            self.assertEqual(len(lines), rows + 1, name)
            self.assertEqual(len({line.split(",", 1)[1] for line in lines[1:]}), rows, name)

    def test_table1_covers_each_level_equally(self):
        points = list(csv.DictReader(run("factorial", TABLE1, "--points").stdout.splitlines()))
        for factor in json.loads(TABLE1.read_text())["factors"]:
            values = [float(p[factor["key"]]) for p in points]
            self.assertEqual(sorted(set(values)), [float(v) for v in factor["levels"]])
            for level in factor["levels"]:
                self.assertEqual(values.count(level), 729)

    def test_every_fault_is_named_at_once(self):
        design = self.design(
            design={"kind": "fall", "sede": 3},
            responses=["eps_mux"],
            factors=[{"key": "muX", "levels": [1, 2]}, {"key": "R1", "levels": [2, 1]}],
        )
        said = run("factorial", design, "--points", status=2).stderr
        for word in ("/design/kind", "/design/sede", "eps_mux", "muX", "/factors/1", "R2 is"):
            self.assertIn(word, said)

    def test_what_would_not_be_heeded_is_refused(self):
        design = self.design(
            design={
                "kind": "full",
                "points": 3,
                "axial": 2,
                "fraction": {"modulus": 2, "generators": [[1, 1, 1]]},
            },
            factors=[
                {"key": "F", "levels": [200, 300], "max": 400},
                {"key": "R1", "levels": [5, 7]},
            ],
            responses=["eps_max", "E_comp_max", "eps_max"],
        )
        said = run("factorial", design, "--points", status=2).stderr
        for word in (
            "/design/points",
            "/design/axial",
            "/design/fraction",
            "/factors/0",
            "eps_max is a response already",
        ):
            self.assertIn(word, said)

    def test_model_options_are_factors_and_constants(self):
        design = self.design(
            factors=[
                {"key": "model.bulk_ratio", "levels": [20, 2000]},
                {"key": "F", "levels": [200, 300]},
            ],
            case={
                "R1": 7,
                "R2": 20,
                "eM": 30,
                "eF": 10,
                "muM": 5,
                "muF": 5,
                "skin": {"mu": 100},
                "resolution": "coarse",
            },
            responses=["eps_max"],
        )
        run("factorial", design, "-o", self.path / "out.csv", "-q")
        rows = rows_of(self.path / "out.csv")
        self.assertEqual([r["model.bulk_ratio"] for r in rows], ["20", "20", "2000", "2000"])
        self.assertEqual(
            list(rows[0]),
            [
                "row",
                "R1",
                "R2",
                "eM",
                "eF",
                "muM",
                "muF",
                "F",
                "model.bulk_ratio",
                "status",
                "reason",
                "eps_max",
            ],
        )

    def test_a_named_model_is_chosen_for_a_design_that_does_not_say(self):
        factors = [{"key": "F", "levels": [200, 300]}]
        case = {"R1": 7, "R2": 20, "eM": 30, "eF": 10, "muM": 5, "muF": 5}
        plain = self.design(factors=factors, case=case)
        run("factorial", plain, "-o", self.path / "out.csv", "-q", "--model", "as-published")
        # another model is another study: its journal is not gone on with
        run("factorial", plain, "-o", self.path / "out.csv", "-q", status=2)
        named = self.design(factors=factors, case={**case, "model": "as-published"})
        run("factorial", named, "-o", self.path / "out.csv", "-q")  # the same study, said otherwise
        said = run("factorial", named, "--model", "default", "--points", status=2).stderr
        self.assertIn("model is given more than once", said)
        said = run("factorial", plain, "--model", "printed", "--points", status=2).stderr
        self.assertIn("default, as-published", said)

    def test_a_missing_input_is_asked_for(self):
        design = self.design(factors=[{"key": "F", "levels": [200, 300]}])
        self.assertIn("muM", run("factorial", design, "--points", status=2).stderr)

    def test_impossible_points_are_refused_rows(self):
        design = self.design(
            factors=[{"key": "R1", "levels": [5, 12]}, {"key": "R2", "levels": [9, 20]}],
            case={"eM": 30, "eF": 10, "muM": 5, "muF": 5, "F": 250},
        )
        run("factorial", design, "-o", self.path / "out.csv", "-q", status=1)
        rows = rows_of(self.path / "out.csv")
        self.assertEqual(
            [r["status"] for r in rows], ["succeeded", "succeeded", "refused", "succeeded"]
        )
        self.assertIn("R2 >= R1", rows[2]["reason"])


class Resuming(InTemporaryFolder):
    def whole(self):
        run("factorial", TABLE1, "-o", self.path / "whole.csv", "-j", 2, "-q", status=1)
        return (self.path / "whole.csv").read_bytes()

    def test_rows_say_why_they_failed(self):
        self.whole()
        rows = rows_of(self.path / "whole.csv")
        failed = [r for r in rows if r["status"] == "failed"]
        self.assertEqual(len(rows), 2187)
        self.assertEqual(len(failed), 81)
        self.assertIn("diverged_step: double", failed[0]["reason"])
        self.assertEqual((failed[0]["last_converged_F_N"], failed[0]["eps_max"]), ("300", ""))

    def test_the_number_of_processes_does_not_show(self):
        whole = self.whole()
        run("factorial", TABLE1, "-o", self.path / "one.csv", "-j", 1, "-q", status=1)
        self.assertEqual((self.path / "one.csv").read_bytes(), whole)

    def test_kill_9_at_any_time_and_resume(self):
        whole = self.whole()
        pick = random.Random(9)
        out, journal = self.path / "killed.csv", self.path / "killed.csv.journal"
        for _ in range(8):
            before = journal.stat().st_size if journal.exists() else 0
            study = subprocess.Popen(
                [PROGRAM, "study", "factorial", TABLE1, "-o", out, "-j", "2", "-q"],
                env={**os.environ, "ISCHIA_DOUBLE_DELAY_MS": "5"},
            )
            while not journal.exists() or journal.stat().st_size <= before:
                time.sleep(0.002)
            time.sleep(pick.uniform(0, 0.2))
            self.assertIsNone(study.poll())
            study.kill()
            study.wait()
            self.assertFalse(out.exists())
        lines = len(journal.read_bytes().splitlines())
        self.assertGreater(lines, 8)
        self.assertLess(lines, 2187)
        run("factorial", TABLE1, "-o", out, "-j", 2, "-q", status=1)
        self.assertEqual(out.read_bytes(), whole)
        run("factorial", TABLE1, "-o", out, "-j", 2, "-q", status=1)  # nothing left to do
        self.assertEqual(out.read_bytes(), whole)

    def test_a_cut_or_damaged_journal_loses_only_its_lines(self):
        whole = self.whole()
        out, journal = self.path / "whole.csv", self.path / "whole.csv.journal"
        good = journal.read_bytes()
        pick = random.Random(4)
        for case in range(6):
            bad = bytearray(good[: pick.randrange(10, len(good))])
            for _ in range(case):
                bad[pick.randrange(90, len(bad))] ^= 1 << pick.randrange(7)
            journal.write_bytes(bad)
            out.unlink()
            run("factorial", TABLE1, "-o", out, "-j", 2, "-q", status=1)
            self.assertEqual(out.read_bytes(), whole)

    def test_another_design_does_not_mix(self):
        out = self.path / "out.csv"
        run(
            "factorial", ROOT / "examples/design_table1_composite.json", "-o", out, "-q", status=1
        )
        said = run(
            "factorial", ROOT / "examples/design_table1_ninth.json", "-o", out, "-q", status=2
        )
        self.assertIn("another design", said.stderr)

    def test_two_processes_do_not_share_a_journal(self):
        out = self.path / "out.csv"
        first = subprocess.Popen(
            [PROGRAM, "study", "factorial", TABLE1, "-o", out, "-j", "1", "-q"],
            env={**os.environ, "ISCHIA_DOUBLE_DELAY_MS": "50"},
        )
        journal = self.path / "out.csv.journal"
        while not journal.exists() or journal.stat().st_size == 0:
            time.sleep(0.01)  # it has the lock before it writes
        said = run("factorial", TABLE1, "-o", out, "-q", status=2).stderr
        first.kill()
        first.wait()
        self.assertIn("another process", said)

    def test_workers_end_with_their_parent(self):
        study = subprocess.Popen(
            [PROGRAM, "study", "factorial", TABLE1, "-o", self.path / "o.csv", "-j", "2", "-q"],
            env={**os.environ, "ISCHIA_DOUBLE_DELAY_MS": "200"},
        )
        path = pathlib.Path(f"/proc/{study.pid}/task/{study.pid}/children")
        for _ in range(5000):
            children = path.read_text().split()
            if len(children) == 2:
                break
            time.sleep(0.02)
        self.assertEqual(len(children), 2)
        study.kill()
        study.wait()
        for _ in range(5000):
            alive = [
                c
                for c in children
                if pathlib.Path(f"/proc/{c}/stat").exists()
                and pathlib.Path(f"/proc/{c}/stat").read_text().rsplit(")", 1)[1].split()[0]
                != "Z"
            ]
            if not alive:
                return
            time.sleep(0.02)
        self.fail(f"still there: {alive}")

    def test_a_process_that_dies_costs_its_row_alone(self):
        design = self.design(
            factors=[
                {"key": "R1", "levels": [7, 8.125, 9]},
                {"key": "F", "levels": [200, 250, 300]},
            ],
            case={"R2": 30, "eM": 30, "eF": 10, "muM": 5, "muF": 5},
        )
        run("factorial", design, "-o", self.path / "out.csv", "-j", 2, "-q", status=1)
        rows = rows_of(self.path / "out.csv")
        self.assertEqual(
            [r["status"] for r in rows], ["succeeded"] * 3 + ["failed"] * 3 + ["succeeded"] * 3
        )
        self.assertIn("solver process died", rows[3]["reason"])

    def test_progress_tells_what_is_left(self):
        design = ROOT / "examples/design_table1_composite.json"
        said = run("factorial", design, "-o", self.path / "out.csv", status=1).stderr
        self.assertIn("79/79 rows", said)
        self.assertIn("took", said)


class Shards(InTemporaryFolder):
    def test_merged_shards_equal_one_run(self):
        run("factorial", TABLE1, "-o", self.path / "whole.csv", "-q", status=1)
        shards = []
        for i in range(1, 6):
            shards.append(self.path / f"s{i}.csv")
            run("factorial", TABLE1, "-o", shards[-1], "--shard", f"{i}/5", "-q", status=1)
        self.assertEqual(sum(len(rows_of(s)) for s in shards), 2187)
        run("merge", TABLE1, *reversed(shards), "-o", self.path / "merged.csv")
        self.assertEqual(
            (self.path / "merged.csv").read_bytes(), (self.path / "whole.csv").read_bytes()
        )
        shards[0].write_bytes(shards[0].read_bytes().replace(b"\n", b"\r\n"))
        run("merge", TABLE1, *shards, "-o", self.path / "merged.csv")
        self.assertEqual(
            (self.path / "merged.csv").read_bytes(), (self.path / "whole.csv").read_bytes()
        )
        said = run("merge", TABLE1, *shards[:4], "-o", self.path / "m.csv", status=2).stderr
        self.assertIn("435 of 2187 rows are in no shard, the first is row 13", said)

    def test_a_row_of_another_design_or_another_result_is_refused(self):
        design = ROOT / "examples/design_table1_composite.json"
        run("factorial", design, "-o", self.path / "a.csv", "-q", status=1)
        said = run(
            "merge", TABLE1, self.path / "a.csv", "-o", self.path / "m.csv", status=2
        ).stderr
        self.assertIn("does not have the inputs", said)
        changed = (
            (self.path / "a.csv")
            .read_text()
            .replace("succeeded,converged,1", "succeeded,converged,2")
        )
        (self.path / "b.csv").write_text(changed)
        said = run(
            "merge",
            design,
            self.path / "a.csv",
            self.path / "b.csv",
            "-o",
            self.path / "m.csv",
            status=2,
        ).stderr
        self.assertIn("another result", said)

    def test_a_shard_that_was_cut_off_is_refused(self):
        design = ROOT / "examples/design_table1_composite.json"
        shard, cut = self.path / "a.csv", self.path / "cut.csv"
        run("factorial", design, "-o", shard, "-q", status=1)
        for missing in (1, 4):  # the line's end alone, and digits of its last number
            cut.write_bytes(shard.read_bytes()[:-missing])
            said = run("merge", design, cut, "-o", self.path / "m.csv", status=2).stderr
            self.assertIn(f"{cut} ends within a line", said)
        self.assertFalse((self.path / "m.csv").exists())

    def test_bad_shards_are_bad_usage(self):
        for shard in ("0/3", "4/3", "1", "1/", "x/2", "1/2x"):
            run("factorial", TABLE1, "-o", self.path / "o.csv", "--shard", shard, status=2)


class Columns(InTemporaryFolder):
    def test_a_study_records_what_a_cohort_does(self):
        design = ROOT / "examples/design_table1_composite.json"
        run("factorial", design, "-o", self.path / "study.csv", "-q", status=1)
        study = rows_of(self.path / "study.csv")
        factors = [f["key"] for f in json.loads(design.read_text())["factors"]]
        with open(self.path / "in.csv", "w", encoding="utf-8") as out:
            out.write(",".join(factors) + "\n")
            out.writelines(",".join(r[f] for f in factors) + "\n" for r in study)
        command = [PROGRAM, "cohort", self.path / "in.csv", "-o", self.path / "cohort.csv"]
        subprocess.run(command, capture_output=True, check=False, timeout=600)
        cohort = rows_of(self.path / "cohort.csv")
        self.assertEqual(len(cohort), 79)
        for ours, theirs in zip(study, cohort):
            for column in set(theirs) - {"reason", "wall_s"}:
                self.assertEqual(ours[column], theirs[column], column)


class Emulation(InTemporaryFolder):
    def emulate(self, design, *more):
        run("factorial", design, "-o", self.path / "out.csv", "-q", status=1)
        run(
            "emulate",
            self.path / "out.csv",
            "--design",
            design,
            "-o",
            self.path / "fit.json",
            *more,
        )
        return json.loads((self.path / "fit.json").read_text())

    def test_the_doubles_polynomial_comes_back(self):
        for name in ("table1", "table1_ninth", "table1_composite"):
            fit = self.emulate(ROOT / f"examples/design_{name}.json")["fits"][1]
            self.assertEqual(len(fit["coefficients"]), 36)
            for c in fit["coefficients"]:
                self.assertAlmostEqual(
                    c["theta"], DOUBLE.get(c["term"], 0), delta=1e-10, msg=c["term"]
                )
            self.assertLess(fit["mean_squared_residuals"], 1e-20)
            (self.path / "out.csv.journal").unlink()

    def test_sensitivities_are_the_papers_formulas(self):
        fit = self.emulate(TABLE1)["fits"][1]
        moment = {}
        for name, theta in DOUBLE.items():
            moment[name] = theta**2 * (
                0 if name == "1" else 4 / 45 if "^" in name else 1 / 9 if "*" in name else 1 / 3
            )
        total = sum(moment.values())
        for c in fit["coefficients"]:
            self.assertAlmostEqual(
                c["share_percent"], 100 * moment.get(c["term"], 0) / total, places=9
            )
        muM = next(p for p in fit["parameters"] if p["key"] == "muM")
        self.assertAlmostEqual(
            muM["sobol_first_order"], (moment["muM"] + moment["muM^2"]) / total
        )
        self.assertAlmostEqual(
            muM["sobol_total"], sum(v for k, v in moment.items() if "muM" in k) / total
        )

    def test_published_values_stand_beside_ours(self):
        fit = self.emulate(TABLE1, "--published", PUBLISHED)["fits"]
        beside = fit[1]["against_published"]
        ours = {"eM*muM": -0.115, "muM*F": 0.108, **DOUBLE}
        printed = {
            c["term"]: c["published_theta"]
            for c in fit[1]["coefficients"]
            if c["published_theta"] is not None
        }
        self.assertEqual(len(printed), 11)
        self.assertEqual(printed["eM*muM"], -0.1153)
        squares = [(ours.get(t, 0) - p) ** 2 for t, p in printed.items()]
        self.assertAlmostEqual(beside["distance"], math.sqrt(sum(squares) / 11))
        self.assertAlmostEqual(
            beside["relative_distance"],
            math.sqrt(sum(squares) / sum(p**2 for p in printed.values())),
        )
        self.assertEqual(fit[0]["against_published"]["same_sign"], 7)

    def test_levels_default_to_the_extent_of_the_columns(self):
        with_design = self.emulate(TABLE1)
        run("emulate", self.path / "out.csv", "-o", self.path / "plain.json")
        plain = json.loads((self.path / "plain.json").read_text())
        self.assertEqual(plain["factors"], with_design["factors"])
        self.assertEqual(plain["rows_used"], 2106)

    def test_a_small_design_gives_degree_1_alone(self):
        design = self.design(
            factors=[{"key": "R1", "levels": [5, 9]}, {"key": "F", "levels": [200, 400]}],
            case={"R2": 30, "eM": 30, "eF": 10, "muM": 5, "muF": 5},
        )
        run("factorial", design, "-o", self.path / "out.csv", "-q")
        said = run("emulate", self.path / "out.csv").stdout
        self.assertIn("Degree 1: mean", said)
        self.assertIn("Degree 2: 4 rows cannot identify 6 terms", said)

    def test_an_unknown_response_is_bad_input(self):
        run(
            "factorial",
            ROOT / "examples/design_table1_composite.json",
            "-o",
            self.path / "o.csv",
            "-q",
            status=1,
        )
        self.assertIn(
            "no column eps_mux",
            run("emulate", self.path / "o.csv", "--response", "eps_mux", status=2).stderr,
        )


class Comparison(InTemporaryFolder):
    def expected(self, sample):
        rows = rows_of(ROOT / "tests/unit/data/pairs_expected.csv")
        return {
            k: float(v)
            for k, v in next(r for r in rows if r["sample"] == sample).items()
            if k != "sample"
        }

    def write_sample(self, sample):
        rows = [r for r in rows_of(ROOT / "tests/unit/data/pairs.csv") if r["sample"] == sample]
        a = [f"S{i},right,{r['a']}" for i, r in enumerate(rows)]
        b = [f"S{i},right,{r['b']}" for i, r in enumerate(rows)]
        random.Random(1).shuffle(b)
        (self.path / "a.csv").write_text("subject,side,eps_max\n" + "\n".join(a) + "\n")
        (self.path / "b.csv").write_text(
            "subject,side,eps_max\n" + "\n".join(b) + "\nS99,left,1\n"
        )

    def test_two_files_agree_with_scipy(self):
        self.write_sample("strong")
        run("compare", self.path / "a.csv", self.path / "b.csv", "-o", self.path / "c.json")
        document = json.loads((self.path / "c.json").read_text())
        pair, e = document["pairs"][0], self.expected("strong")
        self.assertEqual((pair["a"], pair["b"], pair["n"]), ("A eps_max", "B eps_max", 26))
        got = {
            "pearson_r": pair["pearson_r"],
            "pearson_p": pair["pearson_p"],
            "pearson_low": pair["pearson_ci95"][0],
            "pearson_high": pair["pearson_ci95"][1],
            "spearman_rho": pair["spearman_rho"],
            "mean_square": pair["mean_squared_error"],
            "corrected_mean_square": pair["corrected_mean_squared_error"],
            "bias": pair["bland_altman"]["bias"],
            "limit_high": pair["bland_altman"]["limits_of_agreement"][1],
        }
        for name, value in got.items():
            self.assertAlmostEqual(value, e[name], delta=1e-10 * (abs(e[name]) + 1e-3), msg=name)

    def test_a_cohort_is_compared_with_pressure_and_baseline(self):
        out = self.path / "cohort.csv"
        run(
            "factorial", ROOT / "examples/design_table1_composite.json", "-o", out, "-q", status=1
        )
        run("compare", out, "-o", self.path / "c.json", "--table", self.path / "t.csv")
        document = json.loads((self.path / "c.json").read_text())
        self.assertEqual(
            [p["a"] for p in document["pairs"]],
            ["mean_pressure_kPa", "peak_pressure_kPa", "eps_hertz"],
        )
        self.assertNotIn("bland_altman", document["pairs"][0])
        self.assertIn("bland_altman", document["pairs"][2])
        joined = rows_of(self.path / "t.csv")
        self.assertEqual(len(joined), 79)
        self.assertTrue(all(float(r["eps_hertz"]) > 0 for r in joined))
        self.assertEqual({r["hertz_valid"] for r in joined}, {"no"})

    def test_too_few_pairs_is_said_not_made_up(self):
        (self.path / "a.csv").write_text("eps_max\n1\n2\n")
        said = run("compare", self.path / "a.csv", self.path / "a.csv").stdout
        self.assertIn("at least 3 pairs", said)

    def test_unknown_keys_and_columns_are_bad_input(self):
        self.write_sample("strong")
        a, b = self.path / "a.csv", self.path / "b.csv"
        self.assertIn("key column", run("compare", a, b, "--key", "person", status=2).stderr)
        self.assertIn("no column", run("compare", a, b, "--b-column", "eps", status=2).stderr)
        run("compare", status=2)


class Files(InTemporaryFolder):
    def test_an_output_never_replaces_an_input(self):
        design, results = self.path / "d.json", self.path / "r.csv"
        design.write_bytes(pathlib.Path(TABLE1).read_bytes())
        results.write_text("R1,eps_max\n1,2\n2,3\n")
        for arguments in (
            ("factorial", design, "-o", design),
            ("factorial", design, "--points", "-o", design),
            ("merge", design, results, "-o", results),
            ("emulate", results, "-o", results),
            ("emulate", results, "--design", design, "-o", design),
            ("compare", results, "-o", results),
            ("compare", results, "--table", results),
        ):
            before = design.read_bytes(), results.read_bytes()
            self.assertIn("is the input", run(*arguments, status=2).stderr)
            self.assertEqual((design.read_bytes(), results.read_bytes()), before)
        both = self.path / "both"
        said = run("compare", results, "-o", both, "--table", both, status=2).stderr
        self.assertIn("--output and --table both name", said)
        self.assertFalse(both.exists())

    def test_where_a_result_cannot_go_is_said_before_the_work(self):
        said = run("factorial", TABLE1, "-o", self.path, status=2).stderr
        self.assertIn("is a directory; give a file", said)
        run("factorial", TABLE1, "-o", self.path / "no/o.csv", status=1)
        self.assertEqual(list(self.path.iterdir()), [])

    def test_what_cannot_be_read_is_bad_input(self):
        for command in ("emulate", "compare"):
            for path, word in ((self.path / "none", "cannot open"), (self.path, "is a directory")):
                self.assertIn(word, run(command, path, status=2).stderr)
        (self.path / "d.json").write_text('{"nam": 1}')
        said = run("factorial", self.path / "d.json", "-o", self.path / "o.csv", status=2).stderr
        for line in said.splitlines():
            self.assertTrue(line.startswith("ischia study"), line)
            self.assertIn(str(self.path / "d.json"), line)
        (self.path / "d.json").write_text("{")
        said = run("factorial", self.path / "d.json", "-o", self.path / "o.csv", status=2).stderr
        self.assertIn(f"{self.path / 'd.json'}: not JSON", said)

    def test_results_come_through_a_pipe_too(self):
        done = subprocess.run(
            [PROGRAM, "study", "emulate", "-"],
            input="eps_max\n1\n2\n",
            capture_output=True,
            text=True,
            timeout=600,
        )
        self.assertIn("no input varies in standard input", done.stderr)


class Help(unittest.TestCase):
    def test_every_command_explains_itself(self):
        listed = run("--help").stdout
        for command in ("factorial", "merge", "emulate", "compare"):
            self.assertIn(command, listed)
            self.assertIn("Usage: ischia study " + command, run(command, "--help").stdout)
        run(status=2)
        self.assertEqual(
            run("fit", status=2).stderr,
            "ischia study: fit is not a command; see ischia study --help\n",
        )
        self.assertIn("did you mean merge?", run("mreg", status=2).stderr)


unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
