# SPDX-License-Identifier: GPL-3.0-or-later
"""How docs/VALIDATION.md reads rows, and writes tables and numbers."""

import math


def table(header, rows, right=()):
    marks = ["---:" if i in right else "---" for i in range(len(header))]
    lines = [header, marks, *rows]
    return "\n".join("| " + " | ".join(str(c) for c in line) + " |" for line in lines) + "\n"


def signed(x, digits=4):
    return "" if x is None else f"{x:+.{digits}f}".replace("-", "−")


def percent(x):
    return "" if x is None else f"{x:.2g}" if x < 1 else f"{x:.1f}" if x < 10 else f"{x:.0f}"


def quantile(values, q):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(q * len(ordered)))]


def solved(rows):
    return [r for r in rows if r["status"] == "succeeded"]


def value(row, column, default=math.nan):
    return float(row[column]) if row.get(column) else default
