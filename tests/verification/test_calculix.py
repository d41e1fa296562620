#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The same meshes solved by Ischia's parts and by CalculiX: displacements, force and strain.

The decks are those of the exporter (solver/inp.c). Both solve the same discrete equations (see
ccx.py), so what is left between them is CalculiX's penalty contact, its stick slope, the size of its
increments where friction slips, and the seven digits it prints. docs/VERIFICATION.md says what was
measured.

usage: test_calculix.py SOLVE_BODY [unittest arguments]
"""
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).parent))
import ccx  # noqa: E402

SOLVE_BODY = None


class Body:
    """What solve_body printed."""

    def __init__(self, text):
        self.nodes, self.u, self.hexes, self.tissue, self.value = [], [], [], [], {}
        for line in text.splitlines():
            key, *words = line.split()
            if hasattr(self, "read_" + key):
                getattr(self, "read_" + key)(words)
            else:
                self.value[key] = float(words[0])

    def read_node(self, words):
        numbers = [float(w) for w in words]
        self.nodes.append(numbers[:3])
        self.u.append(numbers[4:])

    def read_hex(self, words):
        self.tissue.append(int(words[0]))
        self.hexes.append([int(w) for w in words[1:]])

    def read_material(self, words):
        """The deck says it."""


def points():
    """CalculiX's 2 x 2 x 2 points of a hexahedron, in its order."""
    a = 1 / 3 ** 0.5
    return [(r, s, t) for t in (-a, a) for s in (-a, a) for r in (-a, a)]


def green_lagrange(nodes, u):
    """Green-Lagrange strains of a hexahedron at those points: xx yy zz xy xz yz."""
    for xi in points():
        yield strain_at(nodes, u, xi)


def volumes(nodes):
    """The volume that belongs to each of those points."""
    for xi in points():
        yield determinant(slopes_and_jacobian(nodes, xi)[1])


SIGNS = [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1),
         (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]


def slopes_and_jacobian(nodes, xi):
    slopes = [[s[c] / 8 * product(1 + s[k] * xi[k] for k in range(3) if k != c) for c in range(3)]
              for s in SIGNS]
    return slopes, [[sum(x[i] * d[j] for x, d in zip(nodes, slopes)) for j in range(3)]
                    for i in range(3)]


def strain_at(nodes, u, xi):
    slopes, jacobian = slopes_and_jacobian(nodes, xi)
    gradient = [[sum(v[i] * d[j] for v, d in zip(u, slopes)) for j in range(3)] for i in range(3)]
    h = multiply(gradient, inverse(jacobian))
    e = [[(h[i][j] + h[j][i] + sum(h[k][i] * h[k][j] for k in range(3))) / 2 for j in range(3)]
         for i in range(3)]
    return [e[0][0], e[1][1], e[2][2], e[0][1], e[0][2], e[1][2]]


def product(values):
    result = 1
    for v in values:
        result *= v
    return result


def multiply(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def cofactors(m):
    return [[m[(j + 1) % 3][(i + 1) % 3] * m[(j + 2) % 3][(i + 2) % 3] -
             m[(j + 1) % 3][(i + 2) % 3] * m[(j + 2) % 3][(i + 1) % 3] for j in range(3)]
            for i in range(3)]


def determinant(m):
    return sum(m[0][k] * row[0] for k, row in enumerate(cofactors(m)))


def inverse(m):
    det = determinant(m)
    return [[c / det for c in row] for row in cofactors(m)]


def largest_difference(a, b):
    return max(abs(x - y) for p, q in zip(a, b) for x, y in zip(p, q))


class CalculiX(unittest.TestCase):
    def solved_twice(self, problem):
        """Our solution, and CalculiX's output for the deck that was exported with it."""
        with tempfile.NamedTemporaryFile(suffix=".inp") as deck:
            done = subprocess.run([SOLVE_BODY, problem, deck.name], capture_output=True, text=True,
                                  check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            return Body(done.stdout), ccx.run(Path(deck.name).read_text(encoding="ascii"))

    def compare(self, problem, *tolerances):
        """Tolerances: displacement over the approach, force relative, strain absolute."""
        body, dat = self.solved_twice(problem)
        u = [row[1:] for row in ccx.table(dat, "displacements", "BODY")]
        force = ccx.table(dat, "total force", "SEAT")[0][2]
        theirs = sorted(ccx.table(dat, "strains", "TISSUE"))
        ours = [e for h in body.hexes for e in green_lagrange([body.nodes[n] for n in h],
                                                              [body.u[n] for n in h])]
        self.assertEqual((len(u), len(theirs)), (len(body.nodes), len(ours)))
        found = (largest_difference(u, body.u) / body.value["approach"],
                 abs(abs(force) / body.value["force"] - 1),
                 largest_difference(ours, [row[2:] for row in theirs]))
        largest = max(abs(x) for e in ours for x in e)
        print(f"{problem}: {len(body.hexes)} elements, u differs by {found[0]:.1e} of the "
              f"approach, force by {found[1]:.1e}, strain by {found[2]:.1e} of up to {largest:.2f}")
        for value, tolerance in zip(found, tolerances, strict=True):
            self.assertLess(value, tolerance)

    def test_uniaxial_block(self):
        self.compare("uniaxial_block", 1e-4, 1e-4, 1e-4)

    def test_frictional_block(self):
        self.compare("frictional_block", 1e-3, 1e-3, 2e-3)

    def test_sticking_block(self):
        self.compare("sticking_block", 1e-3, 1e-3, 2e-3)

    def test_local_model(self):
        self.compare("local_model", 1e-3, 1e-3, 5e-3)


if __name__ == "__main__":
    SOLVE_BODY = sys.argv.pop(1)
    unittest.main()
