#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Uncertain measurements from end to end, on a stand-in for the solver that is a known polynomial and
an emulator that is the same one: intervals against a Monte Carlo of that polynomial made here, through
the command line and through the service. Usage: uncertainty_test.py PROGRAM SOURCE_ROOT
"""

import csv
import hashlib
import json
import os
import random
import subprocess
import sys
import tempfile
import unittest

PROGRAM, ROOT = os.path.abspath(sys.argv.pop(1)), sys.argv.pop(1)
sys.path.insert(0, os.path.join(ROOT, "tests/api"))
import service  # noqa: E402

KEYS = ("R1", "R2", "eM", "eF", "muM", "muF", "F")
MIDDLE = dict(zip(KEYS, (7, 39, 29, 22, 4.5, 5.4, 310)))
HALF = dict(zip(KEYS, (2, 24, 10, 13, 3.5, 2.6, 118)))
ACCEPTED = dict(
    zip(KEYS, ((3, 15), (8, 120), (5, 60), (3, 60), (0.5, 30), (0.5, 30), (1, 600)))
)
WIDTH = 2.5  # of the emulator's box, in halves of Table 1
# as in tests/double/polynomial_double.c
LINEAR = {"muM": -0.18, "R2": -0.16, "F": 0.12, "R1": -0.09, "eM": 0.02, "eF": 0.02, "muF": -0.02}
SQUARE = {"muM": -0.05, "R2": 0.1, "F": -0.04, "R1": 0.02}
MIXED = {("muM", "eM"): -0.115, ("muM", "F"): 0.108}
CASE = {"R1": 7, "R2": 39, "eM": 29, "eF": 22, "muM": 4.5, "muF": 5.4, "F": 310}
SD = {"R1": 0.5, "R2": 6, "muM": 0.6, "F": 30}


def eps_max(case):
    x = {k: (case[k] - MIDDLE[k]) / HALF[k] for k in KEYS}
    total = 1.3 + sum(c * x[k] for k, c in LINEAR.items())
    total += sum(c * x[k] ** 2 for k, c in SQUARE.items())
    return total + sum(c * x[i] * x[j] for (i, j), c in MIXED.items())


def term(value, **degrees):
    return [*(degrees.get(k, 0) for k in KEYS), value]


def eps_max_terms():
    """The same over a box WIDTH times as wide: x = WIDTH z, z^2 = (2 P2(z) + 1) / 3."""
    constant = 1.3 + sum(c * WIDTH**2 / 3 for c in SQUARE.values())
    terms = [term(constant)]
    terms += [term(c * WIDTH, **{k: 1}) for k, c in LINEAR.items()]
    terms += [term(c * WIDTH**2 * 2 / 3, **{k: 2}) for k, c in SQUARE.items()]
    return terms + [term(c * WIDTH**2, **{i: 1, j: 1}) for (i, j), c in MIXED.items()]


def write_emulator(path, **changes):
    box = {
        k: {"min": MIDDLE[k] - WIDTH * HALF[k], "max": MIDDLE[k] + WIDTH * HALF[k], "log": False}
        for k in KEYS
    }
    document = {
        "model": {"name": "macron2020-local", "version": 1},
        "rows": 100,
        "trial": True,
        "case": {"resolution": "standard"},
        "inputs": {**box, **changes},
        "outputs": [
            {
                "name": "eps_max",
                "power": 1,
                "reach": 1e-9,
                "held_out_rms": 0,
                "mean": eps_max_terms(),
                "spread": [term(0)],
            },
            {
                "name": "E_shear_max",
                "power": 1,
                "reach": 0.2,
                "held_out_rms": 0,
                "mean": [term(0.75)],
                "spread": [term(0)],
            },
        ],
    }
    body = json.dumps(document) + "\n"
    digest = hashlib.sha256(body.encode()).hexdigest()
    with open(path, "w", encoding="ascii") as file:
        file.write(f"ischia emulator 2 sha256 {digest}\n{body}")


def solve(path, case, *options):
    done = subprocess.run(
        [PROGRAM, "solve", "--emulator", path, *options, "-"],
        input=json.dumps(case),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise AssertionError(done.stderr)
    return json.loads(done.stdout)


def monte_carlo(case, sd, count):
    """eps_max of samples that keep the limits, drawn by rejection."""
    made, rng = [], random.Random(7)
    while len(made) < count:
        at = {k: rng.gauss(case[k], sd.get(k, 0)) for k in KEYS}
        if all(ACCEPTED[k][0] <= at[k] <= ACCEPTED[k][1] for k in KEYS) and at["R2"] >= at["R1"]:
            made.append(eps_max(at))
    return sorted(made)


class Intervals(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = os.path.join(cls.folder.name, "emulator.txt")
        write_emulator(cls.path)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def uncertainty(self, sd=SD, **changes):
        return solve(self.path, {**CASE, **changes, "sd": sd})["uncertainty"]

    def test_the_emulator_here_is_the_polynomial(self):
        for check in self.uncertainty()["checks"]:
            self.assertAlmostEqual(check["eps_max"], eps_max(check["parameters"]), places=12)
            self.assertAlmostEqual(check["estimate"], check["eps_max"], places=9)

    def test_quantiles_are_those_of_brute_force(self):
        for case, sd in ((CASE, SD), ({**CASE, "R2": 12, "R1": 9}, {"R1": 1, "R2": 5, "F": 60})):
            u = self.uncertainty(sd, **case)
            self.assertEqual(u["status"], "given")
            made = monte_carlo(case, sd, 40000)
            for p, ours in zip(u["quantiles"], u["strain"]["eps_max"]):
                self.assertAlmostEqual(ours / made[int(p * len(made))], 1, delta=0.008)

    def test_sobol_indices_of_a_polynomial(self):
        """Variances of a_i x + b_i x^2 with x normal, and of the product, in closed form."""
        u = self.uncertainty()
        s = {k: v / HALF[k] for k, v in SD.items()}
        first = {
            k: (LINEAR[k] * s[k]) ** 2 + 2 * (SQUARE.get(k, 0) * s[k] ** 2) ** 2 for k in SD
        }
        both = (MIXED["muM", "F"] * s["muM"] * s["F"]) ** 2
        all_ = sum(first.values()) + both
        for k in SD:
            part = first[k] / all_
            self.assertAlmostEqual(u["sensitivity"]["first_order"][k], part, delta=0.02)
            whole = part + (both / all_ if k in ("muM", "F") else 0)
            self.assertAlmostEqual(u["sensitivity"]["total"][k], whole, delta=0.02)
        self.assertEqual(u["sensitivity"]["total"]["eM"], 0)

    def assertColumns(self, columns, u):
        """A row of a CSV file says what the document says."""
        self.assertEqual(columns["uncertainty"], "given")
        for name, at in (("eps_max_q05", 0), ("eps_max_q50", 2), ("eps_max_q95", 4)):
            self.assertAlmostEqual(float(columns[name]), u["strain"]["eps_max"][at])
        self.assertEqual(float(columns["share_shear"]), u["share_crossing"]["shear"])
        for name in ("compression", "both"):  # the emulator has no compression
            self.assertEqual((columns["share_" + name], u["share_crossing"][name]), ("", None))
        total = u["sensitivity"]["total"]
        best = max(total, key=lambda k: total[k])
        self.assertEqual(columns["measure_better"], best)
        self.assertAlmostEqual(float(columns["measure_better_index"]), total[best])

    def cohort(self, text, *options):
        done = subprocess.run(
            [PROGRAM, "cohort", "--emulator", self.path, *options, "-"],
            input=text,
            capture_output=True,
            text=True,
            check=False,
        )
        return done, list(csv.DictReader(done.stdout.splitlines()))

    def test_rows_of_a_cohort_have_them(self):
        values = ",".join(str(CASE[k]) for k in KEYS)
        text = f"{','.join(KEYS)},sd,sd.R1,sd.R2,sd.muM,sd.F\n"
        text += f"{values},,0.5,6,0.6,30\n{values},typical,,,,\n{values},,,,,\n{values},,x,,,\n"
        done, rows = self.cohort(text, "-j", "2")
        self.assertEqual(done.returncode, 2)
        self.assertColumns(rows[0], self.uncertainty())
        self.assertColumns(rows[1], self.uncertainty("typical"))
        self.assertEqual([r["status"] for r in rows], [*3 * ["succeeded"], "refused"])
        for row in rows[2:]:
            self.assertEqual((row["uncertainty"], row["eps_max_q50"]), ("", ""))
        self.assertIn("sd.R1", rows[3]["reason"])

    def test_a_cohort_without_them_has_typical_ones_on_request(self):
        text = f"{','.join(KEYS)}\n{','.join(str(CASE[k]) for k in KEYS)}\n"
        self.assertColumns(self.cohort(text, "--sd", "typical")[1][0], self.uncertainty("typical"))
        self.assertNotIn("uncertainty", self.cohort(text)[1][0])
        own = "{},uncertainty\n{},mine\n".format(*text.splitlines())
        self.assertEqual(self.cohort(own)[1][0]["uncertainty"], "mine")
        refused = self.cohort(own, "--sd", "typical")[0]
        self.assertIn("column uncertainty is the name of a result column", refused.stderr)
        self.assertIn("accepted: typical", self.cohort(text, "--sd", "usual")[0].stderr)
        other = self.cohort(text, "--sd", "typical", "--model", "as-published")[1][0]
        self.assertEqual((other["uncertainty"], other["eps_max_q05"]), ("other_model", ""))

    def test_sd_of_zero_gives_the_point(self):
        result = solve(self.path, {**CASE, "sd": {"R1": 0}})
        point = result["strain"]["eps_max"]
        self.assertEqual(result["uncertainty"]["strain"]["eps_max"], [point] * 5)
        self.assertEqual(result["uncertainty"]["checks"], [])

    def test_the_same_request_gives_the_same_interval(self):
        self.assertEqual(self.uncertainty(), self.uncertainty())

    def test_typical_is_what_it_stands_for(self):
        explicit = {"R1": 0.84, "R2": 10.6, "eM": 2, "eF": 3, "muM": 0.9, "muF": 1.08, "F": 31}
        typical, own = self.uncertainty("typical"), self.uncertainty(explicit)
        self.assertTrue(typical.pop("typical"))
        self.assertFalse(own.pop("typical"))
        for k, v in typical.pop("sd").items():
            self.assertAlmostEqual(v, own["sd"][k])
        self.assertAlmostEqual(typical["strain"]["eps_max"][4], own["strain"]["eps_max"][4])

    def test_without_sd_there_is_none(self):
        self.assertNotIn("uncertainty", solve(self.path, CASE))

    def test_what_leaves_the_training_box_is_said(self):
        path = os.path.join(self.folder.name, "narrow.txt")
        write_emulator(path, F={"min": 250, "max": 350, "log": False})
        u = solve(path, {**CASE, "sd": {"F": 30}})["uncertainty"]
        self.assertEqual(u["status"], "given")
        self.assertAlmostEqual(u["inside"] / u["samples"], 0.8860, delta=0.005)
        self.assertAlmostEqual(u["outside"]["F"], 0.1140, delta=0.005)
        u = solve(path, {**CASE, "sd": {"F": 90}})["uncertainty"]
        self.assertEqual(u["status"], "outside_training")
        self.assertEqual(u["strain"]["eps_max"], [None] * 5)
        self.assertIsNone(u["share_crossing"]["shear"])
        self.assertEqual(u["checks"], [])

    def test_other_options_give_none(self):
        u = self.uncertainty(model="as-published")
        self.assertEqual(u["status"], "other_model")

    def test_the_summary_says_it(self):
        done = subprocess.run(
            [PROGRAM, "solve", "--summary", "--emulator", self.path, "-"],
            input=json.dumps({**CASE, "sd": SD}),
            capture_output=True,
            text=True,
            check=True,
        )
        self.assertRegex(done.stdout, r"spread of eps_max from (R2|F|muM) \d+ %, ")
        self.assertIn("error of the model's form, 0.075", done.stdout)

    def test_a_damaged_emulator_is_refused(self):
        path = os.path.join(self.folder.name, "bad.txt")
        with open(self.path, encoding="ascii") as good, open(path, "w", encoding="ascii") as bad:
            bad.write(good.read().replace("100", "101"))
        with self.assertRaisesRegex(AssertionError, "does not match its checksum"):
            solve(path, {**CASE, "sd": SD})
        self.assertIn("strain", solve(path, CASE))  # exact inputs need none


class ThroughTheService(Intervals):
    """The worker says the same."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.service = service.Service("--emulator", cls.path, worker=PROGRAM)
        cls.service.until_ready()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()
        super().tearDownClass()

    def ask(self, case):
        wait = {**service.JSON, "Prefer": "wait=60"}
        answer = self.service.ask("POST", "/v1/assessments", json.dumps(case).encode(), wait)
        self.assertEqual(answer.status, 201, answer.body)
        return answer.json()

    def test_documents_have_it(self):
        document = self.ask({**CASE, "sd": SD, "side": "left"})
        self.assertEqual(document["sd"], {k: SD.get(k, 0) for k in KEYS})
        self.assertEqual(document["result"]["uncertainty"], self.uncertainty())
        self.assertEqual(self.ask({**CASE, "sd": "typical"})["sd"], "typical")
        self.assertIsNone(self.ask(CASE)["sd"])

    def test_a_form_says_it_too(self):
        form = "&".join(f"{k}={v}" for k, v in CASE.items()) + "&sd.R2=6&sd.F=30&sd.R1=&side=left"
        headers = {"Content-Type": "application/x-www-form-urlencoded"}
        answer = self.service.ask("POST", "/v1/assessments", form.encode(), headers)
        self.assertEqual(answer.status, 303, answer.body)
        one = answer.headers["Location"].split("/report")[0]
        answer = self.service.ask("GET", one, headers={"Prefer": "wait=60"})
        sd = answer.json()["result"]["uncertainty"]["sd"]
        self.assertEqual({k for k, v in sd.items() if v}, {"R2", "F"})

    def test_the_report_has_it_in_each_language(self):
        document = self.ask({**CASE, "sd": SD})
        for language, words in (
            ("en", "What to measure better: "),
            ("fr", "Que mesurer mieux : "),
            ("de", "Was genauer zu messen ist: "),
        ):
            page = self.service.get(f"{document['links']['report']}?lang={language}").body.decode()
            self.assertIn(words, page)
            self.assertIn("muM ", page.split(words)[1][:60])
        outside = self.ask({**CASE, "sd": SD, "model": "as-published"})
        page = self.service.get(outside["links"]["report"]).body.decode()
        self.assertIn("No interval: ", page)
        outside = self.ask({**CASE, "F": 10, "sd": "typical"})
        interval = outside["result"]["uncertainty"]
        self.assertEqual((interval["samples"], interval["outside"]["F"]), (0, 1))
        page = self.service.get(outside["links"]["report"]).body.decode()
        self.assertIn("No interval: what was measured lies outside", page)
        self.assertIn("trained for (F).", page)

    def test_record_systems_get_it(self):
        units = {"muM": "kPa", "muF": "kPa", "F": "N"}

        def given(name, key, value):
            unit = units.get(key, "mm")
            quantity = {"value": value, "system": "http://unitsofmeasure.org", "code": unit}
            return {"name": name, "valueQuantity": quantity}

        listed = [given(k, k, v) for k, v in CASE.items()]
        listed += [given("sd." + k, k, v) for k, v in SD.items()]
        body = json.dumps({"resourceType": "Parameters", "parameter": listed})
        answer = self.service.ask(
            "POST", "/fhir/$assess", body.encode(), {"Content-Type": "application/fhir+json"}
        )
        found = {}
        for entry in answer.json()["entry"]:
            if entry["resource"]["resourceType"] == "Observation":
                code = entry["resource"]["code"]["coding"][0]["code"]
                found[code] = entry["resource"]["valueQuantity"]["value"]
        quantiles = self.uncertainty()["strain"]["eps_max"]
        self.assertAlmostEqual(found["eps_max_q05"], quantiles[0])
        self.assertAlmostEqual(found["eps_max_q95"], quantiles[4])
        again = self.service.get("/v1/assessments?limit=1").json()["items"][0]["id"]
        path = f"/fhir/Observation/{again}-eps-max-q05"
        self.assertAlmostEqual(
            self.service.get(path).json()["valueQuantity"]["value"], quantiles[0]
        )

    def test_lists_as_csv_have_it(self):
        self.ask({**CASE, "sd": SD, "subject": "P-csv"})
        answer = self.service.ask(
            "GET", "/v1/assessments?subject=P-csv", headers={"Accept": "text/csv"}
        )
        head, row = (line.split(",") for line in answer.body.decode().split()[:2])
        columns = dict(zip(head, row))
        u = self.uncertainty()
        self.assertColumns(columns, u)


if __name__ == "__main__":
    unittest.main()
