# SPDX-License-Identifier: GPL-3.0-or-later
"""Kriging with a polynomial trend and noise that grows where the solver's answers scatter.

y(z) = trend(z) + g(z) + noise(z): the trend is a sum of polynomials whose coefficients are free, g a
Gaussian process with the rational quadratic covariance s^2 (1 + r^2/4)^-2, r^2 = sum ((z - z') / l)^2
(Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, 4.19 with alpha 2), which costs
no exponential to evaluate; the noise's variance is the exponential of a linear function of z. The
covariance's numbers maximise the restricted likelihood (same book, 2.7, vague trend): its gradient is
tr(Q dK)/2 - (Qy)' dK (Qy)/2 with Q = C - C T (T'CT)^-1 T'C, C = (K + noise)^-1. The error of predicting
a row from all others is (Qy)_i / Q_ii (Dubrule, Math. Geol. 15 (1983) 687).
"""

import os

# One thread repeats its bits, and several would wait for each other on small matrices. Before NumPy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402

ALPHA = 2.0
LENGTHS = (0.3, 30.0)  # in scaled inputs, whose box is two long
ROUNDS = 90


def distances(a, b, lengths):
    a, b = a / lengths, b / lengths
    squares = (a * a).sum(1)[:, None] + (b * b).sum(1) - 2 * (a @ b.T)
    return np.maximum(squares, 0)


def covariance(a, b, lengths):
    return (1 + distances(a, b, lengths) / (2 * ALPHA)) ** -ALPHA


class Hyper:
    """The numbers of the covariance: logarithms of lengths, of s^2, and of the noise's variance as
    constant and slopes."""

    def __init__(self, inputs, variance):
        self.x = np.concatenate([np.full(inputs, np.log(2.0)), [np.log(variance)],
                                 [np.log(0.01 * variance)], np.zeros(inputs)])
        self.inputs = inputs

    @property
    def lengths(self):
        return np.exp(self.x[: self.inputs])

    @property
    def scale(self):
        return np.exp(self.x[self.inputs])

    def noise(self, z):
        return np.exp(self.x[self.inputs + 1] + z @ self.x[self.inputs + 2 :])

    def bound(self, variance):
        n = self.inputs
        self.x[:n] = np.clip(self.x[:n], *np.log(LENGTHS))
        self.x[n + 1] = max(self.x[n + 1], np.log(1e-7 * variance))
        self.x[n + 2 :] = np.clip(self.x[n + 2 :], -4, 4)


def projected(K, T):
    """Q of the file's head."""
    C = np.linalg.inv(K)
    CT = C @ T
    return C - CT @ np.linalg.solve(T.T @ CT, CT.T)


def gradient(hyper, z, y, T):
    n = hyper.inputs
    lengths, scale, noise = hyper.lengths, hyper.scale, hyper.noise(z)
    k = scale * covariance(z, z, lengths)
    Q = projected(k + np.diag(noise), T)
    w = Q @ y
    W = Q - np.outer(w, w)
    base = W * k
    slope = base * ALPHA / (ALPHA + distances(z, z, lengths) / 2)
    out = np.empty_like(hyper.x)
    total = slope.sum(1)
    for i in range(n):
        v = z[:, i]
        out[i] = (2 * (v * v) @ total - 2 * v @ (slope @ v)) / (2 * lengths[i] ** 2)
    out[n] = base.sum() / 2
    d = np.diag(W) * noise / 2
    out[n + 1] = d.sum()
    out[n + 2 :] = d @ z
    return out


def learn(z, y, T, variance, rounds):
    """Resilient steps along the signs of the gradient (Riedmiller and Braun, 1993): they need no
    likelihood, only its gradient."""
    hyper = Hyper(z.shape[1], variance)
    step, last = np.full(len(hyper.x), 0.2), np.zeros(len(hyper.x))
    for _ in range(rounds):
        g = gradient(hyper, z, y, T)
        same = g * last
        step = np.clip(np.where(same > 0, step * 1.2, np.where(same < 0, step * 0.5, step)), 1e-4, 0.5)
        last = np.where(same < 0, 0, g)
        hyper.x -= np.sign(last) * step
        hyper.bound(variance)
    return hyper


class Kriging:
    """Fitted to rows z [n, inputs], y [n] with trend columns T [n, terms]."""

    def __init__(self, z, y, T, seed, rounds=ROUNDS, learn_rows=900):
        rest = y - T @ np.linalg.lstsq(T, y, rcond=None)[0]
        variance = max(float(np.mean(rest**2)), 1e-12)
        rows = np.random.default_rng(seed).permutation(len(y))[:learn_rows]
        self.z = z
        self.hyper = hyper = learn(z[rows], y[rows], T[rows], variance, rounds)
        k = hyper.scale * covariance(z, z, hyper.lengths)
        K = k + np.diag(hyper.noise(z))
        Q = projected(K, T)
        self.weights = Q @ y
        left = y - k @ self.weights - hyper.noise(z) * self.weights
        self.theta = np.linalg.lstsq(T, left, rcond=None)[0]
        self.weights = self.weights * hyper.scale
        self.left_out = self.weights / hyper.scale / np.diag(Q)
        self.left_out_sd = 1 / np.sqrt(np.diag(Q))

    def predict(self, z, T):
        return T @ self.theta + covariance(z, self.z, self.hyper.lengths) @ self.weights
