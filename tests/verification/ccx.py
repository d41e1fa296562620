# SPDX-License-Identifier: GPL-3.0-or-later
"""CalculiX as an independent solver: runs /usr/bin/ccx on a deck and reads what it prints.

What is to know about CalculiX here (version 2.20):
- *HYPERELASTIC, OGDEN with mu, alpha, D has the energy 2 mu/alpha^2 (sum l^alpha - 3) +
  (J - 1)^2 / D of the isochoric stretches: mu is the shear modulus, D = 2 / kappa.
- It has no mixed hexahedron. C3D8 integrates everything at 2 x 2 x 2 points, as our element does
  when the whole bulk modulus acts at the points (element.h: kappa_point = kappa), so that both
  solve the same discrete equations.
- Contact is by penalty: node-to-surface converges, surface-to-surface chatters. On the local model
  it converges with 1 MPa/mm and a stick slope of 0.5 MPa/mm, not with 5 and 2.
"""
import os
import re
import subprocess
import tempfile
from pathlib import Path

CCX = "/usr/bin/ccx"


def run(deck, timeout_s=1200):
    """The .dat text of the run; an AssertionError with CalculiX's last words when it failed."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "job.inp").write_text(deck, encoding="ascii")
        done = subprocess.run([CCX, "-i", "job"], cwd=folder, capture_output=True, text=True,
                              timeout=timeout_s, check=False,
                              env={**os.environ, "OMP_NUM_THREADS": "1"})
        assert done.returncode == 0 and "Job finished" in done.stdout, \
            "CalculiX failed:\n" + "\n".join(done.stdout.splitlines()[-15:])
        return Path(folder, "job.dat").read_text(encoding="ascii")


def table(dat, quantity, subset):
    """Rows of the last table of a quantity for a set: lists of numbers."""
    blocks = re.split(r"\n\s*\n", dat)
    heading = re.compile(rf"\s*{quantity}\b.* for set {subset}\b")
    headed = [i for i, block in enumerate(blocks) if heading.match(block)]
    assert headed, f"no table of '{quantity}' for {subset} in CalculiX's output"
    return [[float(word) for word in line.split()]
            for line in blocks[headed[-1] + 1].splitlines() if line.strip()]
