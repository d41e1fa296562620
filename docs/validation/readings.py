#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Solves one design under each reading of what the paper leaves open, fits both polynomials and
ranks the readings by their distance to the printed Tables 3 and 4. Resumable: run it again after a
stop.

  readings.py --program build/ischia --work DIR [--subset coarse|standard] [-j N]
              [--only NAME,...] [--keep] [--design DESIGN.json] [--resolution R]

Distance: sqrt(sum (ours - printed)^2 / sum printed^2) over the coefficients that the table prints:
0 is equal and 1 is as far as no effect at all. Signs: how many printed coefficients have our sign.
--keep puts each result file into docs/validation/data for docs/VALIDATION.md.
"""

import argparse
import dataclasses
import json
import pathlib
import subprocess
import sys

import keep

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PUBLISHED = HERE / "published/macron2020.json"

# One change from the default each, and the pairs that the single changes suggest.
READINGS = [
    ("default", "default: bulk 2000, L/h 2, centre line", {}),
    ("L_over_h_3", "L/h = 3", {"model": {"L_over_h": 3}}),
    ("L_over_h_4", "L/h = 4", {"model": {"L_over_h": 4}}),
    ("bulk_20", "bulk ratio 20", {"model": {"bulk_ratio": 20}}),
    ("bulk_30", "bulk ratio 30", {"model": {"bulk_ratio": 30}}),
    ("bulk_50", "bulk ratio 50", {"model": {"bulk_ratio": 50}}),
    ("bulk_100", "bulk ratio 100", {"model": {"bulk_ratio": 100}}),
    ("bulk_200", "bulk ratio 200", {"model": {"bulk_ratio": 200}}),
    ("R2_surface", "R2 at the surface", {"model": {"R2_surface": 1}}),
    (
        "R2_surface_bulk_30",
        "R2 at the surface, bulk ratio 30",
        {"model": {"R2_surface": 1, "bulk_ratio": 30}},
    ),
    ("skin_20", "skin 20 kPa", {"skin": {"mu": 20}}),
    ("skin_200", "skin 200 kPa", {"skin": {"mu": 200}}),
    ("embed_1_5", "bone embedded 1.5 R1", {"model": {"embed_over_R1": 1.5}}),
    ("friction_0", "friction 0", {"model": {"friction": 0}}),
    ("friction_2", "friction 2 (sticks)", {"model": {"friction": 2}}),
]


@dataclasses.dataclass(frozen=True)
class Subset:
    """Points of Table 1, the resolution they are solved at, and what is to be learnt there."""

    prefix: str  # of the kept files
    design: str  # in examples/
    resolution: str
    degrees: tuple  # of the polynomials that the design can tell apart
    names: tuple  # of the readings


# Many readings cheaply, and the one that matters most as the full factorial would have it.
SUBSETS = {
    "coarse": Subset(
        "reading", "design_table1_ninth.json", "coarse", (1, 2), tuple(r[0] for r in READINGS)
    ),
    "standard": Subset(
        "standard",
        "design_table1_27th.json",
        "standard",
        (1,),
        ("default", "bulk_200", "bulk_100", "bulk_30"),
    ),
}


def solve(a, name, options):
    design = json.loads(a.design.read_text())
    design["name"] = f"reading_{name}"
    design["case"] = {**design.get("case", {}), **options, "resolution": a.resolution}
    path, out = a.work / f"{name}.json", a.work / f"{name}.csv"
    path.write_text(json.dumps(design))
    command = [a.program, "study", "factorial", str(path), "-o", str(out)]
    if a.jobs:
        command += ["-j", str(a.jobs)]
    print(f"{name}:", file=sys.stderr)
    done = subprocess.run(command, check=False)
    if done.returncode not in (0, 1):
        sys.exit(f"readings.py: {name} could not be solved")
    return out


def fits(a, design, out):
    command = [
        a.program,
        "study",
        "emulate",
        str(out),
        "--design",
        str(design),
        "--published",
        str(PUBLISHED),
        "-o",
        "-",
    ]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def summary(document, degrees):
    row = {"rows": document["rows"], "used": document["rows_used"]}
    for fit in document["fits"]:
        if fit["degree"] not in degrees:
            continue
        beside = fit["against_published"]
        order = sorted(fit["parameters"], key=lambda p: -p["S_percent"])
        row[fit["degree"]] = {
            **beside,
            "r2": fit["r2"],
            "ms": fit["mean_squared_residuals"],
            "order": [p["key"] for p in order],
        }
    return row


def fit_words(fit):
    signs = f"{fit['same_sign']}/{fit['terms']}"
    return f"{fit['relative_distance']:7.2f} {signs:>6} {fit['r2']:6.3f} {fit['ms']:9.2g}  "


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("--program", required=True)
    parse.add_argument("--work", type=pathlib.Path, required=True)
    parse.add_argument("--subset", choices=SUBSETS, default="coarse")
    parse.add_argument("--design", type=pathlib.Path, help="instead of the subset's")
    parse.add_argument("--resolution", help="instead of the subset's")
    parse.add_argument("-j", "--jobs", type=int)
    parse.add_argument("--only", default="")
    parse.add_argument("--keep", action="store_true")
    parse.add_argument("--data", type=pathlib.Path, default=keep.DATA)
    a = parse.parse_args()
    subset = SUBSETS[a.subset]
    a.design = a.design or ROOT / "examples" / subset.design
    a.resolution = a.resolution or subset.resolution
    a.work.mkdir(parents=True, exist_ok=True)
    wanted = a.only.split(",") if a.only else subset.names
    chosen = [r for r in READINGS if r[0] in wanted]
    rows = []
    for name, words, options in chosen:
        out = solve(a, name, options)
        if a.keep:
            said = f"readings.py --design {a.design.name} --resolution {a.resolution}"
            keep.keep(f"{subset.prefix}_{name}", out, a.program, said, words, a.data)
        rows.append((words, summary(fits(a, a.design, out), subset.degrees)))
    rows.sort(
        key=lambda r: r[1][1]["relative_distance"] + r[1].get(2, r[1][1])["relative_distance"]
    )
    columns = ["dist", "signs", "R2", "mean sq"]
    print(f"{'':38} {'converged':>9} {'Table 3, degree 1':^31} {'Table 4, degree 2':^31}")
    print(f"{'reading':38} {'':9} " + 2 * "{:>7} {:>6} {:>6} {:>9} ".format(*columns) + " order")
    for words, row in rows:
        fitted = [row[d] for d in (1, 2) if d in row]
        print(
            f"{words:38} {row['used']:4}/{row['rows']:<4} "
            + "".join(fit_words(f) for f in fitted)
            + " > ".join(fitted[-1]["order"][:4])
        )


if __name__ == "__main__":
    main()
