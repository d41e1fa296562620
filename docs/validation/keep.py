#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps a result file for docs/VALIDATION.md: compressed in docs/validation/data, with where it
came from in manifest.json beside it. Python's standard library only.

  keep.py NAME RESULT.csv --program ischia --command "ischia study factorial ..." [--title WORDS]
"""

import argparse
import datetime
import gzip
import hashlib
import json
import os
import pathlib
import platform
import subprocess

DATA = pathlib.Path(__file__).resolve().parent / "data"


def machine():
    """The kind of machine, not which one."""
    words = platform.machine()
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            words = line.split(":", 1)[1].strip()
            break
    try:
        system = platform.freedesktop_os_release().get("PRETTY_NAME", "")
    except OSError:
        system = platform.system()
    return f"{words}, {os.cpu_count()} processors, {system}"


def version_of(program):
    """Program and model, as the manifest has them."""
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    return ", ".join(said.stdout.splitlines()[:2])


def keep(name, result, program, command, title, data=DATA):
    text = pathlib.Path(result).read_bytes()
    data.mkdir(parents=True, exist_ok=True)
    # mtime 0: the same results give the same bytes in the repository
    with open(data / f"{name}.csv.gz", "wb") as out:
        with gzip.GzipFile(
            filename="", fileobj=out, mode="wb", compresslevel=9, mtime=0
        ) as packed:
            packed.write(text)
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    lines = said.stdout.splitlines()
    manifest_path = data / "manifest.json"
    manifest = json.loads(manifest_path.read_text()) if manifest_path.exists() else {}
    manifest[name] = {
        "title": title or name,
        "rows": text.count(b"\n") - 1,
        "sha256": hashlib.sha256(text).hexdigest(),
        "version": version_of(program),
        "libraries": ", ".join(lines[2:]),
        "command": command,
        "machine": machine(),
        "date": datetime.date.today().isoformat(),
    }
    manifest_path.write_text(json.dumps(dict(sorted(manifest.items())), indent=2) + "\n")


def main():
    parse = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parse.add_argument("name")
    parse.add_argument("result")
    parse.add_argument("--program", required=True)
    parse.add_argument("--command", required=True)
    parse.add_argument("--title")
    parse.add_argument("--data", type=pathlib.Path, default=DATA)
    a = parse.parse_args()
    keep(a.name, a.result, a.program, a.command, a.title, a.data)


if __name__ == "__main__":
    main()
