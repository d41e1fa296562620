#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes every result file that docs/VALIDATION.md is written from, keeps it, and writes the page.

  run.py --program build/release/server/cli/ischia --work DIR [-j N] [--only NAME,...] [--list]

Resumable: run it again after a stop, and it goes on where it was (the 26 solves of a cohort start
anew). A file that is kept already and was made by this version of the program is not made again.
Python's standard library only.
"""

import argparse
import json
import pathlib
import subprocess
import sys

import keep
import readings
import runs

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent


def is_kept(name, program, data):
    """True when the file is there and its maker was this version."""
    path = data / "manifest.json"
    manifest = json.loads(path.read_text()) if path.exists() else {}
    return manifest.get(name, {}).get("version") == keep.version_of(program)


def make(run, a):
    """One run of runs.RUNS: solves, and keeps."""
    out = a.work / f"{run.name}.csv"
    jobs = ["-j", str(a.jobs)] if a.jobs else []
    command = [a.program, *run.words, "-o", str(out), *jobs]
    print(f"{run.name}: {run.command()}", file=sys.stderr)
    done = subprocess.run(command, cwd=ROOT, check=False)
    if done.returncode not in (0, 1):  # 1: rows without a result, which the page lists
        sys.exit(f"run.py: {run.name} could not be made")
    keep.keep(run.name, out, a.program, run.command(), run.title, a.data)


def make_readings(a, key, subset):
    """The readings of one subset that are not kept, by readings.py."""
    missing = [n for n in subset.names if not is_kept(f"{subset.prefix}_{n}", a.program, a.data)]
    if not missing:
        return
    command = [sys.executable, str(HERE / "readings.py"), "--program", a.program, "--keep"]
    command += ["--subset", key, "--work", str(a.work / f"readings_{key}"), "--data", str(a.data)]
    command += ["--only", ",".join(missing), *(["-j", str(a.jobs)] if a.jobs else [])]
    subprocess.run(command, check=True)


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("--program", required=True)
    parse.add_argument("--work", type=pathlib.Path, required=True)
    parse.add_argument("-j", "--jobs", type=int)
    parse.add_argument("--only", default="", help="names, with commas between; readings: all those")
    parse.add_argument("--list", action="store_true", help="say what there is to run, and stop")
    parse.add_argument("--data", type=pathlib.Path, default=keep.DATA)
    parse.add_argument("--out", type=pathlib.Path, default=ROOT / "docs")
    a = parse.parse_args()
    a.program = str(pathlib.Path(a.program).resolve())
    wanted = a.only.split(",") if a.only else [*(r.name for r in runs.RUNS), "readings"]
    for run in runs.RUNS:
        if run.name not in wanted:
            continue
        kept = is_kept(run.name, a.program, a.data)
        if a.list:
            print(f"{run.name:22} {'kept' if kept else 'to do':6} {run.command()}")
        elif not kept:
            a.work.mkdir(parents=True, exist_ok=True)
            make(run, a)
    if a.list:
        return
    if "readings" in wanted:
        for key, subset in readings.SUBSETS.items():
            make_readings(a, key, subset)
    page = [sys.executable, str(HERE / "make.py"), "--program", a.program]
    subprocess.run([*page, "--data", str(a.data), "--out", str(a.out)], check=True)


if __name__ == "__main__":
    main()
