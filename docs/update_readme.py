#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the commands of README.md's console blocks and writes their output below them.

With --check nothing is written: each block's words must be those of a fresh run, and its numbers
equal to a relative 1e-3 (another processor may round differently). Times (`1.2 s`) are left out.

usage: update_readme.py [--check]
"""
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
BLOCK = re.compile(r"(?<=^```console\n).*?(?=^```$)", re.S | re.M)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
TIME = re.compile(r"\d+(?:\.\d+)? s\b")
ROUNDING = 1e-8
TOLERANCE = 1e-3
SKIPPED = 77


def run(command):
    done = subprocess.run(["bash", "-c", command], cwd=ROOT, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, check=False)
    return done.stdout


def fresh(block):
    """The block with each `$ command` followed by what it prints now."""
    commands = re.findall(r"^\$ (.*)$", block, re.M)
    return "".join(f"$ {c}\n{run(c)}" for c in commands)


def same_number(a, b):
    """Equal to TOLERANCE; below ROUNDING both are the rounding of one machine or another."""
    difference = abs(float(a) - float(b))
    return difference <= TOLERANCE * max(abs(float(a)), abs(float(b))) + ROUNDING


def agree(old, new):
    old, new = TIME.sub("T s", old), TIME.sub("T s", new)
    numbers = list(zip(NUMBER.findall(old), NUMBER.findall(new)))
    words = [re.sub(r" +", " ", NUMBER.sub("#", text)) for text in (old, new)]
    return words[0] == words[1] and all(same_number(a, b) for a, b in numbers)


def main(check):
    text = README.read_text(encoding="utf-8")
    if not check:
        README.write_text(BLOCK.sub(lambda m: fresh(m[0]), text), encoding="utf-8")
        return 0
    blocks = BLOCK.findall(text)
    if any(not re.sub(r"^\$ .*\n", "", block, flags=re.M) for block in blocks):
        print("README.md has a command without its output: run docs/update_readme.py")
        return SKIPPED
    stale = [(b, now) for b, now in ((b, fresh(b)) for b in blocks) if not agree(b, now)]
    for block, now in stale:
        print(f"README says:\n{block}\nnow it is:\n{now}\nrun docs/update_readme.py\n")
    print(f"{len(blocks) - len(stale)} passed, {len(stale)} failed, 0 skipped")
    return 1 if stale or not blocks else 0


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
