#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solve costs: runs the benchmarks of a release build and writes docs/PERFORMANCE.md and
docs/performance/scale.svg from what they print. Some ten minutes on a quiet machine, about as long
again for CalculiX on every side of Table 2 on the coarse mesh, and two hours at standard.

usage: performance.py [--build DIR] [--from FILE | --only PART]   FILE: kept by an earlier run

Python's standard library only. Measurements stay in docs/performance/measured.json, so that the
page can be written again without measuring.
"""
import argparse
import csv
import json
import math
import os
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.dont_write_bytecode = True
HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE / "validation"), str(ROOT / "tests/verification")]
import ccx  # noqa: E402
import plots  # noqa: E402

KEPT = HERE / "performance/measured.json"
PICTURE = HERE / "performance/scale.svg"
PAGE = HERE / "PERFORMANCE.md"
TABLE2 = ROOT / "examples/table2.csv"
PHASES = ("assembly", "energy", "factor", "solve", "contact", "setup", "other")
SIDES = ("1R", "7L", "8L", "9R", "10R", "12R")
FEW = ("1", "5", "13")  # rows that ratios of two settings are taken on, in turn
MODERATE = {"R1": 6.9, "R2": 19.7, "eM": 28, "eF": 10, "muM": 8, "muF": 5, "F": 40,
            "model": {"bulk_ratio": 15}, "resolution": "coarse"}
# What CalculiX is given; each is row 1R but for this.
CALCULIX_CASES = (
    ("row 1R under 40 N, κ/μ 15, coarse", {}),
    ("the same at standard", {"resolution": "standard"}),
    ("row 1R as it is (196 N, κ/μ 2000), coarse", {"F": 196, "model": {"bulk_ratio": 2000}}),
    ("the same at standard",
     {"F": 196, "model": {"bulk_ratio": 2000}, "resolution": "standard"}),
    ("row 9R as it is, standard",
     {"R1": 7.3, "R2": 30.3, "eM": 19, "eF": 35, "muM": 4.5, "muF": 2.75, "F": 429,
      "model": {"bulk_ratio": 2000}, "resolution": "standard"}),
)
CALCULIX_LIMIT_S = 400
# By the mesh: sides of Table 2 that are left out, and the most time CalculiX is given for one.
CALCULIX_SIDES = {"coarse": ((), 150), "standard": (("2R", "2L", "4L", "7L"), 1500)}


# ---- measuring ----

def lines_of(words, **environment):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, check=True,
                          env={**os.environ, **environment})
    return done.stdout.splitlines()


def solves(build, *words, **environment):
    """Rows of bench_solve: number, phases in CPU s, factorisations, eps_max; and its peak MB."""
    out = lines_of([build / "tests/bench/bench_solve", TABLE2, "standard", *words], **environment)
    names = out[0].split()
    rows = [dict(zip(names, line.split())) for line in out[1:-1]]
    for row in rows:  # "factor" is there twice: seconds, and then a number
        values = [float(v) for v in next(
            line for line in out[1:] if line.split()[0] == row["row"]).split()[1:-1]]
        row.update(zip(("total", *PHASES), values[:8]))
        row["factorisations"] = values[10]
    memory = float(re.search(r"peak memory (\d+) MB", out[-1]).group(1))
    return {"rows": rows, "memory_MB": memory}


def kernels(build):
    """CPU time with the kernels that the BLAS takes by itself over that with those asked for."""
    ratios = []
    for _ in range(3):
        usual = solves(build, *FEW)
        other = solves(build, *FEW, OPENBLAS_CORETYPE="Haswell")
        ratios.append(sum(r["total"] for r in other["rows"]) /
                      sum(r["total"] for r in usual["rows"]))
    return ratios


def workers(program):
    """Wall seconds for the rows of Table 2 with one process and with two."""
    found = []
    for jobs in (1, 2):
        since = time.monotonic()
        lines_of([program, "cohort", TABLE2, "-j", jobs])
        found.append(time.monotonic() - since)
    return found


def children_cpu_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def timed(work):
    since = children_cpu_s()
    try:
        work()
        said = ""
    except (AssertionError, subprocess.TimeoutExpired) as error:
        said = "time is up" if isinstance(error, subprocess.TimeoutExpired) else "did not converge"
    return children_cpu_s() - since, said


def against_calculix(program, case, limit_s):
    """CPU seconds of both programs for the same case on the same mesh, and why CalculiX failed."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "case.json")
        file.write_text(json.dumps(case), encoding="utf-8")
        deck = "\n".join(lines_of([program, "export", "--inp", file]))
        ours, _ = timed(lambda: lines_of([program, "solve", file]))
        theirs, why = timed(lambda: ccx.run(deck, limit_s))
    return {"ischia_s": ours, "calculix_s": theirs, "failed": why}


def calculix(program):
    return [{"case": name, **against_calculix(program, {**MODERATE, **change}, CALCULIX_LIMIT_S)}
            for name, change in CALCULIX_CASES]


def sides_of_table2():
    """1R and so on: its case."""
    with open(TABLE2, newline="", encoding="utf-8") as file:
        return {row["subject"].removeprefix("table2-") + row["side"][0].upper():
                {key.split("_")[0]: float(row[key]) for key in row if key not in ("subject", "side")}
                for row in csv.DictReader(file)}


def calculix_sides(resolution):
    """The same for sides of Table 2 as they are, on one mesh."""
    left_out, limit_s = CALCULIX_SIDES[resolution]

    def measure(program):
        found = [{"side": side, **against_calculix(program, {**case, "resolution": resolution}, limit_s)}
                 for side, case in sides_of_table2().items() if side not in left_out]
        return {"machine": machine(), "sides": found}
    return measure


def growth(build):
    out = lines_of([build / "tests/bench/bench_scale", "1R"])
    keys = ("dof", "cpu_s", "factorisations", "memory_MB", "eps_max")
    return [dict(zip(keys, map(float, line.split()))) for line in out[1:]]


def elements(build):
    """Rows of bench_elements of both elements on the same nodes."""
    found = {}
    for kind in ("linear", "quadratic"):
        out = lines_of([build / f"tests/bench/bench_elements_{kind}", *SIDES])
        keys = ("side", "dof", "cpu_s", "factorisations", "raw", "recovered", "d_mm", "arrived")
        found[kind] = [dict(zip(keys, line.split())) for line in out[1:]]
    return found


def machine():
    text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    model = re.search(r"model name\s*:\s*(.*)", text).group(1)
    return f"{model}, {os.cpu_count()} processors" + (", AVX-512" if "avx512f" in text else "")


def of_program(measure_with):
    return lambda build: measure_with(build / "server/cli/ischia")


def elsewhere(build):
    return {"machine": machine(), "cold": solves(build), "warm": solves(build, "-w")}


# What a run measures, in this order; --only takes one of them, or `elsewhere`: Table 2 on another
# machine than that of the rest.
PARTS = {
    "machine": lambda build: machine(),
    "cold": solves,
    "warm": lambda build: solves(build, "-w"),
    "kernels": kernels,
    "workers_s": of_program(workers),
    "growth": growth,
    "elements": elements,
    "calculix": of_program(calculix),
    **{f"calculix_{mesh}": of_program(calculix_sides(mesh)) for mesh in CALCULIX_SIDES},
}


# ---- the page ----

def slope(rows, key):
    """Of log key over log dof, by least squares."""
    x = [math.log(r["dof"]) for r in rows]
    y = [math.log(r[key]) for r in rows]
    mx, my = statistics.mean(x), statistics.mean(y)
    return (sum((a - mx) * (b - my) for a, b in zip(x, y)) / sum((a - mx) ** 2 for a in x))


def draw(rows):
    figure = plots.Figure(720, 330, "Time and memory of a solve as the mesh grows")
    for left, key, label, colour in ((70, "cpu_s", "CPU s", plots.BLUE),
                                     (430, "memory_MB", "peak memory, MB", plots.ORANGE)):
        logs = [(math.log10(r["dof"]), math.log10(r[key])) for r in rows]
        x_range = (min(p[0] for p in logs) - 0.1, max(p[0] for p in logs) + 0.1)
        y_range = (min(p[1] for p in logs) - 0.2, max(p[1] for p in logs) + 0.2)
        panel = plots.Panel(figure, left, 50, 270, 220, x_range, y_range)
        for power in range(-2, 6):
            for digit in (1, 2, 5):
                at = power + math.log10(digit)
                words = plots.number(digit * 10 ** power)
                if y_range[0] <= at <= y_range[1]:
                    figure.line(left, panel.y(at), left + 270, panel.y(at), plots.FAINT)
                    figure.text(left - 8, panel.y(at) + 4, words, anchor="end")
                if x_range[0] <= at <= x_range[1]:
                    figure.line(panel.x(at), 270, panel.x(at), 275)
                    figure.text(panel.x(at), 290, words, anchor="middle")
        figure.curve([(panel.x(a), panel.y(b)) for a, b in logs], colour)
        for a, b in logs:
            figure.circle(panel.x(a), panel.y(b), 4, colour)
        figure.text(left, 34, f"{label}; slope {slope(rows, key):.2f}", weight="bold")
        figure.text(left + 135, 312, "unknowns", anchor="middle")
    return figure.svg()


def totals(run):
    seconds = sorted(r["total"] for r in run["rows"])
    return seconds[0], statistics.median(seconds), seconds[-1]


def shares(run):
    whole = sum(r["total"] for r in run["rows"])
    return {p: sum(r[p] for r in run["rows"]) / whole for p in PHASES}


def floor_ratio(run):
    """Of each row: CPU time over that of five factorisations of its own."""
    return statistics.median(r["total"] / (5 * r["factor"] / r["factorisations"])
                             for r in run["rows"])


def calculix_lines(rows):
    for r in rows:
        ratio = r["calculix_s"] / r["ischia_s"]
        said = r["failed"] or f"{ratio:.0f} ×"
        yield f"| {r['case']} | {r['ischia_s']:.2f} | {r['calculix_s']:.0f} | {said} |"


def elsewhere_text(found):
    cold, warm = totals(found["cold"]), totals(found["warm"])
    rest = f"{cold[0]:.2f}, {cold[1]:.2f} and {cold[2]:.2f} s"
    after = f"{warm[0]:.2f}, {warm[1]:.2f} and {warm[2]:.2f} s"
    return f"""
The same on another machine ({found['machine']}):
{rest} from rest, {after} after 0.9 of the force.
"""


def sides_row(mesh, found):
    ratios = [r["calculix_s"] / r["ischia_s"] for r in found["sides"] if not r["failed"]]
    reasons = {}
    for r in found["sides"]:
        reasons.setdefault(r["failed"], []).append(r["side"])
    lost = "; ".join(f"{why}: {', '.join(sides)}" for why, sides in reasons.items() if why)
    left_out, limit_s = CALCULIX_SIDES[mesh]
    which = f"all but {', '.join(left_out)}" if left_out else "all"
    return (f"| {mesh} | {which} | {limit_s} s | {len(ratios)} of {len(found['sides'])} | "
            f"{min(ratios):.0f} ×, {statistics.median(ratios):.0f} ×, {max(ratios):.0f} × | {lost or 'none'} |\n")


def sides_text(m):
    text = f"""
Sides of Table 2 as they are ({m['calculix_standard']['machine']}), by the mesh; a run that takes
longer than the limit, waiting included, is given up:

| mesh | sides | limit | CalculiX finishes | CalculiX over Ischia: least, median, most | not finished |
|---|---|---|---|---|---|
"""
    return text + "".join(sides_row(mesh, m[f"calculix_{mesh}"]) for mesh in CALCULIX_SIDES)


def element_cell(row):
    if row["arrived"] != "yes":
        return f"not in {row['factorisations']} | {row['cpu_s']}"
    return f"{row['raw']} … {row['recovered']}, {row['d_mm']} | {row['cpu_s']}"


def elements_text(found):
    text = """
## Another element

`bench_elements_linear` and `bench_elements_quadratic`: the shipped element (8 nodes, constant pressure) and one of
27 nodes with a linear pressure, on the same nodes and with everything else the same. The two readings of ε_max on
the axis, the bone's travel in mm, and CPU seconds; *not in* so many factorisations: given up.

| side | unknowns | 8 nodes | CPU s | 27 nodes | CPU s |
|---|---|---|---|---|---|
"""
    for ours, theirs in zip(found["linear"], found["quadratic"]):
        text += f"| {ours['side']} | {ours['dof']} | {element_cell(ours)} | {element_cell(theirs)} |\n"
    lost = {kind: sum(r["arrived"] != "yes" for r in rows) for kind, rows in found.items()}
    text += f"\nOf {len(found['linear'])} paths {lost['linear']} do not arrive with 8 nodes and "
    return text + f"{lost['quadratic']} with 27. What follows from it: decision 23.\n"


def page(m):
    cold, warm = totals(m["cold"]), totals(m["warm"])
    part = shares(m["cold"])
    number = statistics.median(r["factorisations"] for r in m["cold"]["rows"])
    one_ms = 1e3 * statistics.median(r["factor"] / r["factorisations"] for r in m["cold"]["rows"])
    ratios = ", ".join(f"{k:.2f}" for k in m["kernels"])
    one, two = m["workers_s"]
    text = f"""# What a solve costs

Written by `docs/performance.py`, which runs the benchmarks of a release build (`meson setup build/release
--buildtype=release`, `ninja -C build/release`) and keeps what they print in `docs/performance/measured.json`.
Machine: {m['machine']}, one of its processors a solve. Times are CPU seconds of one run
and vary by a fifth on a machine that others share; ratios are of one run.

## Table 2 at `standard`

| 26 sides | least | median | most |
|---|---|---|---|
| from rest: `bench_solve examples/table2.csv standard` | {cold[0]:.2f} s | {cold[1]:.2f} s | {cold[2]:.2f} s |
| after the same side with 0.9 of the force: `… standard -w` | {warm[0]:.2f} s | {warm[1]:.2f} s | {warm[2]:.2f} s |

Going on gives the bits of a solve from rest (decision 20; test_solver). Peak memory {m['cold']['memory_MB']:.0f} MB.

| phase | share of the time |
|---|---|
| numeric factorisation (CHOLMOD) | {100 * part['factor']:.0f} % |
| assembly: energy, forces, tangents | {100 * (part['assembly'] + part['energy']):.0f} % |
| triangular solves and the condensed seat | {100 * part['solve']:.0f} % |
| contact and friction | {100 * part['contact']:.0f} % |
| analysis of the sparsity, once a process | {100 * part['setup']:.0f} % |
| the rest: strains, clusters, the load curve | {100 * part['other']:.0f} % |

The floor: a side takes {number:.0f} factorisations (median) of {one_ms:.0f} ms each; its time is
{floor_ratio(m['cold']):.1f} times that of five. What holds the rest is the number of load steps, eleven to
fifteen, of two to three factorisations each; longer steps fail and are halved (decision 20).
{elsewhere_text(m["elsewhere"]) if "elsewhere" in m else ""}
## Growth with the mesh

`bench_scale 1R`: one side on five meshes of one shape.

| unknowns | CPU s | factorisations | peak MB | eps_max |
|---|---|---|---|---|
"""
    for r in m["growth"]:
        text += (f"| {r['dof']:.0f} | {r['cpu_s']:.2f} | {r['factorisations']:.0f} | "
                 f"{r['memory_MB']:.0f} | {r['eps_max']:.4f} |\n")
    text += f"""
![Time and memory against unknowns, both axes logarithmic](performance/scale.svg)

Slopes: time {slope(m['growth'], 'cpu_s'):.2f}, memory {slope(m['growth'], 'memory_MB'):.2f}.

## Two workers

`ischia cohort examples/table2.csv`, wall seconds: {one:.0f} with `-j 1`, {two:.0f} with `-j 2`:
{one / two:.2f} times the throughput.

## Kernels of the BLAS

CPU time of rows {', '.join(FEW)} with OpenBLAS' AVX2 kernels (`OPENBLAS_CORETYPE=Haswell`) over that with
those the program asks for (decision 20), three times: {ratios}.

## Against CalculiX

The same deck that `ischia export --inp` writes, on one thread; CalculiX 2.20, at most
{CALCULIX_LIMIT_S} s of its time. CPU seconds, start and reading included.

| case | Ischia | CalculiX | CalculiX over Ischia |
|---|---|---|---|
"""
    text += "\n".join(calculix_lines(m["calculix"])) + "\n"
    return text + sides_text(m) + elements_text(m["elements"])


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("--build", type=Path, default=ROOT / "build/release")
    parse.add_argument("--from", dest="kept", type=Path)
    parse.add_argument("--only", choices=[*PARTS, "elsewhere"],
                       help="measure this part alone, keep the rest")
    a = parse.parse_args()
    kept = a.kept or KEPT
    measured = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    if not a.kept:
        for part in [a.only] if a.only else PARTS:
            measured[part] = (PARTS.get(part) or elsewhere)(a.build.resolve())
        KEPT.parent.mkdir(exist_ok=True)
        KEPT.write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")
    PICTURE.write_text(draw(measured["growth"]), encoding="utf-8")
    PAGE.write_text(page(measured), encoding="utf-8")


if __name__ == "__main__":
    main()
