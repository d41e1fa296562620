#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Quantiles of a person whose measurements are uncertain, by brute force: a full solve for each of
some thousand samples; beside them what `ischia solve` says by the emulator. Resumable: solves are
kept in blocks, and a block that is there is not made again. Needs NumPy.

  monte_carlo.py --program ischia --emulator emulator.txt --work DIR [-j N] [--json OUT.json]
                 [--persons 2,right 11,left] [--samples 1040] [--resolution standard] [--seed 1]

The samples are drawn here anew (normal, rejected outside the limits), not by the program's own code.
A thousand of them leave a few per cent of chance in a quantile. Most of it is taken out by a control
variate: how far the emulator's quantile at the same samples is from its quantile at very many is
taken off that of the solves. That needs no trust in the emulator, only that it varies alike.
"""

import argparse
import csv
import json
import os
import pathlib
import subprocess
import sys

import held_out
import numpy as np
import train

ROOT = pathlib.Path(__file__).resolve().parent.parent
BLOCK = 20
CONTROL_SAMPLES, CONTROL_CHUNK = 65536, 8192
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
# name in a result file, place in `uncertainty`
QUANTITIES = (
    ("eps_max", ("strain", "eps_max")),
    ("volume_shear_mm3", ("clusters", "shear", "volume_mm3")),
    ("volume_compression_mm3", ("clusters", "compression", "volume_mm3")),
    ("volume_both_mm3", ("clusters", "both", "volume_mm3")),
    ("force_shear_N", ("threshold_force_N", "shear")),
    ("force_compression_N", ("threshold_force_N", "compression")),
)
UNITS = {"R1": "mm", "R2": "mm", "eM": "mm", "eF": "mm", "muM": "kPa", "muF": "kPa", "F": "N"}
ACCEPTED = {
    "R1": (3, 15),
    "R2": (8, 120),
    "eM": (5, 60),
    "eF": (3, 60),
    "muM": (0.5, 30),
    "muF": (0.5, 30),
    "F": (1, 600),
}


def person(name):
    """ "2,right": the seven numbers of that side of Table 2."""
    number, side = name.split(",")
    with open(ROOT / "examples/table2.csv", newline="", encoding="utf-8") as text:
        for row in csv.DictReader(text):
            if row["subject"] == f"table2-{number}" and row["side"] == side:
                return {k: float(row[f"{k}_{u}"]) for k, u in UNITS.items()}
    sys.exit(f"monte_carlo.py: no side {name} in examples/table2.csv")


def solve(a, case):
    """The result of one side with uncertain measurements, by the program under test."""
    command = [a.program, "solve", "--emulator", str(a.emulator), "-"]
    text = json.dumps({**case, "sd": "typical", "resolution": a.resolution})
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"monte_carlo.py: {done.stderr}")
    return json.loads(done.stdout)


def draw(case, sd, count, seed):
    """Accepted samples [count, 7]: normal, and drawn again where a limit or R2 >= R1 fails."""
    rng = np.random.default_rng(seed)
    kept = []
    mean = np.array([case[k] for k in train.INPUTS])
    spread = np.array([sd[k] for k in train.INPUTS])
    low, high = np.array([ACCEPTED[k] for k in train.INPUTS]).T
    while len(kept) < count:
        x = rng.normal(mean, spread)
        if np.all((x >= low) & (x <= high)) and x[1] >= x[0]:
            kept.append(x)
    return np.array(kept)


def run_block(a, path, samples):
    """Solves one block of samples into path, which appears when it is whole."""
    rows, part = path.with_suffix(".in.csv"), path.with_suffix(".part.csv")
    lines = [",".join(train.INPUTS)]
    lines += [",".join(repr(float(v)) for v in row) for row in samples]
    rows.write_text("\n".join(lines) + "\n")
    command = [a.program, "cohort", str(rows), "-o", str(part), "-j", str(a.jobs)]
    done = subprocess.run([*command, "--resolution", a.resolution], capture_output=True, check=False)
    if done.returncode not in (0, 1):  # 1: a row did not converge, which is a result
        sys.exit(f"monte_carlo.py: {done.stderr.decode()}")
    os.replace(part, path)


def brute_force(a, name, case, sd):
    """Rows of full solves, from the blocks that are there and those still to be made."""
    samples = draw(case, sd, a.samples, a.seed)
    found = []
    for start in range(0, a.samples, BLOCK):
        path = a.work / f"{name.replace(',', '-')}-{a.resolution}-{a.seed}-{start:05}.csv"
        if not path.exists():
            run_block(a, path, samples[start : start + BLOCK])
        with open(path, newline="", encoding="utf-8") as text:
            found += list(csv.DictReader(text))
        print(f"{name}: {len(found)} of {a.samples}", end="\r", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return found


def is_inside(document, row):
    return all(v["min"] <= float(row[k]) <= v["max"] for k, v in document["inputs"].items())


def within(u, place):
    for key in place:
        u = u[key]
    return u


def standard_errors(values, twins, seed):
    """Of the quantiles of values, less those of their twins, by the bootstrap."""
    rng = np.random.default_rng(seed)
    again = []
    for _ in range(400):
        pick = rng.integers(0, len(values), len(values))
        again.append(np.quantile(values[pick], QUANTILES) - np.quantile(twins[pick], QUANTILES))
    return np.std(again, axis=0)


class Control:
    """The emulator alone, without the solve that the program ties it to, at very many samples."""

    def __init__(self, document, case, sd, seed):
        self.emulator = held_out.Emulator(document)
        self.outputs = {o["name"]: o for o in document["outputs"]}
        samples = draw(case, sd, CONTROL_SAMPLES, seed + 1)
        rows = [dict(zip(train.INPUTS, x)) for x in samples]
        self.many = [r for r in rows if is_inside(document, r)]

    def values(self, column, rows):
        chunks = [rows[i : i + CONTROL_CHUNK] for i in range(0, len(rows), CONTROL_CHUNK)]
        output = self.outputs[column]
        return np.concatenate([self.emulator.predict(output, c)[0] for c in chunks])

    def quantiles(self, column):
        return np.quantile(self.values(column, self.many), QUANTILES)


def compare(a, name):
    """Quantiles both ways, and how far apart they are."""
    case = person(name)
    u = solve(a, case)["uncertainty"]
    if u["status"] != "given":
        sys.exit(f"monte_carlo.py: {name}: no interval: {u['status']}")
    rows = brute_force(a, name, case, u["sd"])
    document = json.loads(a.emulator.read_text().split("\n", 1)[1])
    solved = [r for r in rows if r["status"] == "succeeded"]
    counted = [r for r in solved if is_inside(document, r)]
    control = Control(document, case, u["sd"], a.seed)
    quantities = {}
    for column, place in QUANTITIES:
        reached, said = [r for r in counted if r[column]], within(u, place)
        if not reached or None in said or column not in control.outputs:
            continue  # a threshold that samples do not reach
        values, ours = np.array([float(r[column]) for r in reached]), np.array(said)
        twins = control.values(column, reached)
        plain = np.quantile(values, QUANTILES)
        full = plain + control.quantiles(column) - np.quantile(twins, QUANTILES)
        quantities[column] = {
            "full": full.tolist(),
            "full_without_control": plain.tolist(),
            "emulator": ours.tolist(),
            "difference": ((ours - full) / full).tolist(),
            "difference_without_control": ((ours - plain) / plain).tolist(),
            "standard_error": (standard_errors(values, twins, a.seed) / full).tolist(),
        }
    return {
        "person": name,
        "parameters": case,
        "sd": u["sd"],
        "samples": len(rows),
        "solved": len(solved),
        "inside": len(counted),
        "quantiles": QUANTILES,
        "quantities": quantities,
    }


def show(result):
    print(f"{result['person']}: {result['inside']} of {result['samples']} samples")
    for column, q in result["quantities"].items():
        text = " ".join(f"{100 * d:+6.2f}" for d in q["difference"])
        print(f"  {column:24} emulator less full solves at 5 25 50 75 95 %, in %: {text}")


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("--program", required=True)
    parse.add_argument("--emulator", type=pathlib.Path, required=True)
    parse.add_argument("--work", type=pathlib.Path, required=True)
    parse.add_argument("--persons", nargs="+", default=["2,right", "11,left"])
    parse.add_argument("--samples", type=int, default=1040)
    parse.add_argument("--resolution", default="standard")
    parse.add_argument("--seed", type=int, default=1)
    parse.add_argument("-j", "--jobs", type=int, default=1)
    parse.add_argument("--json", type=pathlib.Path, help="write the figures here too")
    a = parse.parse_args()
    a.program = str(pathlib.Path(a.program).resolve())
    a.work.mkdir(parents=True, exist_ok=True)
    results = [compare(a, name) for name in a.persons]
    for result in results:
        show(result)
    if a.json:
        digest = a.emulator.read_text().split("\n", 1)[0].split()[-1]
        a.json.write_text(json.dumps({"emulator": digest, "results": results}, indent=2) + "\n")


if __name__ == "__main__":
    main()
