#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trains the emulator behind POST /v1/estimates and the uncertainty of a result, from result files
of `ischia study factorial` (plain or compressed with gzip). docs/EMULATOR.md says what it computes.
Needs NumPy (Debian: python3-numpy).

  train.py ROWS.csv... -o emulator/emulator.txt --program build/release/server/cli/ischia
           [--manifest emulator/manifest.json] [--resolution standard] [--model default] [--trial]
           [--seed 1]

The same files and options give the same bytes on one machine.
"""

import argparse
import csv
import gzip
import hashlib
import io
import itertools
import json
import math
import pathlib
import subprocess
import sys

import kriging
import numpy as np

INPUTS = ("R1", "R2", "eM", "eF", "muM", "muF", "F")
# Products of powers of the inputs: what they have in common acts in common. The first is a load
# over the stiffness and the two radii of what it rests on.
GROUPS = (
    {"F": 1, "muM": -1, "R1": -1, "R2": -1},
    {"F": 1, "muM": -1, "eM": -2},
    {"R1": 1, "eM": -1},
    {"muF": 1, "muM": -1},
)
# name, power: 2 fits the square root, for volumes that are zero over a part of the box, and for one
# force, which is crossed anywhere from a few to hundreds of newtons (the other's band holds less with it)
OUTPUTS = (
    ("eps_max", 1),
    ("E_shear_max", 1),
    ("E_comp_max", 1),
    ("volume_shear_mm3", 2),
    ("volume_compression_mm3", 2),
    ("volume_both_mm3", 2),
    ("seat_displacement_mm", 1),
    ("force_shear_N", 1),
    ("force_compression_N", 2),
)
ROWS_MIN = 80  # fewer say nothing about an output
COVERAGE = 0.95
INNER_MIN = 100  # rows inside the box that the band's reach is set by; fewer: all rows
TRENDS = ((2, 2), (3, 2))  # total degree, inputs in a product; the best in the rows left out


def text_of(path):
    data = pathlib.Path(path).read_bytes()
    return gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data


def read_rows(paths):
    """Every row that succeeded, of all files."""
    rows = []
    for path in paths:
        text = io.StringIO(text_of(path).decode(), newline="")
        rows += [r for r in csv.DictReader(text) if r["status"] == "succeeded"]
    return rows


def values(rows):
    return np.array([[float(r[k]) for k in INPUTS] for r in rows])


def box_of(rows):
    x = values(rows)
    return {k: (x[:, i].min(), x[:, i].max()) for i, k in enumerate(INPUTS)}


def between(x, low, high):
    return (2 * x - low - high) / (high - low)


def scaled(rows, box):
    """Logarithms of the inputs, in [-1, 1] over the box, a column each."""
    x = np.log(values(rows))
    return np.column_stack(
        [between(x[:, i], *np.log(box[k])) for i, k in enumerate(INPUTS)]
    )


def powers(group):
    return np.array([float(group.get(k, 0)) for k in INPUTS])


def group_ranges(rows):
    x = np.log(values(rows))
    return [((x @ powers(g)).min(), (x @ powers(g)).max()) for g in GROUPS]


def coordinates(rows, box, ranges):
    """Scaled inputs, then scaled groups."""
    x = np.log(values(rows))
    groups = [between(x @ powers(g), *r) for g, r in zip(GROUPS, ranges)]
    return np.column_stack([scaled(rows, box), *groups])


def degrees_up_to(total, together=2):
    """All products of Legendre polynomials of at most that total degree, in at most so many inputs."""
    every = itertools.product(range(total + 1), repeat=len(INPUTS))
    kept = [d for d in every if sum(d) <= total and sum(1 for i in d if i) <= together]
    return sorted(kept, key=lambda d: (sum(d), d))


def basis(z, degrees):
    top = max(max(d) for d in degrees)
    legendre = np.ones((top + 1, *z.shape))
    if top > 0:
        legendre[1] = z
    for n in range(1, top):
        legendre[n + 1] = ((2 * n + 1) * z * legendre[n] - n * legendre[n - 1]) / (n + 1)
    columns = [
        np.prod([legendre[d, :, i] for i, d in enumerate(term) if d], axis=0) if any(term)
        else np.ones(len(z))
        for term in degrees
    ]
    return np.column_stack(columns)


def fit(A, y):
    return np.linalg.lstsq(A, y, rcond=None)[0]


def spread_of(z, errors, inner):
    """A sum for the logarithm of the error's size, and how many of it the band reaches."""
    degrees = degrees_up_to(2 if len(errors) >= 400 else 1)
    floor = 0.1 * math.sqrt(np.median(errors**2)) + 1e-12
    A = basis(z, degrees)
    theta = fit(A, np.log(np.abs(errors) + floor))
    size = np.exp(A @ theta)
    counted = inner if inner.sum() >= INNER_MIN else np.ones(len(errors), dtype=bool)
    ratio = np.sort((np.abs(errors) / size)[counted])
    return degrees, theta, float(ratio[min(len(ratio) - 1, math.ceil(COVERAGE * len(ratio)))])


def terms(degrees, theta):
    return [[*map(int, d), float(f"{t:.10g}")] for d, t in zip(degrees, theta)]


def raised(x, power):
    return np.maximum(x, 0) ** 2 if power == 2 else x


def rms(x):
    return float(f"{math.sqrt(np.mean(x**2)):.4g}")


def best_fit(z, y, seed, rounds):
    """Of the trends the one whose predictions of left-out rows are best."""
    best = None
    for total, together in TRENDS:
        degrees = degrees_up_to(total, together)
        if 2 * len(degrees) > len(y):
            continue
        fitted = kriging.Kriging(z, y, basis(z[:, : len(INPUTS)], degrees), seed, rounds)
        if best is None or np.mean(fitted.left_out**2) < np.mean(best[0].left_out**2):
            best = fitted, degrees
    return best


def train_output(name, power, rows, z, seed, rounds):
    """z [rows, coordinates]; None when too few rows have the output."""
    has = np.array([bool(r.get(name)) for r in rows])
    if has.sum() < ROWS_MIN:
        return None
    plain = z[has][:, : len(INPUTS)]
    value = np.array([float(r[name]) for r in rows if r.get(name)])
    y = np.sqrt(np.maximum(value, 0)) if power == 2 else value
    fitted, degrees = best_fit(z[has], y, seed, rounds)
    inner = np.abs(plain).max(1) < 1 - 1e-9
    spread_degrees, spread_theta, reach = spread_of(plain, fitted.left_out, inner)
    held_out = raised(y - fitted.left_out, power) - value
    print(
        f"{name:24} {len(y):6} rows {len(degrees):4} terms   left-out RMS {rms(held_out):.4g}",
        file=sys.stderr,
    )
    weights = np.zeros(len(rows))
    weights[has] = fitted.weights
    return {
        "name": name,
        "power": power,
        "rows": len(y),
        "held_out_rms": rms(held_out),
        "reach": float(f"{reach:.6g}"),
        "mean": terms(degrees, fitted.theta),
        "kernel": {
            "lengths": [float(f"{v:.6g}") for v in fitted.hyper.lengths],
            "weights": [float(f"{w:.10g}") for w in weights],
        },
        "spread": terms(spread_degrees, spread_theta),
    }


def model_of(program):
    """Name and version of the model as the program says them: "model NAME VERSION"."""
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    line = next(line for line in said.splitlines() if line.startswith("model "))
    name, version = line.split()[1], line.split()[-1]
    return said.splitlines()[0], {"name": name, "version": int(version)}


def distinct(rows):
    """One row for each place: two centres at one place cannot be told apart."""
    return list({tuple(r[k] for k in INPUTS): r for r in rows}.values())


def document_of(rows, a):
    box, ranges = box_of(rows), group_ranges(rows)
    z = coordinates(rows, box, ranges)
    version, model = model_of(a.program)
    trained = (train_output(n, p, rows, z, a.seed, a.rounds) for n, p in OUTPUTS)
    return {
        "program": version,
        "model": model,
        "rows": len(rows),
        "trial": a.trial,
        "seed": a.seed,
        "data": {p.name: hashlib.sha256(text_of(p)).hexdigest() for p in a.rows},
        "case": {"model": a.model, "resolution": a.resolution},
        "inputs": {k: {"min": box[k][0], "max": box[k][1], "log": True} for k in INPUTS},
        "groups": [
            {"powers": powers(g).tolist(), "low": low, "high": high}
            for g, (low, high) in zip(GROUPS, ranges)
        ],
        "centres": values(rows).tolist(),
        "outputs": [output for output in trained if output is not None],
    }


def write_manifest(path, document, digest):
    """What a reader of the repository wants to know of the emulator without opening it."""
    kept = ("program", "model", "rows", "trial", "seed", "case", "data", "inputs")
    manifest = {
        "sha256": digest,
        **{k: document[k] for k in kept},
        "left_out_rms": {o["name"]: o["held_out_rms"] for o in document["outputs"]},
        "numpy": np.__version__,
    }
    path.write_text(json.dumps(manifest, indent=2) + "\n")


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("rows", nargs="+", type=pathlib.Path)
    parse.add_argument("-o", "--output", required=True, type=pathlib.Path)
    parse.add_argument("--manifest", type=pathlib.Path)
    parse.add_argument("--program", required=True)
    parse.add_argument("--resolution", default="standard", help="of the solves")
    parse.add_argument("--model", default="default", help="of the solves")
    parse.add_argument("--seed", type=int, default=1)
    parse.add_argument("--rounds", type=int, default=kriging.ROUNDS, help="of the search for lengths")
    parse.add_argument("--trial", action="store_true", help="not to be relied on, and it says so")
    a = parse.parse_args()
    rows = distinct(read_rows(a.rows))
    if len(rows) < ROWS_MIN:
        sys.exit(f"train.py: {len(rows)} rows succeeded; at least {ROWS_MIN} are needed")
    document = document_of(rows, a)
    body = json.dumps(document, separators=(",", ":")) + "\n"
    digest = hashlib.sha256(body.encode()).hexdigest()
    a.output.write_text(f"ischia emulator 2 sha256 {digest}\n{body}")
    if a.manifest:
        write_manifest(a.manifest, document, digest)
    print(f"{a.output}: {len(rows)} rows, sha256 {digest[:12]}…", file=sys.stderr)


if __name__ == "__main__":
    main()
