#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/HAZARDS.md: each hazard has a control and tests, and each test that it names exists and is
run. TAP, one test a hazard.

usage: hazards.py [ROOT]
"""
import re
import sys
from pathlib import Path

WORDS = {"severity": {"high", "medium", "low"}, "left over": {"rare", "unlikely", "possible"}}
COLUMNS = ["", "hazard", "what happens", "severity", "control", "left over", "tests"]


def rows(page):
    """One dict a hazard, by the words of the table's head."""
    table = [line for line in page.splitlines() if line.startswith("|")]
    head, _, *lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    if head != COLUMNS:
        sys.exit(f"the table's head is {head}, not {COLUMNS}")
    return [dict(zip(COLUMNS, line)) for line in lines]


def named_tests(cell):
    """(file, name) of "`file`: name; `file`: name"."""
    parts = re.split(r";\s+(?=`)", cell)
    found = [re.fullmatch(r"`(tests/[\w/.]+)`: (.+)", part) for part in parts]
    return [(m[1], m[2]) if m else (part, None) for m, part in zip(found, parts)]


def is_run(root, path):
    """Does a meson.build, or the browser's runner, know the file?"""
    folder = (root / path).parent
    stem = Path(path).stem.removesuffix(".test")
    known = "".join(f.read_text(encoding="utf-8") for f in root.glob("tests/*/meson.build"))
    runner = folder / "run.sh"
    if runner.exists() and path.endswith(".test.mjs"):
        known += runner.read_text(encoding="utf-8")
        return Path(path).name in known or "*.test.mjs" in known or ".test.mjs" in known
    return Path(path).name in known or re.search(
        rf"'{re.escape(stem.removeprefix('test_'))}'", known) is not None


def has_test(text, path, name):
    if name == Path(path).name:
        return True
    if path.endswith(".c"):
        defined = f"static void {name}(void **state)" in text
        return defined and len(re.findall(rf"\b{re.escape(name)}\b", text)) > 1
    if path.endswith(".mjs"):
        return f"test('{name}'" in text
    if f"def {name}(" not in text:
        return False
    return name.startswith("test_") or text.count(name) > 1  # a step is listed as well


def faults(root, row):
    for column, words in WORDS.items():
        if row[column] not in words:
            yield f"{column} is '{row[column]}', one of {sorted(words)} is wanted"
    if len(row["control"]) < 20:
        yield "no control"
    for path, name in named_tests(row["tests"]):
        file = root / path
        if name is None:
            yield f"cannot read '{path}': `tests/file`: name"
        elif not file.is_file():
            yield f"{path} does not exist"
        elif not has_test(file.read_text(encoding="utf-8"), path, name):
            yield f"{path} has no test '{name}'"
        elif not is_run(root, path):
            yield f"nothing runs {path}"


def main(root):
    hazards = rows((root / "docs/HAZARDS.md").read_text(encoding="utf-8"))
    print(f"1..{len(hazards)}")
    bad = False
    for number, row in enumerate(hazards, 1):
        found = list(faults(root, row))
        if row[""] != f"H{number}":
            found.append(f"is numbered {row['']}, not H{number}")
        bad = bad or bool(found)
        print(f"{'not ok' if found else 'ok'} {number} - {row['hazard']}")
        for fault in found:
            print(f"# {row['']}: {fault}")
    return 1 if bad or not hazards else 0


if __name__ == "__main__":
    HERE = Path(__file__).resolve().parents[2]
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE))
