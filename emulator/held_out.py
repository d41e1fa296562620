#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""How well a trained emulator predicts solves that had no part in its training: RMS, and how many
lie in the 95 % band, per output; beside it the degree-2 polynomial of the published study, fitted to
the rows that the emulator was trained with. Needs NumPy.

  held_out.py EMULATOR.txt FRESH.csv... --trained ROWS.csv...
"""

import argparse
import json
import math
import pathlib

import numpy as np
import train


def load(path):
    return json.loads(path.read_text().split("\n", 1)[1])


def box_of(document):
    return {k: (v["min"], v["max"]) for k, v in document["inputs"].items()}


def inside(rows, box):
    """The rows that the emulator gives an answer for."""
    return [r for r in rows if all(box[k][0] <= float(r[k]) <= box[k][1] for k in train.INPUTS)]


def total(z, terms):
    return train.basis(z, [t[:-1] for t in terms]) @ np.array([t[-1] for t in terms])


def raised(x, power):
    return np.maximum(x, 0) ** 2 if power == 2 else x


def predict(output, z):
    mean = total(z, output["mean"])
    half = output["reach"] * np.exp(total(z, output["spread"]))
    return [raised(x, output["power"]) for x in (mean, mean - half, mean + half)]


def polynomial(name, trained, fresh, box):
    """The paper's: degree 2, in inputs scaled without logarithms."""

    def plain(rows):
        columns = []
        for k in train.INPUTS:
            low, high = box[k]
            columns.append((2 * np.array([float(r[k]) for r in rows]) - low - high) / (high - low))
        return train.basis(np.column_stack(columns), train.degrees_up_to(2))

    rows = [r for r in trained if r.get(name)]
    theta = train.fit(plain(rows), np.array([float(r[name]) for r in rows]))
    return plain(fresh) @ theta


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("emulator", type=pathlib.Path)
    parse.add_argument("fresh", nargs="+", type=pathlib.Path)
    parse.add_argument("--trained", nargs="+", type=pathlib.Path, required=True)
    a = parse.parse_args()
    document = load(a.emulator)
    box = box_of(document)
    fresh, trained = inside(train.read_rows(a.fresh), box), train.read_rows(a.trained)
    print(f"{'output':24} {'points':>6} {'RMS':>10} {'in band':>8} {'degree 2 RMS':>13}")
    for output in document["outputs"]:
        rows = [r for r in fresh if r.get(output["name"])]
        if not rows:
            continue
        y = np.array([float(r[output["name"]]) for r in rows])
        value, low, high = predict(output, train.scaled(rows, box))
        rms = math.sqrt(np.mean((value - y) ** 2))
        held = np.mean((low <= y) & (y <= high))
        base = polynomial(output["name"], trained, rows, box)
        print(
            f"{output['name']:24} {len(y):6} {rms:10.4g} {100 * held:7.1f}%"
            f" {math.sqrt(np.mean((base - y) ** 2)):13.4g}"
        )


if __name__ == "__main__":
    main()
