#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes docs/VALIDATION.md and its figures from the result files kept in docs/validation/data.

  make.py --program build/ischia [--data DIR] [--out docs]

Every number and figure comes from those files, which keep.py puts there with version, command,
machine and checksum; a file that does not match its checksum stops the run. The statistics are
those of `ischia study`. Python's standard library only; the same files give the same bytes.
"""

import argparse
import csv
import gzip
import hashlib
import io
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

import plots
import runs
from page_readings import compressibility, force_in_soft_muscle, lost_runs, readings
from readings import SUBSETS
from words import percent, quantile, signed, solved, table, value

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PUBLISHED = HERE / "published/macron2020.json"
DESIGN = ROOT / "examples/design_table1.json"
# The linear algebra library chooses its kernels by the processor: one choice, the same last digits.
SAME_BITS = {"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "1"}
FACTORS = ["R1", "R2", "eM", "eF", "muM", "muF", "F"]
NAMES = {
    "R1": "R1 (mm)",
    "R2": "R2 (mm)",
    "eM": "eM (mm)",
    "eF": "eF (mm)",
    "muM": "μM (kPa)",
    "muF": "μF (kPa)",
    "F": "F (N)",
}
MODELS = [
    ("default", "default reading", plots.GREEN),
    ("as_published", "`as-published` preset", plots.ORANGE),
]


class Results:
    """The kept files, checked against their checksums."""

    def __init__(self, data, program, work):
        self.data, self.program, self.work = data, program, work
        path = data / "manifest.json"
        self.manifest = json.loads(path.read_text()) if path.exists() else {}
        self.rows = {name: self.read(name) for name in self.manifest}

    def read(self, name):
        text = gzip.decompress((self.data / f"{name}.csv.gz").read_bytes())
        if hashlib.sha256(text).hexdigest() != self.manifest[name]["sha256"]:
            sys.exit(f"make.py: {name}.csv.gz does not match its checksum in manifest.json")
        (self.work / f"{name}.csv").write_bytes(text)
        return list(csv.DictReader(io.StringIO(text.decode())))

    def has(self, name):
        return name in self.rows

    def study(self, command, name, *options):
        done = subprocess.run(
            [self.program, "study", command, str(self.work / f"{name}.csv"), *options, "-o", "-"],
            env={**os.environ, **SAME_BITS},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            sys.exit(f"make.py: {command} of {name} failed: {done.stderr}")
        return json.loads(done.stdout)

    def emulate(self, name):
        return self.study("emulate", name, "--design", str(DESIGN), "--published", str(PUBLISHED))


# ---- sections: each returns Markdown, "" when its files are not there ----


def missing(results, out):
    """Which runs the page still waits for: nothing below is made up for them."""
    rows = [[f"`{r.name}`", r.title, f"`{r.command()}`"] for r in runs.RUNS]
    rows = [row for row, r in zip(rows, runs.RUNS) if not results.has(r.name)]
    for key, subset in SUBSETS.items():
        left = [name for name in subset.names if not results.has(f"{subset.prefix}_{name}")]
        if left:
            rows.append(
                [
                    f"`{subset.prefix}_…`",
                    f"{len(left)} of {len(subset.names)} readings, {subset.resolution}",
                    f"`readings.py --subset {key} --keep`",
                ]
            )
    if not rows:
        return ""
    return (
        "## What has not been run yet\n\nThis page is written from kept result files, and these"
        " are not there. Sections that need them are missing; no number stands in for them."
        " `docs/validation/run.py` makes all of them and writes this page again.\n\n"
        + table(["file", "what", "command"], rows)
    )


def provenance(results, out):
    if not results.manifest:
        return ""
    rows = [
        [
            f"`{name}`",
            m["title"],
            m["rows"],
            m["version"],
            f"`{m['command']}`",
            m["machine"],
            m["date"],
            f"`{m['sha256'][:12]}…`",
        ]
        for name, m in results.manifest.items()
    ]
    return (
        "## What was run\n\nThe files are in `docs/validation/data`; `manifest.json` there has"
        " the whole checksums.\n\n"
        + table(
            ["file", "what", "rows", "version", "command", "machine", "date", "SHA-256"],
            rows,
            (2,),
        )
    )


def cohort_figure(rows, words):
    subjects = list(dict.fromkeys(r["subject"] for r in rows))
    bars = []
    for subject in subjects:
        sides = {
            r["side"]: (
                (value(r, "eps_max"), value(r, "eps_max_error", 0), value(r, "mean_pressure_kPa"))
                if r["status"] == "succeeded"
                else None
            )
            for r in rows
            if r["subject"] == subject
        }
        bars.append((subject, sides))
    return plots.cohort_bars(bars, f"ε_max of the cohort, {words}")


def cohort(results, out):
    text = ""
    for key, words, _ in MODELS:
        name = f"cohort_{key}"
        if not results.has(name):
            continue
        rows = results.rows[name]
        good = solved(rows)
        plain = words.replace("`", "")
        (out / f"{name}.svg").write_text(cohort_figure(rows, plain))
        eps = [value(r, "eps_max") for r in good]
        text += (
            f"### {words[0].upper() + words[1:]}\n\n{len(good)} of {len(rows)} sides converged"
            f" (the paper: 25 of 26). ε_max runs from {min(eps):.2f} to"
            f" {max(eps):.2f}.\n\n![ε_max of each subject and side with the mean contact"
            f" pressure](validation/{name}.svg)\n\n"
        )
        text += (
            table(
                [
                    "subject",
                    "side",
                    "ε_max",
                    "± error",
                    "E_shear max",
                    "over shear, mm³",
                    "over both, mm³",
                    "seat travel, mm",
                    "mean p, kPa",
                    "peak p, kPa",
                    "end",
                ],
                [
                    [
                        r["subject"],
                        r["side"],
                        *(
                            f"{value(r, c):.{d}f}" if r["status"] == "succeeded" else ""
                            for c, d in (
                                ("eps_max", 3),
                                ("eps_max_error", 3),
                                ("E_shear_max", 2),
                                ("volume_shear_mm3", 0),
                                ("volume_both_mm3", 0),
                                ("seat_displacement_mm", 1),
                                ("mean_pressure_kPa", 1),
                                ("peak_pressure_kPa", 1),
                            )
                        ),
                        "converged" if r["status"] == "succeeded" else r["reason"],
                    ]
                    for r in rows
                ],
                range(2, 10),
            )
            + "\n"
        )
    if not text:
        return ""
    return (
        "## The 26 sides of Table 2\n\nThe bars correspond to the local model's in Fig. 3 of the"
        " paper, whose values are not printed.\n\n"
        + text
    )


def predictors(results, out):
    text = ""
    for key, words, _ in MODELS:
        name = f"cohort_{key}"
        if not results.has(name) or len(solved(results.rows[name])) < 4:
            continue
        document = results.study("compare", name)
        rows = solved(results.rows[name])
        pairs = [p for p in document["pairs"] if p["problem"] is None]
        text += (
            f"### {words[0].upper() + words[1:]}\n\n"
            + table(
                ["predictor of ε_max", "n", "Pearson r", "95 %", "p", "Spearman ρ"],
                [
                    [
                        f"`{p['a']}`",
                        p["n"],
                        f"{p['pearson_r']:.2f}",
                        f"{p['pearson_ci95'][0]:.2f} … {p['pearson_ci95'][1]:.2f}",
                        f"{p['pearson_p']:.2g}",
                        f"{p['spearman_rho']:.2f}",
                    ]
                    for p in pairs
                ],
                (1, 2, 4, 5),
            )
            + "\n"
        )
        panels = [
            (
                f"{plain}: r = {p['pearson_r']:.2f}",
                [(value(r, p["a"]), value(r, "eps_max")) for r in rows],
                colour,
            )
            for p, plain, colour in zip(
                pairs[:2], ("mean pressure", "peak pressure"), (plots.BLUE, plots.RED)
            )
        ]
        (out / f"pressure_{key}.svg").write_text(
            plots.against(
                panels,
                f"Pressure as a predictor of strain, {words.replace('`', '')}",
                ["mean pressure, kPa", "peak pressure, kPa"],
                "ε_max",
            )
        )
        text += f"![ε_max against contact pressure](validation/pressure_{key}.svg)\n\n"
        text += (
            "The Hertz-type baseline (`eps_hertz`) is within its range of validity for "
            f"{document['hertz_valid_rows']} of {document['rows']} sides.\n\n"
        )
    if not text:
        return ""
    return (
        "## Pressure and a formula as predictors\n\nThe paper correlates the *full* model's"
        " strain with pressure (r = 0.43, p = 0.03, n = 26). The full model's values are not"
        " printed, so this is the local model's strain against its own contact pressure."
        " `eps_hertz` is a small-strain Hertz contact of a rigid ellipsoid (Johnson 1985) on one"
        " bonded incompressible layer (Dimitriadis et al. 2002), valid for indentations up to a"
        " tenth of the tissue.\n\n"
        + text
    )


def reasons(bad):
    """How many failed for which reason: the first word of each."""
    counts = {}
    for r in bad:
        word = r["reason"].split(":")[0]
        counts[word] = counts.get(word, 0) + 1
    return ", ".join(f"{n} `{word}`" for word, n in sorted(counts.items(), key=lambda c: -c[1]))


def failures(rows):
    bad = [r for r in rows if r["status"] != "succeeded"]
    if not bad:
        return ""
    return (
        f"Not converged: {reasons(bad)}. Each with how far it came:\n\n"
        + table(
            ["row", *FACTORS, "reason", "last converged F, N"],
            [
                [r["row"], *(r[f] for f in FACTORS), r["reason"], r.get("last_converged_F_N", "")]
                for r in bad
            ],
            range(0, 8),
        )
        + "\n"
    )


def factorial(results, out):
    text = ""
    for key, words, _ in MODELS:
        name = f"table1_{key}"
        if not results.has(name):
            continue
        rows = results.rows[name]
        good = solved(rows)
        text += (
            f"### {words[0].upper() + words[1:]}\n\n**{len(good)} of {len(rows)}** solves"
            " converged (the paper: 1948 of 2187).\n\n"
        )
        by_muM = []
        for level in sorted({float(r["muM"]) for r in rows}):
            at = [r for r in rows if float(r["muM"]) == level]
            errors = [value(r, "eps_max_error") / value(r, "eps_max") * 100 for r in solved(at)]
            eps = [value(r, "eps_max") for r in solved(at)]
            by_muM.append(
                [
                    f"{level:g}",
                    len(at),
                    len(eps),
                    f"{min(eps):.2f} … {max(eps):.2f}",
                    f"{quantile(errors, 0.5):.2g} %",
                    f"{quantile(errors, 0.95):.2g} %",
                ]
                if eps
                else [f"{level:g}", len(at), 0, "", "", ""]
            )
        text += (
            table(
                [
                    "μM, kPa",
                    "solves",
                    "converged",
                    "ε_max",
                    "median error",
                    "95th centile of error",
                ],
                by_muM,
                (0, 1, 2, 4, 5),
            )
            + "\n"
            + failures(rows)
        )
    return "## All points of Table 1\n\n" + text if text else ""


def side_by_side(fits, degree):
    """fits: {key: emulate document}; a table with the printed coefficients first."""
    keys = list(fits)
    first = next(f for f in fits[keys[0]]["fits"] if f["degree"] == degree)
    found = {
        k: {
            c["term"]: c
            for c in next(f for f in fits[k]["fits"] if f["degree"] == degree)["coefficients"]
        }
        for k in keys
    }
    terms = [
        c
        for c in first["coefficients"]
        if c["published_theta"] is not None
        or (c["term"] != "1" and any(found[k][c["term"]]["share_percent"] >= 1 for k in keys))
    ]
    terms.sort(
        key=lambda c: -(abs(c["published_theta"]) if c["published_theta"] is not None else 0)
    )
    header = ["term", "printed θ"] + [f"θ, {k}" for k in keys] + [f"± se, {k}" for k in keys]
    rows = [
        [plots.symbol(c["term"]), signed(c["published_theta"])]
        + [signed(found[k][c["term"]]["theta"]) for k in keys]
        + [f"{found[k][c['term']]['standard_error']:.4f}" for k in keys]
        for c in terms
    ]
    return table(header, rows, range(1, len(header)))


def leading(fits):
    """Signs and order of the four leading first-order effects against Table 3."""
    published = json.loads(PUBLISHED.read_text())["degree_1"]["terms"]
    wanted = sorted(published, key=lambda t: -t["S_percent"])[:4]
    text = ""
    for key, document in fits.items():
        fit = next(f for f in document["fits"] if f["degree"] == 1)
        theta = {c["term"]: c["theta"] for c in fit["coefficients"]}
        order = sorted(fit["parameters"], key=lambda p: -p["S_percent"])
        ours = [p["key"] for p in order[:4]]
        turned = [t["term"] for t in wanted if theta[t["term"]] * t["theta"] < 0]
        same = ours == [t["term"] for t in wanted]
        text += (
            f"- {key}: {' > '.join(plots.symbol(p) for p in ours)};"
            f" {'the order of Table 3' if same else 'not the order of Table 3'},"
            f" {'with its signs' if not turned else 'with another sign for ' + ', '.join(turned)}.\n"
        )
    printed = " > ".join(plots.symbol(t["term"]) for t in wanted)
    return f"The four leading first-order effects; Table 3 prints {printed}:\n\n{text}\n"


def parameter_table(fits, degree):
    keys = list(fits)
    printed = {
        c["term"]: c["published_S_percent"]
        for c in next(f for f in fits[keys[0]]["fits"] if f["degree"] == degree)["coefficients"]
    }
    found = {
        k: {
            p["key"]: p
            for p in next(f for f in fits[k]["fits"] if f["degree"] == degree)["parameters"]
        }
        for k in keys
    }
    header = (
        ["parameter", "printed S, %"]
        + [f"S, %, {k}" for k in keys]
        + [f"total Sobol' index, {k}" for k in keys]
    )
    order = sorted(FACTORS, key=lambda p: -(printed.get(p) or 0))
    return table(
        header,
        [
            [NAMES[p].split(" ")[0], percent(printed.get(p))]
            + [percent(found[k][p]["S_percent"]) for k in keys]
            + [f"{found[k][p]['sobol_total']:.3f}" for k in keys]
            for p in order
        ],
        range(1, len(header)),
    )


def quality_table(fits, degree):
    published = json.loads(PUBLISHED.read_text())[f"degree_{degree}"]["mean_squared_residuals"]
    rows = [["printed", f"{published:.2g}", "73 %" if degree == 1 else "95 %", "", "", ""]]
    for key, document in fits.items():
        fit = next(f for f in document["fits"] if f["degree"] == degree)
        beside = fit["against_published"]
        rows.append(
            [
                key,
                f"{fit['mean_squared_residuals']:.2g}",
                f"{100 * fit['r2']:.0f} %",
                f"{fit['leave_one_out_mean_square']:.2g}",
                f"{beside['same_sign']} of {beside['terms']}",
                f"{beside['relative_distance']:.2f}",
            ]
        )
    return table(
        [
            "",
            "mean squared residual",
            "R²",
            "leave-one-out",
            "same sign as printed",
            "relative distance",
        ],
        rows,
        range(1, 6),
    )


def tables(results, out):
    fits = {
        key: results.emulate(f"table1_{key}")
        for key, _, _ in MODELS
        if results.has(f"table1_{key}")
    }
    if not fits:
        return ""
    published = json.loads(PUBLISHED.read_text())
    text = (
        "## Tables 3 and 4 side by side\n\nOrdinary least squares in parameters normalised to"
        " [−1, 1]; S by the paper's formulas (moments 1/3, 4/45, 1/9), which are also the"
        " first-order Sobol' indices of the polynomial; a total index adds the parameter's"
        " interactions. The paper prints no R²: its values here are 1 − (mean squared residual) /"
        " 0.075, the residual it gives for a constant. *Relative distance* is √(Σ(ours −"
        " printed)² / Σ printed²) over the printed coefficients: 0 is equal, 1 is as far as no"
        " effect at all.\n\n"
    )
    for degree in (1, 2):
        text += (
            f"### Degree {degree} (Table {degree + 2})\n\n"
            + quality_table(fits, degree)
            + "\n"
            + side_by_side(fits, degree)
            + "\n"
            + parameter_table(fits, degree)
            + "\n"
            + (leading(fits) if degree == 1 else "")
        )
        printed = {
            t["term"].replace("muM*eM", "eM*muM").replace("muM*eF", "eF*muM"): t["theta"]
            for t in published[f"degree_{degree}"]["terms"]
        }
        terms = sorted(printed, key=lambda t: -abs(printed[t]))
        series = [("printed", plots.GREY, printed)]
        for key, words, colour in MODELS:
            if key in fits:
                fit = next(f for f in fits[key]["fits"] if f["degree"] == degree)
                series.append(
                    (
                        words.replace("`", ""),
                        colour,
                        {
                            c["term"]: c["theta"]
                            for c in fit["coefficients"]
                            if c["term"] in printed
                        },
                    )
                )
        (out / f"coefficients_{degree}.svg").write_text(
            plots.coefficient_bars(terms, series, f"Coefficients that Table {degree + 2} prints")
        )
        text += f"![Printed coefficients beside ours](validation/coefficients_{degree}.svg)\n\n"
    return text


def polynomial(document, degree):
    fit = next(f for f in document["fits"] if f["degree"] == degree)
    scale = {
        f["key"]: ((f["minus_one"] + f["plus_one"]) / 2, (f["plus_one"] - f["minus_one"]) / 2)
        for f in document["factors"]
    }

    def product(term, x):
        if term == "1":
            return 1.0
        if term.endswith("^2"):
            return x[term[:-2]] ** 2
        result = 1.0
        for key in term.split("*"):
            result *= x[key]
        return result

    def predict(row):
        x = {k: (float(row[k]) - middle) / half for k, (middle, half) in scale.items()}
        return sum(c["theta"] * product(c["term"], x) for c in fit["coefficients"])

    return predict


def averaged(document, factor, levels):
    """The degree-2 polynomial along one factor, averaged over the three-level grid of the others:
    there the mean of x is 0 and that of x squared 2/3."""
    theta = {
        c["term"]: c["theta"]
        for f in document["fits"]
        if f["degree"] == 2
        for c in f["coefficients"]
    }
    rest = theta["1"] + sum(theta[f"{k}^2"] * 2 / 3 for k in FACTORS if k != factor)
    low, high = levels[0], levels[-1]
    points = []
    for i in range(17):
        x = i / 8 - 1
        points.append(
            (low + (high - low) * i / 16, rest + theta[factor] * x + theta[f"{factor}^2"] * x * x)
        )
    return points


def emulator(results, out):
    text = ""
    for key, words, _ in MODELS:
        name = f"table1_{key}"
        if not results.has(name):
            continue
        document, rows = results.emulate(name), solved(results.rows[name])
        effects, curves = {}, {}
        for factor in FACTORS:
            levels = sorted({float(r[factor]) for r in rows})
            pick = {v: [r for r in rows if float(r[factor]) == v] for v in levels}
            effects[NAMES[factor]] = [
                (v, sum(value(r, "eps_max") for r in pick[v]) / len(pick[v])) for v in levels
            ]
            curves[NAMES[factor]] = averaged(document, factor, levels)
        plain = words.replace("`", "")
        (out / f"main_effects_{key}.svg").write_text(
            plots.main_effects(effects, curves, f"Main effects on ε_max, {plain}")
        )
        text += (
            "![Mean ε_max at each level of each"
            f" parameter](validation/main_effects_{key}.svg)\n\n"
        )
        held = solved(results.rows.get(f"sobol_{key}", []))
        panels = []
        for degree, colour in ((1, plots.BLUE), (2, plots.ORANGE)):
            predict = polynomial(document, degree)
            points = [(value(r, "eps_max"), predict(r)) for r in held or rows]
            rms = math.sqrt(sum((a - b) ** 2 for a, b in points) / len(points))
            panels.append(
                (
                    (
                        f"degree {degree}: RMS {rms:.3f} at"
                        f" {len(points)} {'new' if held else 'fitted'} points"
                    ),
                    points,
                    colour,
                )
            )
        (out / f"emulator_{key}.svg").write_text(
            plots.against(
                panels,
                f"Polynomial against solver, {plain}",
                "ε_max of the solver",
                "ε_max of the polynomial",
                True,
            )
        )
        text += f"![Polynomial against solver](validation/emulator_{key}.svg)\n\n" + (
            f"The points are held out: a Sobol' sequence that the fit has not seen ({words}).\n\n"
            if held
            else ""
        )
    return "## Main effects, and the polynomial against the solver\n\n" + text if text else ""


def printed_check(results, out):
    """Whether the printed percentages follow from the printed coefficients: arithmetic on the
    paper alone."""
    published = json.loads(PUBLISHED.read_text())
    one = {t["term"]: t for t in published["degree_1"]["terms"]}
    two = {t["term"]: t for t in published["degree_2"]["terms"]}
    implied = math.sqrt(one["R1"]["S_percent"] / one["muM"]["S_percent"]) * abs(
        one["muM"]["theta"]
    )
    variance = two["muM*eM"]["theta"] ** 2 / 9 / (two["muM*eM"]["S_percent"] / 100)
    rows = []
    for p in ("muM", "R2", "F", "R1"):
        square = two[f"{p}^2"]["theta"] ** 2 * 4 / 45
        linear = {2: two[p]["theta"], 1: one[p]["theta"] if p != "R1" else implied}
        own, other = ((linear[d] ** 2 / 3 + square) / variance * 100 for d in (2, 1))
        rows.append(
            [NAMES[p].split(" ")[0], percent(two[p]["S_percent"]), f"{own:.1f}", f"{other:.1f}"]
        )
    return (
        "## What the printed tables say about themselves\n\nTable 3 prints −0.1092 for R1 beside"
        f" S = 10 %; with the other rows that percentage needs a magnitude of {implied:.3f}, so"
        " the coefficient is probably a misprint. Table 4's percentages do not follow from Table"
        " 4's own linear coefficients, but they do follow, to half a point, from Table 3's"
        f" linear coefficients together with Table 4's squares (var(y) = {variance:.4f} from the"
        " μM·eM row; R1 with its corrected coefficient). So the percentages of Table 4 probably"
        " mix two fits, and comparisons here use the coefficients, not the percentages.\n\n"
        + table(
            ["parameter", "printed S, %", "from Table 4's linear θ", "from Table 3's linear θ"],
            rows,
            range(1, 4),
        )
    )


HEAD = """# Validation

Generated by `docs/validation/make.py`; do not edit. `docs/STUDIES.md` says how to make the files it
reads.

The question is whether this program, which is not the authors' program, tells the same story as the
published study (Macron et al. 2020): the same cohort, the same full factorial, the same polynomial
fits. The paper prints neither the 26 values of ε_max nor the constants of its fits, so there are no
golden numbers: signs, ranks and rough sizes are what can be compared. Strain named ε is engineering
strain, strain named E is Green–Lagrange; the injury thresholds apply to E only.

"""


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("--program", required=True)
    parse.add_argument("--data", type=pathlib.Path, default=HERE / "data")
    parse.add_argument("--out", type=pathlib.Path, default=ROOT / "docs")
    parse.add_argument(
        "--remarks",
        type=pathlib.Path,
        default=HERE / "remarks.md",
        help="hand-written part: where we differ from the paper, and why",
    )
    a = parse.parse_args()
    figures = a.out / "validation"
    figures.mkdir(parents=True, exist_ok=True)
    for old in figures.glob("*.svg"):
        old.unlink()  # of files that are not kept any more
    with tempfile.TemporaryDirectory() as work:
        results = Results(a.data, a.program, pathlib.Path(work))
        remarks = a.remarks.read_text().strip() if a.remarks.exists() else ""
        sections = [
            remarks,
            missing(results, figures).strip(),
            *(
                s(results, figures).strip()
                for s in (
                    cohort,
                    predictors,
                    factorial,
                    tables,
                    emulator,
                    readings,
                    compressibility,
                    force_in_soft_muscle,
                    lost_runs,
                    printed_check,
                    provenance,
                )
            ),
        ]
    (a.out / "VALIDATION.md").write_text(HEAD + "\n\n".join(s for s in sections if s) + "\n")


if __name__ == "__main__":
    main()
