#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the expected values that tests/unit/test_special.c, test_statistics.c, test_sequence.c and
test_least_squares.c read, computed by SciPy and NumPy (Debian: python3-scipy). The files are
committed; the tests do not need SciPy. Run as: tests/oracle/study_oracle.py tests/unit/data"""

import csv
import pathlib
import sys

import numpy as np
import scipy
from scipy import special, stats
from scipy.stats import qmc


def write(path, header, rows):
    with open(path, "w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(header)
        for row in rows:
            writer.writerow([repr(float(v)) if not isinstance(v, str) else v for v in row])


def t_quantile(p, freedom):
    """ppf alone is good to 1e-9 in the tails (cot(pi p) for one degree of freedom shows it): two
    Newton steps on SciPy's own distribution function finish it."""
    t = stats.t.ppf(p, freedom)
    for _ in range(2):
        t -= (stats.t.cdf(t, freedom) - p) / stats.t.pdf(t, freedom)
    return t


def special_rows():
    for a in (0.5, 1, 2.5, 12, 150, 1000):
        for b in (0.5, 1, 7, 60):
            for x in (1e-8, 0.01, 0.3, 0.5, 0.9, 0.999):
                yield "beta", a, b, x, special.betainc(a, b, x)
    for freedom in (1, 2, 3.5, 11, 24, 200, 100000):
        for t in (0.001, 0.5, 1, 2.0639, 5, 20):
            yield "t_two_sided", t, freedom, 0, 2 * stats.t.sf(t, freedom)
        for p in (0.0005, 0.025, 0.3, 0.9, 0.975, 0.9999):
            yield "t_quantile", p, freedom, 0, t_quantile(p, freedom)
    for p in (1e-9, 0.001, 0.025, 0.5, 0.84, 0.975, 1 - 1e-6):
        yield "normal_quantile", p, 0, 0, stats.norm.ppf(p)


def samples():
    """Pairs of readings: correlated, weakly correlated, with ties, nearly constant, tiny."""
    rng = np.random.default_rng(20200711)
    a = rng.normal(1.3, 0.15, 26)
    yield "strong", a, 0.2 + 0.6 * a + rng.normal(0, 0.03, 26)
    yield "weak", a, rng.normal(9, 2, 26)
    yield "ties", np.round(a, 1), np.round(2 - a + rng.normal(0, 0.1, 26), 1)
    yield "offset", 1e6 + a, 1e6 + a**2
    yield "four", np.array([1.0, 2.0, 4.0, 3.0]), np.array([1.5, 1.0, 3.5, 4.5])


def pair_statistics(a, b):
    n = len(a)
    r = stats.pearsonr(a, b)
    ci = r.confidence_interval(0.95)
    rho = stats.spearmanr(a, b)
    line = stats.linregress(a, b)
    d = b - a
    sd = d.std(ddof=1)
    t = stats.t.ppf(0.975, n - 1)
    residual = b - line.intercept - line.slope * a
    return [
        r.statistic,
        r.pvalue,
        ci.low,
        ci.high,
        rho.correlation,
        rho.pvalue,
        np.mean(d**2),
        line.slope,
        line.intercept,
        np.mean(residual**2),
        np.var(b),
        d.mean(),
        sd,
        d.mean() - t * sd / np.sqrt(n),
        d.mean() + t * sd / np.sqrt(n),
        d.mean() - 1.96 * sd,
        d.mean() + 1.96 * sd,
        t * sd * np.sqrt(3 / n),
    ]


STATISTICS = (
    "pearson_r pearson_p pearson_low pearson_high spearman_rho spearman_p mean_square slope "
    "intercept corrected_mean_square constant_mean_square bias bias_sd bias_low bias_high "
    "limit_low limit_high limits_half_ci"
).split()


def sequence_rows():
    sobol = qmc.Sobol(14, scramble=False).random(64)
    halton = qmc.Halton(14, scramble=False).random(64)
    for i in range(64):
        for d in range(14):
            yield i, d, sobol[i, d], halton[i, d]


def regression():
    """Noisy data for a straight line through three columns; R's lm() gives the same numbers."""
    rng = np.random.default_rng(7)
    A = np.column_stack([np.ones(20), rng.uniform(-1, 1, 20), rng.uniform(-1, 1, 20)])
    y = A @ [1.2, -0.3, 0.05] + rng.normal(0, 0.1, 20)
    beta, rss, _, _ = np.linalg.lstsq(A, y, rcond=None)
    cov = np.linalg.inv(A.T @ A)
    se = np.sqrt(rss[0] / 17 * np.diag(cov))
    leverage = np.einsum("ij,jk,ik->i", A, cov, A)
    loo = np.mean(((y - A @ beta) / (1 - leverage)) ** 2)
    r2 = 1 - rss[0] / np.sum((y - y.mean()) ** 2)
    return A, y, [*beta, *se, rss[0] / 20, r2, 1 - (1 - r2) * 19 / 17, loo]


def main():
    out = pathlib.Path(sys.argv[1])
    write(out / "special.csv", ["function", "a", "b", "x", "value"], special_rows())
    pairs = list(samples())
    write(
        out / "pairs.csv",
        ["sample", "a", "b"],
        ((name, x, y) for name, a, b in pairs for x, y in zip(a, b)),
    )
    # the committed text, not the doubles in memory, is what the test reads: repr() keeps both equal
    write(
        out / "pairs_expected.csv",
        ["sample", *STATISTICS],
        ((name, *pair_statistics(a, b)) for name, a, b in pairs),
    )
    write(out / "sequence.csv", ["index", "dimension", "sobol", "halton"], sequence_rows())
    A, y, expected = regression()
    write(out / "regression.csv", ["c0", "c1", "c2", "y"], (list(r) + [v] for r, v in zip(A, y)))
    write(
        out / "regression_expected.csv",
        ["b0", "b1", "b2", "se0", "se1", "se2", "mean_square", "r2", "r2_adjusted", "loo"],
        [expected],
    )
    print(f"written with SciPy {scipy.__version__}, NumPy {np.__version__}")


main()
