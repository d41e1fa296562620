#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Turns the numbered migrations of both engines into a C table: embed.py OUT.c FILE...

The files are sqlite/NNNN_name.sql and postgresql/NNNN_name.sql, the same names in both."""
import os
import re
import sys


def literal(text):
    lines = text.replace("\\", "\\\\").replace('"', '\\"').split("\n")
    return "\n".join('        "%s\\n"' % line for line in lines)


def names_of(sources, engine):
    mine = [path for path in sources if os.path.basename(os.path.dirname(path)) == engine]
    for expected, path in enumerate(mine, start=1):
        number = re.match(r"(\d{4})_[a-z_]+\.sql$", os.path.basename(path))
        if number is None or int(number.group(1)) != expected:
            sys.exit("%s: migrations are NNNN_name.sql, numbered 1, 2, ... without a gap" % path)
    return mine


def read(path):
    with open(path, encoding="utf-8") as source:
        return literal(source.read())


def main(out_path, sources):
    pairs = list(zip(names_of(sources, "sqlite"), names_of(sources, "postgresql"), strict=True))
    rows = []
    for number, pair in enumerate(pairs, start=1):
        name = os.path.basename(pair[0])
        if os.path.basename(pair[1]) != name:
            sys.exit("%s has no namesake for the other engine" % name)
        rows.append('    {%d, "%s",\n%s,\n%s},\n' % (number, name, read(pair[0]), read(pair[1])))
    with open(out_path, "w", encoding="utf-8") as out:
        out.write('#include "server/store/engine.h"\n\n')
        out.write("const struct migration store_migrations[] = {\n%s};\n" % "".join(rows))
        out.write("const int store_migration_count = %d;\n" % len(rows))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
