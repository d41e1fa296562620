#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the list of parts (SBOM) of built programs as CycloneDX 1.5 JSON on standard output.

In it: every shared library that the programs load, by the Debian package that it comes from (ldd,
dpkg), what is bundled into the clinic page (static/dist/assets/licences.txt, the lock file), and
what built them (deploy/packages.txt, the lock file) as not part of what runs. Licences come from
deploy/packages.txt, the lock file, and Debian's copyright files. The same programs on the same
machine give the same bytes: the time is $SOURCE_DATE_EPOCH, or the commit's.

usage: sbom.py PROGRAM...
"""
import base64
import datetime
import functools
import hashlib
import json
import os
import re
import subprocess
import sys
import uuid
from pathlib import Path
from urllib.parse import quote

ROOT = Path(__file__).resolve().parents[1]
DISTRIBUTION = "debian-12"
# What Debian's copyright files call licences, where SPDX has another word.
SPDX = {"Expat": "MIT", "GPL-2": "GPL-2.0-only", "GPL-2+": "GPL-2.0-or-later",
        "GPL-3": "GPL-3.0-only", "GPL-3+": "GPL-3.0-or-later", "LGPL-2": "LGPL-2.0-only",
        "LGPL-2+": "LGPL-2.0-or-later", "LGPL-2.1": "LGPL-2.1-only",
        "LGPL-2.1+": "LGPL-2.1-or-later", "LGPL-3": "LGPL-3.0-only", "LGPL-3+": "LGPL-3.0-or-later",
        "BSD-2-clause": "BSD-2-Clause", "BSD-3-clause": "BSD-3-Clause", "BSD-3-Clause": "BSD-3-Clause",
        "zlib": "Zlib", "ISC": "ISC", "MIT": "MIT", "curl": "curl", "Apache-2.0": "Apache-2.0"}

# SPDX identifiers that packages.txt and the lock file use beside those of Debian's names.
LICENCE_IDS = {"PSF-2.0", "Artistic-2.0", "blessing", "0BSD", "BlueOak-1.0.0", "CC0-1.0", "Unlicense",
               "Python-2.0", "MIT-0", "CC-BY-4.0"}


def run(*words):
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


def listed_packages():
    """(section, package, licence) of deploy/packages.txt."""
    section = None
    for line in (ROOT / "deploy/packages.txt").read_text(encoding="utf-8").splitlines():
        if head := re.fullmatch(r"\[(\w+)\]", line):
            section = head[1]
        elif row := re.match(r"([a-z0-9][a-z0-9.+-]+)\s+# ([^:]+): ", line):
            yield section, row[1], row[2]


def spellings(path):
    """The names that a file goes by: through links, and with /usr before it or not."""
    plain = os.path.realpath(path)
    names = {path, plain, *(name.removeprefix("/usr") for name in (path, plain))}
    return names | {"/usr" + name for name in names if not name.startswith("/usr")}


def packages_of(paths):
    """{path: Debian package}. One question for all: dpkg reads its whole list for each."""
    names = {name: path for path in sorted(paths) for name in spellings(path)}
    # dpkg complains of each spelling that it does not know.
    answer = subprocess.run(["dpkg-query", "-S", *sorted(names)], capture_output=True, text=True)
    found = {}
    for line in answer.stdout.splitlines():
        owners, _, name = line.rpartition(": ")
        if name in names and not line.startswith("diversion"):
            found[names[name]] = owners.split(", ")[0]
    if missing := paths - set(found):
        raise SystemExit(f"dpkg knows no package of {', '.join(sorted(missing))}")
    return found


@functools.cache
def describe(package):
    """(name, version, architecture, source package) as dpkg has it installed; None when it is not."""
    form = "${Package}\t${Version}\t${Architecture}\t${source:Package}\t${db:Status-Status}\n"
    done = subprocess.run(["dpkg-query", "-W", "-f", form, package], capture_output=True, text=True)
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    return next((tuple(row[:4]) for row in rows if row[4] == "installed"), None)


def loaded_libraries(programs):
    """Paths of all shared libraries that the loader takes for the programs."""
    paths = set()
    for program in programs:
        for line in run("ldd", program).splitlines():
            if found := re.search(r"(?:=> )?(/\S+) \(0x", line):
                paths.add(found[1])
    return paths


def licence_by_source():
    """Licences of packages.txt by source package: a -dev package has its library's."""
    known = {}
    for _, package, licence in listed_packages():
        if about := describe(package):
            known.setdefault(about[3], licence.split(" ")[0])
    return known


def licence_of_copyright(package):
    """The licence that a machine-readable copyright file gives for most of a package."""
    path = Path(f"/usr/share/doc/{package}/copyright")
    text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
    main = re.search(r"^Files:\s*\*\s*$(?:\n.+)*?\nLicen[sc]e:[ \t]*(\S.*)$", text, re.M)
    return main[1].strip() if main else f"see /usr/share/doc/{package}/copyright"


def licence_field(text):
    text = SPDX.get(text, text)
    if re.search(r" (AND|OR) ", text):
        return [{"expression": text}]
    if re.fullmatch(r"[A-Za-z0-9.+-]+", text) and (text in SPDX.values() or text in LICENCE_IDS):
        return [{"license": {"id": text}}]
    return [{"license": {"name": text}}]


def debian_component(about, licence, scope):
    name, version, architecture, source = about
    purl = (f"pkg:deb/debian/{quote(name, safe='')}@{quote(version, safe='')}"
            f"?arch={architecture}&distro={DISTRIBUTION}")
    return {"type": "library", "bom-ref": purl, "name": name, "version": version, "scope": scope,
            "licenses": licence_field(licence), "purl": purl,
            "properties": [{"name": "debian:source", "value": source}]}


def debian_components(programs):
    licences = licence_by_source()
    parts = {}
    for package in packages_of(loaded_libraries(programs)).values():
        about = describe(package)
        licence = licences.get(about[3]) or licence_of_copyright(about[0])
        parts[about[0]] = debian_component(about, licence, "required")
    for section, package, licence in listed_packages():
        about = describe(package)
        if section == "build" and about and package not in parts:
            parts[package] = debian_component(about, licence.split(" (")[0], "excluded")
    return list(parts.values())


def bundled():
    """Names of the npm packages in the clinic page."""
    path = ROOT / "static/dist/assets/licences.txt"
    if not path.exists():
        raise SystemExit("static/dist is not built: static/build.sh")
    return set(re.findall(r"^(\S+) \S+ \([^)]+\)$", path.read_text(encoding="utf-8"), re.M))


def is_for_this_machine(entry):
    cpu = {"x86_64": "x64", "aarch64": "arm64"}.get(os.uname().machine, os.uname().machine)
    return "linux" in entry.get("os", ["linux"]) and cpu in entry.get("cpu", [cpu])


def npm_licence(path, entry):
    """The lock file's, or what the package says in the way of old packages."""
    if "license" in entry:
        return entry["license"]
    about = ROOT / "static" / path / "package.json"
    old = json.loads(about.read_text(encoding="utf-8")).get("licenses") if about.exists() else None
    return " OR ".join(one["type"] for one in old) if old else "not declared"


def npm_components():
    lock = json.loads((ROOT / "static/package-lock.json").read_text(encoding="utf-8"))
    inside = bundled()
    for path, entry in sorted(lock["packages"].items()):
        if not path or not is_for_this_machine(entry):
            continue
        name = path.rpartition("node_modules/")[2]
        purl = f"pkg:npm/{quote(name, safe='/').replace('@', '%40')}@{entry['version']}"
        component = {"type": "library", "bom-ref": f"{purl}#{path}", "name": name,
                     "version": entry["version"], "purl": purl,
                     "scope": "required" if name in inside else "excluded",
                     "licenses": licence_field(npm_licence(path, entry))}
        algorithm, _, digest = entry.get("integrity", "").partition("-")
        if algorithm == "sha512":
            component["hashes"] = [{"alg": "SHA-512", "content": base64.b64decode(digest).hex()}]
        yield component


def program_component(path):
    content = Path(path).read_bytes()
    return {"type": "application", "bom-ref": "program:" + Path(path).name, "name": Path(path).name,
            "version": version(), "scope": "required",
            "licenses": [{"license": {"id": "GPL-3.0-or-later"}}],
            "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(content).hexdigest()}]}


@functools.cache
def version():
    return re.search(r"version: '([^']+)'", (ROOT / "meson.build").read_text(encoding="utf-8"))[1]


def timestamp():
    seconds = os.environ.get("SOURCE_DATE_EPOCH")
    if seconds is None:
        done = subprocess.run(["git", "-C", str(ROOT), "log", "-1", "--format=%ct"],
                              capture_output=True, text=True)
        seconds = done.stdout.strip() or "0"
    at = datetime.datetime.fromtimestamp(int(seconds), datetime.timezone.utc)
    return at.strftime("%Y-%m-%dT%H:%M:%SZ")


def dependencies(programs, components):
    """Each program needs what the loader takes for it; the daemon holds the page as well."""
    npm = [c["bom-ref"] for c in components if c["scope"] == "required" and "npm/" in c["bom-ref"]]
    by_name = {c["name"]: c["bom-ref"] for c in components}
    rows = []
    for program in programs:
        packages = {describe(p)[0] for p in packages_of(loaded_libraries([program])).values()}
        needs = sorted(by_name[name] for name in packages)
        if Path(program).name == "ischiad":
            needs += npm
        rows.append({"ref": "program:" + Path(program).name, "dependsOn": needs})
    rows.append({"ref": "ischia-project",
                 "dependsOn": ["program:" + Path(program).name for program in programs]})
    return rows


def main(programs):
    components = [program_component(p) for p in programs]
    components += sorted(debian_components(programs), key=lambda c: c["bom-ref"])
    components += npm_components()
    bom = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "timestamp": timestamp(),
            "component": {"type": "application", "bom-ref": "ischia-project", "name": "ischia",
                          "version": version(),
                          "licenses": [{"license": {"id": "GPL-3.0-or-later"}}]},
        },
        "components": components,
        "dependencies": dependencies(programs, components),
    }
    content = json.dumps(bom, sort_keys=True)
    bom["serialNumber"] = "urn:uuid:" + str(uuid.uuid5(uuid.NAMESPACE_OID, content))
    json.dump(bom, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__.strip().splitlines()[-1])
    main(sys.argv[1:])
