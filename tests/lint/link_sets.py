#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks what each program loads: a numerical crash cannot reach the daemon, HTTP not the numbers.

`ldd` gives every library that a program pulls in, directly or through another; the sanitizers' own
libraries are not on the lists. The dynamic symbols are looked at too, in case one is linked in
statically under another name.

usage: link_sets.py PROGRAM...
"""
import subprocess
import sys
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).parent))
from layers import NEVER_LINKED  # noqa: E402

# A symbol that each library cannot do without.
SYMBOLS = {"libcholmod": "cholmod_start", "libopenblas": "dgemm_", "libmicrohttpd":
           "MHD_start_daemon", "libsqlite3": "sqlite3_open_v2", "libpq": "PQconnectdb"}


def output(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def faults(program, barred):
    libraries = {line.split()[0] for line in output("ldd", program).splitlines() if line.split()}
    symbols = {line.split()[-1].split("@")[0]
               for line in output("readelf", "--symbols", "--wide", program).splitlines()
               if line.split()}
    loaded = [lib for lib in libraries if lib.startswith(tuple(barred))]
    built_in = [SYMBOLS[b] for b in barred if SYMBOLS.get(b) in symbols]
    return [f"{program} loads {lib}" for lib in loaded] + \
        [f"{program} contains {symbol}" for symbol in built_in]


def main(programs):
    if not programs:
        print("no program to look at")
        return 1
    found = []
    for program in programs:
        barred = NEVER_LINKED[Path(program).name]
        found += faults(program, barred)
        print(f"{program}: none of {', '.join(barred)} wanted")
    print("\n".join(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
