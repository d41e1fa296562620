#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Turns the numbered migrations into a C table: embed.py OUT.c 0001_x.sql 0002_y.sql ..."""
import os
import re
import sys


def literal(text):
    lines = text.replace("\\", "\\\\").replace('"', '\\"').split("\n")
    return "\n".join('        "%s\\n"' % line for line in lines)


def main(out_path, sources):
    rows = []
    for expected, path in enumerate(sources, start=1):
        name = os.path.basename(path)
        number = re.match(r"(\d{4})_[a-z_]+\.sql$", name)
        if number is None or int(number.group(1)) != expected:
            sys.exit("%s: migrations are NNNN_name.sql, numbered 1, 2, ... without a gap" % name)
        with open(path, encoding="utf-8") as source:
            rows.append('    {%d, "%s",\n%s},\n' % (expected, name, literal(source.read())))
    with open(out_path, "w", encoding="utf-8") as out:
        out.write('#include "server/store/store_sqlite.h"\n\n')
        out.write("const struct sqlite_migration sqlite_migrations[] = {\n%s};\n" % "".join(rows))
        out.write("const int sqlite_migration_count = %d;\n" % len(rows))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
