#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares docs/VALIDATION.md and its figures with what make.py writes from the kept files now.

  check.py --program build/release/server/cli/ischia
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
DOCS = HERE.parent


def pages(folder):
    """The page and its figures, by name."""
    found = {"VALIDATION.md": (folder / "VALIDATION.md").read_text()}
    for path in sorted((folder / "validation").glob("*.svg")):
        found[f"validation/{path.name}"] = path.read_text()
    return found


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("--program", required=True)
    a = parse.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        fresh = pathlib.Path(folder)
        make = [sys.executable, str(HERE / "make.py"), "--program", a.program]
        subprocess.run([*make, "--out", str(fresh)], check=True)
        new, old = pages(fresh), pages(DOCS)
    wrong = [name for name in sorted({*new, *old}) if new.get(name) != old.get(name)]
    for name in wrong:
        print(f"docs/{name} is not what the kept result files say: run docs/validation/make.py")
    if not wrong:
        print(f"{len(new)} files are as the kept result files say")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
