#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The same meshes solved by Ischia's parts and by CalculiX: displacements, force and strain.

Both solve the same discrete equations (see ccx.py), so what is left between them is CalculiX's
penalty contact, its stick slope, the size of its increments where friction slips, and the seven
digits it prints. docs/VERIFICATION.md says what was measured.

usage: test_calculix.py SOLVE_BODY [unittest arguments]
"""
import subprocess
import sys
import unittest
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).parent))
import ccx  # noqa: E402

ON_BONE, ON_X0, ON_Y0, ON_SEAT, ON_PLATE = 1, 2, 4, 8, 16
SOLVE_BODY = None
# Contact in MPa/mm: penalty and stick slope. Stiffer ones bring CalculiX nearer to the rigid seat;
# on the local model it no longer converges with those of the blocks.
BLOCK_CONTACT = (50, 20)
LOCAL_CONTACT = (1, 0.5)


class Body:
    """What solve_body printed."""

    def __init__(self, text):
        self.nodes, self.flags, self.u, self.hexes, self.tissue = [], [], [], [], []
        self.materials, self.value = [], {}
        for line in text.splitlines():
            key, *words = line.split()
            if hasattr(self, "read_" + key):
                getattr(self, "read_" + key)(words)
            else:
                self.value[key] = float(words[0])

    def read_node(self, words):
        numbers = [float(w) for w in words]
        self.nodes.append(numbers[:3])
        self.flags.append(int(words[3]))
        self.u.append(numbers[4:])

    def read_hex(self, words):
        self.tissue.append(int(words[0]))
        self.hexes.append([int(w) for w in words[1:]])

    def read_material(self, words):
        name = ("MUSCLE", "FAT", "SKIN")[int(words[0])]
        self.materials.append((name, float(words[1]), float(words[2])))

    def having(self, flag):
        return [n for n, flags in enumerate(self.flags) if flags & flag]

    def size_mm(self):
        return max(max(x) for x in self.nodes)


def seat_of(body, number, contact):
    """A fixed block far wider than the body, its upper face the seat z = 0."""
    far = 3 * body.size_mm()
    corners = [(-far, -far), (far, -far), (far, far), (-far, far)]
    first = len(body.nodes)
    nodes = [(x, y, z) for z in (-0.1 * far, 0) for x, y in corners]
    return nodes, list(range(first, first + 8)), (
        "*SURFACE, NAME=FEET_SURFACE, TYPE=NODE\nFEET\n"
        f"*SURFACE, NAME=SEAT_SURFACE\n{number}, S2\n"
        "*SURFACE INTERACTION, NAME=TOUCH\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n"
        f"{contact[0]}, 1e-9\n{friction_of(body, contact[1])}"
        "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=NODE TO SURFACE\nFEET_SURFACE, SEAT_SURFACE\n")


def friction_of(body, stick_slope):
    mu = body.value["friction"]
    return f"*FRICTION\n{mu}, {stick_slope}\n" if mu > 0 else ""


def deck_of(body, increment, contact):
    number = len(body.hexes) + 1
    seat_nodes, seat_hex, touch = seat_of(body, number, contact)
    deck = ccx.mesh(body.nodes + seat_nodes, body.hexes + [seat_hex], body.tissue + [3],
                    body.materials + [("SEAT", 10, 100)])
    moved = body.having(ON_BONE | ON_PLATE)
    feet = [n for n in body.having(ON_SEAT) if body.nodes[n][2] == 0]
    sets = {"X0": body.having(ON_X0), "Y0": body.having(ON_Y0), "FEET": feet,
            "BONE": body.having(ON_BONE), "MOVED": moved, "FIXED": seat_hex}
    deck += "".join(ccx.node_set(name, nodes) for name, nodes in sets.items() if nodes)
    boundary = "*BOUNDARY\nX0, 1\nY0, 2\nFIXED, 1, 3\n"
    boundary += "BONE, 1, 2\n" if sets["BONE"] else ""
    boundary += f"MOVED, 3, 3, {-body.value['approach']}\n"
    prints = "*NODE PRINT, NSET=MOVED, TOTALS=ONLY, FREQUENCY=100000\nRF\n" \
        "*EL PRINT, ELSET=MUSCLE, FREQUENCY=100000\nE\n"
    return deck + touch + ccx.step(boundary, increment, prints)


def green_lagrange(nodes, u):
    """Green-Lagrange strains of a hexahedron at CalculiX's 2 x 2 x 2 points: xx yy zz xy xz yz."""
    a = 1 / 3 ** 0.5
    for t in (-a, a):
        for s in (-a, a):
            for r in (-a, a):
                yield strain_at(nodes, u, (r, s, t))


SIGNS = [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1),
         (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]


def strain_at(nodes, u, xi):
    slopes = [[s[c] / 8 * product(1 + s[k] * xi[k] for k in range(3) if k != c) for c in range(3)]
              for s in SIGNS]
    jacobian = [[sum(x[i] * d[j] for x, d in zip(nodes, slopes)) for j in range(3)]
                for i in range(3)]
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


def inverse(m):
    cofactor = [[m[(j + 1) % 3][(i + 1) % 3] * m[(j + 2) % 3][(i + 2) % 3] -
                 m[(j + 1) % 3][(i + 2) % 3] * m[(j + 2) % 3][(i + 1) % 3] for j in range(3)]
                for i in range(3)]
    determinant = sum(m[0][k] * cofactor[k][0] for k in range(3))
    return [[c / determinant for c in row] for row in cofactor]


def largest_difference(a, b):
    return max(abs(x - y) for p, q in zip(a, b) for x, y in zip(p, q))


class CalculiX(unittest.TestCase):
    def compare(self, problem, increment, contact, *tolerances):
        """Tolerances: displacement over the approach, force relative, strain absolute."""
        done = subprocess.run([SOLVE_BODY, problem], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        body = Body(done.stdout)
        dat = ccx.run(deck_of(body, increment, contact))
        u = ccx.displacements(dat, len(body.nodes))
        force = -ccx.table(dat, "total force")[0][2]
        muscle = [e for e, t in enumerate(body.tissue) if t == 0]
        theirs = [row[2:] for row in ccx.table(dat, "strains")]
        ours = [e for k in muscle for e in green_lagrange([body.nodes[n] for n in body.hexes[k]],
                                                          [body.u[n] for n in body.hexes[k]])]
        self.assertEqual(len(ours), len(theirs))
        found = (largest_difference(u, body.u) / body.value["approach"],
                 abs(force / body.value["force"] - 1), largest_difference(ours, theirs))
        largest = max(abs(x) for e in ours for x in e)
        print(f"{problem}: {len(body.hexes)} elements, u differs by {found[0]:.1e} of the "
              f"approach, force by {found[1]:.1e}, strain by {found[2]:.1e} of up to {largest:.2f}")
        for value, tolerance in zip(found, tolerances, strict=True):
            self.assertLess(value, tolerance)

    def test_uniaxial_block(self):
        self.compare("uniaxial_block", 0.1, BLOCK_CONTACT, 1e-4, 1e-4, 1e-4)

    def test_frictional_block(self):
        self.compare("frictional_block", 0.025, BLOCK_CONTACT, 1e-3, 1e-3, 2e-3)

    def test_sticking_block(self):
        self.compare("sticking_block", 0.025, BLOCK_CONTACT, 1e-3, 1e-3, 2e-3)

    def test_local_model(self):
        self.compare("local_model", 0.025, LOCAL_CONTACT, 1e-3, 1e-3, 5e-3)


if __name__ == "__main__":
    SOLVE_BODY = sys.argv.pop(1)
    unittest.main()
