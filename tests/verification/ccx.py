# SPDX-License-Identifier: GPL-3.0-or-later
"""CalculiX as an independent solver: writes decks, runs /usr/bin/ccx, reads what it prints.

What is to know about CalculiX here (version 2.20):
- *HYPERELASTIC, OGDEN with mu, alpha, D has the energy 2 mu/alpha^2 (sum l^alpha - 3) +
  (J - 1)^2 / D of the isochoric stretches: mu is the shear modulus, D = 2 / kappa.
- It has no mixed hexahedron. C3D8 integrates everything at 2 x 2 x 2 points, as our element does
  when the whole bulk modulus acts at the points (element.h: kappa_point = kappa), so that both
  solve the same discrete equations.
- Contact is by penalty: node-to-surface converges, surface-to-surface chatters.
"""
import os
import re
import subprocess
import tempfile
from pathlib import Path

CCX = "/usr/bin/ccx"
ALPHA = 5


def rows(values, per_line=8):
    values = [str(v) for v in values]
    return "\n".join(", ".join(values[i:i + per_line]) for i in range(0, len(values), per_line))


def node_set(name, nodes):
    return f"*NSET, NSET={name}\n{rows(n + 1 for n in nodes)}\n"


def material(name, mu_MPa, kappa_MPa):
    return (f"*MATERIAL, NAME={name}\n*HYPERELASTIC, OGDEN, N=1\n"
            f"{mu_MPa:.12g}, {ALPHA}, {2 / kappa_MPa:.12g}\n"
            f"*SOLID SECTION, ELSET={name}, MATERIAL={name}\n")


def mesh(nodes_mm, elements, tissue_of, materials):
    """Nodes from 1, elements from 1 in VTK order (CalculiX's C3D8 too), one set a tissue."""
    text = "*NODE, NSET=ALL\n" + "".join(
        f"{n}, {x:.14g}, {y:.14g}, {z:.14g}\n" for n, (x, y, z) in enumerate(nodes_mm, 1))
    for tissue, (name, mu, kappa) in enumerate(materials):
        members = [e for e in range(len(elements)) if tissue_of[e] == tissue]
        if not members:
            continue
        text += f"*ELEMENT, TYPE=C3D8, ELSET={name}\n" + "".join(
            f"{e + 1}, {rows([n + 1 for n in elements[e]])}\n" for e in members)
        text += material(name, mu, kappa)
    return text


def step(boundary, increment, prints, increments_max=400):
    """One static step with large displacements; boundary and prints are deck lines."""
    return (f"*STEP, NLGEOM, INC={increments_max}\n*STATIC\n{increment}, 1., 1e-6, {increment}\n"
            f"{boundary}*NODE PRINT, NSET=ALL, FREQUENCY=100000\nU\n{prints}*END STEP\n")


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


def table(dat, title):
    """Rows of the last table whose heading starts with `title`: lists of numbers."""
    blocks = re.split(r"\n\s*\n", dat)
    headed = [i for i, b in enumerate(blocks) if b.strip().startswith(title)]
    assert headed, f"no table '{title}' in CalculiX's output"
    return [[float(word) for word in line.split()]
            for line in blocks[headed[-1] + 1].splitlines() if line.strip()]


def displacements(dat, node_count):
    """[node][3] in mm of the last increment."""
    u = [None] * node_count
    for row in table(dat, "displacements"):
        if row[0] <= node_count:
            u[int(row[0]) - 1] = row[1:4]
    return u


def block(size_mm, divisions):
    """Nodes and elements of a box [0, a] x [0, b] x [0, c]."""
    (a, b, c), (n, m, p) = size_mm, divisions
    nodes = [(a * i / n, b * j / m, c * k / p)
             for k in range(p + 1) for j in range(m + 1) for i in range(n + 1)]

    def at(i, j, k):
        return (k * (m + 1) + j) * (n + 1) + i

    hexes = [[at(i, j, k), at(i + 1, j, k), at(i + 1, j + 1, k), at(i, j + 1, k),
              at(i, j, k + 1), at(i + 1, j, k + 1), at(i + 1, j + 1, k + 1), at(i, j + 1, k + 1)]
             for k in range(p) for j in range(m) for i in range(n)]
    return nodes, hexes
