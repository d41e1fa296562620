#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs clang-tidy, configured by .clang-tidy, over every C file that the build compiles.

usage: tidy.py BUILD_DIR [SOURCE_DIR]   (of a build by either compiler: compile_commands.json)
"""
import json
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parents[2]


def compiled_files(build, root):
    """The project's own C sources in the build; generated ones are not ours to read."""
    commands = json.loads(Path(build, "compile_commands.json").read_text(encoding="utf-8"))
    paths = {Path(build, c["file"]).resolve() for c in commands}
    return sorted(p for p in paths if root in p.parents and Path(build).resolve() not in p.parents)


def warnings_of(build, root, path):
    # gcc's own options mean nothing to clang.
    done = subprocess.run(["clang-tidy", "--quiet", "-p", build,
                           f"--config-file={HERE / '.clang-tidy'}",
                           f"--header-filter={re.escape(str(root))}/(solver|api|server|tests)/.*",
                           "--extra-arg=-Wno-unknown-warning-option",
                           "--extra-arg=-Wno-ignored-optimization-argument", path],
                          capture_output=True, text=True, check=False)
    lines = re.findall(r"^\S+:\d+:\d+: (?:warning|error): .*$", done.stdout, re.M)
    if done.returncode and not lines:
        lines = [f"{path}: clang-tidy failed: {done.stderr.strip()[-300:]}"]
    return lines


def main(build, root=HERE):
    root = Path(root).resolve()
    files = compiled_files(build, root)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(lambda p: warnings_of(build, root, p), files))
    found = sorted({line for lines in results for line in lines})
    print("\n".join(found))
    print(f"{len(files)} files, {len(found)} warnings")
    return 1 if found or not files else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
