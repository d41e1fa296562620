#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`ischia export --inp` solved by CalculiX against `ischia solve --vtu` of the same case.

Here both programs run as users run them. CalculiX takes the volume change at each of its eight
points, Ischia mostly as the mean of the element: two discretisations of one model on one mesh, which
differ by their errors and must come together as the mesh is refined. Row 1R of Table 2 under 40 N,
kappa/mu = 15, for CalculiX' element locks when that ratio is high.

usage: test_exported_deck.py ISCHIA RESOLUTION [unittest arguments]   RESOLUTION: coarse or standard
"""
import base64
import json
import os
import re
import struct
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).parent))
import ccx  # noqa: E402
from test_calculix import green_lagrange, volumes  # noqa: E402

ISCHIA, RESOLUTION = None, None
CASE = {"R1": 6.9, "R2": 19.7, "eM": 28, "eF": 10, "muM": 8, "muF": 5, "F": 40,
        "model": {"bulk_ratio": 15}}
# Displacement, largest and root mean square, over the seat's travel; strain, root mean square over
# the volume, over that of the strain itself: a mean over elements would weigh the rim of the bone by
# how many there are, and the mesh is finest there. The largest displacement is a node's beside that
# rim, where the strain is singular: it says less than the mean, and hardly falls with the mesh.
TOLERANCES = {"coarse": (0.07, 0.03, 0.15), "standard": (0.05, 0.015, 0.08)}
LETTER = {"Float64": "d", "Int32": "i", "UInt8": "B"}


def run(*arguments):
    done = subprocess.run([ISCHIA, *arguments], capture_output=True, text=True, check=False,
                          env={**os.environ, "OPENBLAS_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr
    return done.stdout


def array(vtu, name, components):
    """A binary array of a VTU file as rows of numbers."""
    kind, text = re.search(rf'<DataArray type="(\w+)" Name="{name}"[^>]*>([^<]*)<', vtu).groups()
    data = base64.b64decode(text.strip())
    size = struct.unpack("<Q", data[:8])[0]
    letter = LETTER[kind]
    numbers = struct.unpack(f"<{size // struct.calcsize(letter)}{letter}", data[8:8 + size])
    return [numbers[i:i + components] for i in range(0, len(numbers), components)]


def root_mean_square(rows, weights=None):
    weights = weights or [1] * len(rows)
    squares = sum(w * x * x for w, row in zip(weights, rows, strict=True) for x in row)
    return (squares / sum(weights)) ** 0.5


def differences(a, b):
    return [[x - y for x, y in zip(p, q)] for p, q in zip(a, b, strict=True)]


def strains(nodes, hexes, u):
    return [e for h in hexes for e in green_lagrange([nodes[n] for n in h], [u[n] for n in h])]


class ExportedDeck(unittest.TestCase):
    def test_calculix_finds_the_same_deformation(self):
        with tempfile.TemporaryDirectory() as folder:
            case, vtu = Path(folder, "case.json"), Path(folder, "out.vtu")
            case.write_text(json.dumps({**CASE, "resolution": RESOLUTION}), encoding="utf-8")
            result = json.loads(run("solve", str(case), "--vtu", str(vtu)))
            dat = ccx.run(run("export", "--inp", str(case)))
            text = vtu.read_text(encoding="ascii")
        self.assertTrue(result["numerics"]["converged"])
        u, hexes = array(text, "displacement", 3), array(text, "connectivity", 8)
        nodes = differences(array(text, "Points", 3), u)
        theirs = [row[1:] for row in ccx.table(dat, "displacements", "BODY")]
        travel = result["seat"]["displacement_mm"]
        apart = differences(u, theirs)
        ours_E, their_E = strains(nodes, hexes, u), strains(nodes, hexes, theirs)
        volume = [v for h in hexes for v in volumes([nodes[n] for n in h])]
        found = (max(abs(x) for row in apart for x in row) / travel,
                 root_mean_square(apart) / travel,
                 root_mean_square(differences(ours_E, their_E), volume) /
                 root_mean_square(ours_E, volume))
        print(f"{RESOLUTION}: {len(hexes)} elements, travel {travel:.2f} mm, displacements differ "
              f"by {found[0]:.2%} of it at most and {found[1]:.2%} rms, strains by {found[2]:.2%}")
        for value, tolerance in zip(found, TOLERANCES[RESOLUTION], strict=True):
            self.assertLess(value, tolerance)


if __name__ == "__main__":
    ISCHIA, RESOLUTION = sys.argv.pop(1), sys.argv.pop(1)
    unittest.main()
