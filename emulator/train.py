#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trains the emulator that POST /v1/estimates answers with, from result files of `ischia study
factorial`. docs/EMULATOR.md says what it computes. Needs NumPy (Debian: python3-numpy).

  train.py ROWS.csv... -o emulator.txt --program build/release/server/cli/ischia
           [--degree 5] [--resolution standard] [--model default] [--trial] [--seed 1]

The same files and options give the same bytes on one machine.
"""

import argparse
import csv
import hashlib
import itertools
import json
import math
import pathlib
import subprocess
import sys

import numpy as np

INPUTS = ("R1", "R2", "eM", "eF", "muM", "muF", "F")
LOG = ("R2", "muM", "muF", "F")  # act by their ratio rather than by their difference
# name, power: 2 fits the square root, for volumes that are zero over a part of the box
OUTPUTS = (
    ("eps_max", 1),
    ("E_shear_max", 1),
    ("E_comp_max", 1),
    ("volume_shear_mm3", 2),
    ("volume_compression_mm3", 2),
    ("volume_both_mm3", 2),
    ("seat_displacement_mm", 1),
    ("force_shear_N", 1),
    ("force_compression_N", 1),
)
ROWS_MIN = 40  # fewer say nothing about an output
COVERAGE = 0.95
FOLDS = 10
CANDIDATES = ((2, 2), (3, 2), (3, 3), (4, 2), (4, 3), (5, 2))  # total degree, inputs in a product


def read_rows(paths):
    """Every row that succeeded, of all files."""
    rows = []
    for path in paths:
        with open(path, newline="", encoding="utf-8") as text:
            rows += [r for r in csv.DictReader(text) if r["status"] == "succeeded"]
    return rows


def box_of(rows):
    return {k: (min(float(r[k]) for r in rows), max(float(r[k]) for r in rows)) for k in INPUTS}


def scaled(rows, box):
    """Inputs in [-1, 1], a column each."""
    columns = []
    for key in INPUTS:
        x = np.array([float(r[key]) for r in rows])
        low, high = box[key]
        if key in LOG:
            x, low, high = np.log(x), math.log(low), math.log(high)
        columns.append((2 * x - low - high) / (high - low))
    return np.column_stack(columns)


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


def choose(A, y, most):
    """Orthogonal matching pursuit: the column that explains most of what is left, one after the
    other; as many as make the leave-one-out error least. The first column is the constant."""
    n = len(y)
    left = A - 0.0
    residual, leverage = y.astype(float), np.zeros(n)
    chosen, best, best_count = [], math.inf, 1
    free = np.ones(A.shape[1], dtype=bool)
    for step in range(min(most, n // 2)):
        norms = np.einsum("ij,ij->j", left, left)
        usable = free & (norms > 1e-9 * n)
        if not usable.any():
            break
        gain = np.where(usable, (left.T @ residual) ** 2 / np.where(usable, norms, 1), -1)
        j = 0 if step == 0 else int(np.argmax(gain))
        q = left[:, j] / math.sqrt(norms[j])
        chosen.append(j)
        free[j] = False
        residual = residual - q * (q @ residual)
        leverage = leverage + q * q
        left = left - np.outer(q, q @ left)
        loose = np.maximum(1 - leverage, 1e-6)
        count = len(chosen)
        # the factor is Chapelle's (2002) against choosing too many columns
        penalty = (1 + count / n) / (1 - count / n)
        error = np.mean((residual / loose) ** 2) * penalty
        if error < best:
            best, best_count = error, count
        if count > best_count + 25:
            break
    return chosen[:best_count]


def fit(A, y):
    theta, *_ = np.linalg.lstsq(A, y, rcond=None)
    return theta


def left_out(A, y, seed):
    """Errors of predictions of rows that had no part in them: neither in the fit nor in the choice
    of its columns."""
    order = np.random.default_rng(seed).permutation(len(y))
    errors = np.empty(len(y))
    for fold in range(FOLDS):
        out = order[fold::FOLDS]
        rest = np.setdiff1d(order, out)
        chosen = choose(A[rest], y[rest], most=A.shape[1])
        errors[out] = y[out] - A[np.ix_(out, chosen)] @ fit(A[np.ix_(rest, chosen)], y[rest])
    return errors


def spread_of(z, errors):
    """A sum for the logarithm of the error's size, and how many of it the band reaches."""
    degrees = degrees_up_to(2 if len(errors) >= 400 else 1)
    floor = 0.05 * math.sqrt(np.mean(errors**2)) + 1e-12
    A = basis(z, degrees)
    theta = fit(A, np.log(np.abs(errors) + floor))
    size = np.exp(A @ theta)
    ratio = np.sort(np.abs(errors) / size)
    return degrees, theta, float(ratio[min(len(ratio) - 1, math.ceil(COVERAGE * len(ratio)))])


def terms(degrees, theta):
    return [[*map(int, d), float(f"{t:.10g}")] for d, t in zip(degrees, theta)]


def least_error(z, y, degree, seed):
    """Of the bases up to that degree the one whose predictions of left-out rows are best."""
    best = None
    for total, together in CANDIDATES:
        if total > degree:
            continue
        degrees = degrees_up_to(total, together)
        A = basis(z, degrees)
        errors = left_out(A, y, seed)
        if best is None or np.mean(errors**2) < np.mean(best[0] ** 2):
            best = errors, degrees, A
    return best


def train_output(name, power, rows, box, degree, seed):
    rows = [r for r in rows if r.get(name)]
    if len(rows) < ROWS_MIN:
        return None
    z = scaled(rows, box)
    values = np.array([float(r[name]) for r in rows])
    y = np.sqrt(np.maximum(values, 0)) if power == 2 else values
    errors, degrees, A = least_error(z, y, degree, seed)
    chosen = choose(A, y, most=len(degrees))
    theta = fit(A[:, chosen], y)
    guess = y - errors
    held_out = (np.maximum(guess, 0) ** 2 if power == 2 else guess) - values
    spread_degrees, spread_theta, reach = spread_of(z, errors)
    rms = float(f"{math.sqrt(np.mean(held_out ** 2)):.4g}")
    print(f"{name:24} {len(rows):6} rows {len(chosen):5} terms   held-out RMS {rms:.4g}", file=sys.stderr)
    return {
        "name": name,
        "power": power,
        "rows": len(rows),
        "held_out_rms": rms,
        "reach": float(f"{reach:.6g}"),
        "mean": terms([degrees[j] for j in chosen], theta),
        "spread": terms(spread_degrees, spread_theta),
    }


def model_of(program):
    """Name and version of the model as the program says them: "model NAME VERSION"."""
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    line = next(line for line in said.splitlines() if line.startswith("model "))
    name, version = line.split()[1], line.split()[-1]
    return said.splitlines()[0], {"name": name, "version": int(version)}


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("rows", nargs="+", type=pathlib.Path)
    parse.add_argument("-o", "--output", required=True, type=pathlib.Path)
    parse.add_argument("--program", required=True)
    parse.add_argument("--degree", type=int, default=5, help="the highest to try, 2 to 5")
    parse.add_argument("--resolution", default="standard", help="of the solves")
    parse.add_argument("--model", default="default", help="of the solves")
    parse.add_argument("--seed", type=int, default=1)
    parse.add_argument("--trial", action="store_true", help="not to be relied on, and it says so")
    a = parse.parse_args()
    rows = read_rows(a.rows)
    if len(rows) < ROWS_MIN:
        sys.exit(f"train.py: {len(rows)} rows succeeded; at least {ROWS_MIN} are needed")
    box = box_of(rows)
    version, model = model_of(a.program)
    trained = (train_output(n, p, rows, box, a.degree, a.seed) for n, p in OUTPUTS)
    document = {
        "program": version,
        "model": model,
        "rows": len(rows),
        "trial": a.trial,
        "seed": a.seed,
        "degree": a.degree,
        "data": {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in a.rows},
        "case": {"model": a.model, "resolution": a.resolution},
        "inputs": {
            k: {"min": box[k][0], "max": box[k][1], "log": k in LOG} for k in INPUTS
        },
        "outputs": [output for output in trained if output is not None],
    }
    body = json.dumps(document, separators=(",", ":")) + "\n"
    digest = hashlib.sha256(body.encode()).hexdigest()
    a.output.write_text(f"ischia emulator 1 sha256 {digest}\n{body}")
    print(f"{a.output}: {len(rows)} rows, sha256 {digest[:12]}…", file=sys.stderr)


if __name__ == "__main__":
    main()
