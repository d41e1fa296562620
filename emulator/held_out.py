#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""How well a trained emulator predicts solves that had no part in its training: RMS, and how many
lie in the 95 % band, per output; beside it the degree-2 polynomial of the published study, fitted to
the rows that the emulator was trained with. Needs NumPy.

  held_out.py EMULATOR.txt FRESH.csv... --trained ROWS.csv... [--json OUT.json]
"""

import argparse
import hashlib
import json
import math
import pathlib

import kriging
import numpy as np
import train

TABLE1 = {
    "R1": (5, 9),
    "R2": (15, 63),
    "eM": (19, 39),
    "eF": (9, 35),
    "muM": (1, 8),
    "muF": (2.8, 8),
    "F": (192, 428),
}
FIRM_KPA = 2.5  # muscle that folds in hardly any solve


def load(path):
    return json.loads(path.read_text().split("\n", 1)[1])


def box_of(document):
    return {k: (v["min"], v["max"]) for k, v in document["inputs"].items()}


def inside(rows, box):
    """The rows that lie in a box."""
    return [r for r in rows if all(box[k][0] <= float(r[k]) <= box[k][1] for k in train.INPUTS)]


def total(z, terms):
    return train.basis(z, [t[:-1] for t in terms]) @ np.array([t[-1] for t in terms])


class Emulator:
    """As solver/study/predictor.c evaluates it."""

    def __init__(self, document):
        self.document = document
        self.box = box_of(document)
        self.ranges = [(g["low"], g["high"]) for g in document["groups"]]
        centres = [dict(zip(train.INPUTS, c)) for c in document["centres"]]
        self.centres = self.place(centres)

    def place(self, rows):
        return train.coordinates(rows, self.box, self.ranges)

    def predict(self, output, rows):
        """Value, low and high."""
        at = self.place(rows)
        z = at[:, : len(train.INPUTS)]
        kernel = output["kernel"]
        near = kriging.covariance(at, self.centres, np.array(kernel["lengths"]))
        mean = total(z, output["mean"]) + near @ np.array(kernel["weights"])
        half = output["reach"] * np.exp(total(z, output["spread"]))
        return [train.raised(x, output["power"]) for x in (mean, mean - half, mean + half)]


def polynomial(name, trained, fresh, box):
    """The paper's: degree 2, in inputs scaled without logarithms."""

    def plain(rows):
        x = train.values(rows)
        columns = [train.between(x[:, i], *box[k]) for i, k in enumerate(train.INPUTS)]
        return train.basis(np.column_stack(columns), train.degrees_up_to(2))

    rows = [r for r in trained if r.get(name)]
    theta = train.fit(plain(rows), np.array([float(r[name]) for r in rows]))
    return plain(fresh) @ theta


def rms(x):
    return math.sqrt(np.mean(x**2))


def test_output(emulator, output, trained, fresh):
    name = output["name"]
    rows = [r for r in fresh if r.get(name)]
    if not rows:
        return None
    y = np.array([float(r[name]) for r in rows])
    value, low, high = emulator.predict(output, rows)
    firm = np.array([float(r["muM"]) >= FIRM_KPA for r in rows])
    base = polynomial(name, inside(trained, TABLE1), rows, TABLE1) - y
    return {
        "output": name,
        "points": len(y),
        "rms": rms(value - y),
        "firm_points": int(firm.sum()),
        "firm_rms": rms((value - y)[firm]),
        "median": float(np.median(np.abs(value - y))),
        "largest": float(np.max(np.abs(value - y))),
        "in_band": float(np.mean((low <= y) & (y <= high))),
        "degree_2_rms": rms(base),
        "degree_2_median": float(np.median(np.abs(base))),
    }


def test(document, trained, fresh):
    """One dictionary an output; only fresh rows in the box of the published study's Table 1."""
    emulator = Emulator(document)
    fresh = inside(inside(fresh, emulator.box), TABLE1)
    results = (test_output(emulator, o, trained, fresh) for o in document["outputs"])
    return [r for r in results if r is not None]


def show(results):
    print(f"{'output':24} {'points':>6} {'RMS':>10} {'in band':>8} {'degree 2 RMS':>13}")
    for r in results:
        print(
            f"{r['output']:24} {r['points']:6} {r['rms']:10.4g} {100 * r['in_band']:7.1f}%"
            f" {r['degree_2_rms']:13.4g}"
        )


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("emulator", type=pathlib.Path)
    parse.add_argument("fresh", nargs="+", type=pathlib.Path)
    parse.add_argument("--trained", nargs="+", type=pathlib.Path, required=True)
    parse.add_argument("--json", type=pathlib.Path, help="write the figures here too")
    a = parse.parse_args()
    document = load(a.emulator)
    results = test(document, train.read_rows(a.trained), train.read_rows(a.fresh))
    show(results)
    if a.json:
        figures = {
            "emulator": a.emulator.read_text().split("\n", 1)[0].split()[-1],
            "fresh": {p.name: hashlib.sha256(train.text_of(p)).hexdigest() for p in a.fresh},
            "results": results,
        }
        a.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
