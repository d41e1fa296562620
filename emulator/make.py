#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the emulator that ships, and shows what it is worth, from the result files that are kept in
docs/validation/data (docs/validation/run.py makes those). Needs NumPy.

  make.py --program build/release/server/cli/ischia --work DIR [-j N] [--only train,held_out,...]

Steps: train (emulator.txt, manifest.json), held_out (check/held_out.json), monte_carlo, which solves
some thousand sides and goes on where it was stopped (check/monte_carlo.json), and page
(docs/EMULATOR_CHECK.md, from the two).
"""

import argparse
import json
import pathlib
import subprocess
import sys

import held_out as held

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent
DATA = ROOT / "docs/validation/data"
TRAINED = ("table1_default", "training_default", "training_wide_default")
FRESH = ("sobol_default",)
MARKS = {"rms": 0.02, "band": (0.93, 0.97), "quantile": 0.03}


def files(names, data):
    found = [data / f"{n}.csv.gz" for n in names if (data / f"{n}.csv.gz").exists()]
    missing = [n for n in names if data / f"{n}.csv.gz" not in found]
    if missing:
        sys.exit(
            f"make.py: {', '.join(missing)} not kept in {data}: "
            f"docs/validation/run.py --only {','.join(missing)} makes them"
        )
    return [str(p) for p in found]


def run(*words):
    subprocess.run([sys.executable, *map(str, words)], check=True)


def train(a):
    out = ("-o", a.out / "emulator.txt", "--manifest", a.out / "manifest.json")
    run(HERE / "train.py", *files(TRAINED, a.data), *out, "--program", a.program)


def held_out(a):
    (a.out / "check").mkdir(exist_ok=True)
    fresh, trained = files(FRESH, a.data), files(TRAINED, a.data)
    words = ("--trained", *trained, "--json", a.out / "check/held_out.json")
    run(HERE / "held_out.py", a.out / "emulator.txt", *fresh, *words)


def monte_carlo(a):
    (a.out / "check").mkdir(exist_ok=True)
    words = ("--emulator", a.out / "emulator.txt", "--work", a.work, "-j", a.jobs)
    run(
        HERE / "monte_carlo.py",
        *("--program", a.program, *words),
        *("--json", a.out / "check/monte_carlo.json"),
    )


# ---- the page ----


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(r) + " |" for r in rows])


def held_out_text(figures):
    rows = [
        (
            r["output"],
            str(r["points"]),
            f"{r['rms']:.4g}",
            f"{r['firm_rms']:.4g}",
            f"{r['median']:.3g}",
            f"{100 * r['in_band']:.1f} %",
            f"{r['degree_2_rms']:.4g}",
            f"{r['degree_2_median']:.3g}",
        )
        for r in figures["results"]
    ]
    head = ("output", "points", "RMS", "RMS, firm", "median error", "in the 95 % band")
    head += ("degree 2: RMS", "median")
    eps = next(r for r in figures["results"] if r["output"] == "eps_max")
    low, high = MARKS["band"]
    kept = eps["rms"] <= MARKS["rms"] and low <= eps["in_band"] <= high
    verdict = (
        f"The mark for eps_max (RMS at most {MARKS['rms']}, {100 * low:.0f} to {100 * high:.0f} % in "
        f"the band) is {'reached' if kept else '**not reached**'}: RMS {eps['rms']:.4f}, "
        f"{100 * eps['in_band']:.1f} %, largest error {eps['largest']:.3f}."
    )
    firm = (
        f"*Firm*: the {eps['firm_points']} points with μM of {held.FIRM_KPA} kPa or more. Softer muscle folds one "
        "way or another under the larger forces, and eps_max of two neighbours there may differ by 0.4: "
        "the band is as wide there."
    )
    return table(head, rows) + "\n\n" + verdict + "\n\n" + firm


def person_text(result):
    head = ("quantity", *(f"{100 * q:.0f} %" for q in result["quantiles"]), "standard error")
    rows = [
        (
            name,
            *(f"{e:.4g} ({100 * d:+.1f} %)" for e, d in zip(q["emulator"], q["difference"])),
            f"{100 * min(q['standard_error']):.1f} to {100 * max(q['standard_error']):.1f} %",
        )
        for name, q in result["quantities"].items()
    ]
    failed = result["samples"] - result["solved"]
    largest = max(abs(d) for q in result["quantities"].values() for d in q["difference"])
    plain = max(
        abs(d) for q in result["quantities"].values() for d in q["difference_without_control"]
    )
    verdict = (
        f"{result['samples']} samples, {failed} without a result, {result['inside']} in the training "
        f"box. Largest difference {100 * largest:.1f} %: within {100 * MARKS['quantile']:.0f} % "
        f"{'reached' if largest <= MARKS['quantile'] else '**not reached**'}. Without the control "
        f"variate, with all the chance of {result['inside']} samples in it: {100 * plain:.1f} %."
    )
    return f"### Table 2, {result['person']}\n\n{table(head, rows)}\n\n{verdict}\n"


def whose(out):
    """The emulator that the figures are of."""
    path = out / "manifest.json"
    if not path.exists():
        return "No emulator is trained yet."
    m = json.loads(path.read_text())
    return (
        f"Emulator `{m['sha256'][:12]}`, {m['program']}, {m['rows']} solves at "
        f"{m['case']['resolution']} resolution, seed {m['seed']}."
    )


def page(a):
    parts = [
        "# The emulator against full solves",
        "Written by `emulator/make.py`; the figures are in its folder `check`. What is computed: "
        "[EMULATOR.md](EMULATOR.md), [UNCERTAINTY.md](UNCERTAINTY.md).",
        whose(a.out),
        "## Fresh points in the box of Table 1",
        "None of these had a part in the training. *Degree 2* is the published study's polynomial, "
        "fitted to the same solves in that box.",
    ]
    path = a.out / "check/held_out.json"
    parts.append(held_out_text(json.loads(path.read_text())) if path.exists() else "Not made yet.")
    parts += [
        "## Quantiles by brute force",
        "Full solves at independent samples of the measurements with their typical standard "
        "deviations. Each cell: the emulator's quantile, and how far it is from that of the solves; "
        "the last column is the bootstrap's standard error of the latter. Most of the chance in the "
        "quantile of the solves is taken out by a control variate (`emulator/monte_carlo.py`): the "
        "emulator's own quantile at the same samples is taken off, and that at some sixty thousand "
        "put in its place.",
    ]
    path = a.out / "check/monte_carlo.json"
    persons = json.loads(path.read_text())["results"] if path.exists() else []
    parts += [person_text(p) for p in persons] or ["Not made yet."]
    a.page.write_text("\n\n".join(parts).rstrip() + "\n")


STEPS = {"train": train, "held_out": held_out, "monte_carlo": monte_carlo, "page": page}


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("--program", required=True)
    parse.add_argument("--work", type=pathlib.Path, required=True)
    parse.add_argument("-j", "--jobs", type=int, default=1)
    parse.add_argument("--only", default=",".join(STEPS), help="steps, with commas between")
    parse.add_argument("--data", type=pathlib.Path, default=DATA)
    parse.add_argument("--out", type=pathlib.Path, default=HERE)
    parse.add_argument("--page", type=pathlib.Path, default=ROOT / "docs/EMULATOR_CHECK.md")
    a = parse.parse_args()
    a.program = str(pathlib.Path(a.program).resolve())
    for step in a.only.split(","):
        if step not in STEPS:
            sys.exit(f"make.py: {step} is no step; there are {', '.join(STEPS)}")
        print(f"make.py: {step}", file=sys.stderr)
        STEPS[step](a)


if __name__ == "__main__":
    main()
