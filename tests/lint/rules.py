# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules: each takes a Tree and yields Findings. Their names are the test names."""
import re
import subprocess
from pathlib import PurePosixPath

import layers
from source import Finding, Nesting, ROOMS, line_of
from words_rules import WORDS_RULES

FUNCTION_LINES_MAX = 100
FUNCTION_LINES_P90 = 40
FILE_LINES_MAX = 800
COLUMNS_MAX = {".c": 100, ".h": 100, ".sh": 100, ".py": 120, "meson.build": 120}
NESTING_MAX = 3
NESTING_MAX_IN_TESTS = 4
EXCEPTIONS = "tests/lint/exceptions.txt"

RULES = []


def rule(function):
    RULES.append(function)
    return function


def matches(tree, files, pattern, read):
    """(path, line number, match) for each match of pattern in read(path)."""
    for path in files:
        text = read(path)
        for match in re.finditer(pattern, text, re.M):
            yield path, line_of(text, match.start()), match


def exceptions(tree, rule_name):
    """Names this rule leaves alone: lines `rule path:name  # reason` of the exceptions file."""
    if EXCEPTIONS not in tree.files:
        return set()
    rows = (line.split("#")[0].split() for line in tree.lines(EXCEPTIONS))
    return {row[1] for row in rows if len(row) == 2 and row[0] == rule_name}


def permits(allowed, header):
    folder, *barred = allowed.split("!")
    if not allowed.endswith("/"):
        return header == allowed
    return header.startswith(folder) and not any(header.startswith(folder + b) for b in barred)


@rule
def rooms_include_only_what_the_layer_table_allows(tree):
    for path, line, found in matches(tree, tree.c_files(), r'^\s*#\s*include\s+"([^"]+)"',
                                     tree.text):
        row = next((allowed for prefix, allowed in layers.ROOMS if path.startswith(prefix)), None)
        if row is not None and not any(permits(allowed, found[1]) for allowed in row):
            yield Finding(path, line, f"may not include {found[1]} (tests/lint/layers.py)")


@rule
def foreign_headers_are_seen_by_one_file(tree):
    for path, line, found in matches(tree, tree.c_files(), r"^\s*#\s*include\s+<([^>]+)>",
                                     tree.text):
        header = found[1]
        if path.startswith("tests/") or header.removesuffix(".h") in layers.SYSTEM_HEADERS:
            continue
        home = layers.home_of(header)
        if home is None or not path.startswith(home):
            where = f"belongs to {home}" if home else "is not in the table of foreign headers"
            yield Finding(path, line, f"<{header}> {where} (tests/lint/layers.py)")


@rule
def functions_are_short(tree):
    spared = exceptions(tree, "functions_are_short")
    for f in tree.functions():
        length = f.last - f.first + 1
        if length > FUNCTION_LINES_MAX and f"{f.path}:{f.name}" not in spared:
            yield Finding(f.path, f.first,
                          f"{f.name} has {length} lines, at most {FUNCTION_LINES_MAX}")


@rule
def nine_functions_in_ten_are_very_short(tree):
    spared = exceptions(tree, "functions_are_short")
    lengths = sorted(f.last - f.first + 1 for f in tree.functions()
                     if f"{f.path}:{f.name}" not in spared)
    p90 = lengths[len(lengths) * 9 // 10] if lengths else 0
    if p90 > FUNCTION_LINES_P90:
        yield Finding("solver api server tests", 0,
                      f"a tenth of the functions have {p90} lines or more, "
                      f"at most {FUNCTION_LINES_P90}")


@rule
def files_are_short(tree):
    spared = exceptions(tree, "files_are_short")
    for path in tree.named(".c", ".h", ".py", ".sh", ".js", ".ts", ".css"):
        length = len(tree.lines(path))
        if length > FILE_LINES_MAX and path not in spared:
            yield Finding(path, length, f"{length} lines, at most {FILE_LINES_MAX}")


@rule
def lines_are_not_too_wide(tree):
    for suffix, columns in COLUMNS_MAX.items():
        for path in tree.named(suffix):
            for number, line in enumerate(tree.lines(path), 1):
                if len(line) > columns:
                    yield Finding(path, number, f"{len(line)} columns, at most {columns}")


@rule
def control_flow_nests_shallowly(tree):
    spared = exceptions(tree, "control_flow_nests_shallowly")
    for f in tree.functions():
        body = "\n".join(tree.code(f.path).splitlines()[f.first - 1:f.last])
        depth = Nesting(body[body.find("{") + 1:body.rfind("}")]).depth()
        limit = NESTING_MAX_IN_TESTS if f.path.startswith("tests/") else NESTING_MAX
        if depth > limit and f"{f.path}:{f.name}" not in spared:
            yield Finding(f.path, f.first,
                          f"{f.name} nests {depth} levels deep, at most {limit}")


@rule
def exceptions_are_still_needed(tree):
    """An exception that names nothing in the tree is a leftover."""
    known = {f"{f.path}:{f.name}" for f in tree.functions()} | set(tree.files)
    names = {r.__name__ for r in RULES}
    for number, line in enumerate(tree.lines(EXCEPTIONS) if EXCEPTIONS in tree.files else [], 1):
        row, _, reason = line.partition("#")
        words = row.split()
        if not words:
            continue
        if len(words) != 2 or words[0] not in names or words[1] not in known or not reason.strip():
            yield Finding(EXCEPTIONS, number, "names no rule, no function or file, or no reason")


@rule
def banned_calls_are_absent(tree):
    names = "|".join(layers.BANNED_CALLS)
    for path, line, found in matches(tree, tree.c_files(), rf"(?<![\w.>])({names})\s*\(",
                                     tree.code):
        yield Finding(path, line, f"{found[1]}: {layers.BANNED_CALLS[found[1]]}")


@rule
def libraries_are_quiet(tree):
    calls, streams = "|".join(layers.LOUD_CALLS), "|".join(layers.LOUD_STREAMS)
    pattern = rf"(?<![\w.>])((?:{calls})(?=\s*\()|(?:{streams})\b)"
    for path, line, found in matches(tree, tree.c_files(layers.QUIET_ROOMS), pattern, tree.code):
        yield Finding(path, line, f"{found[1]}: libraries return, only programs talk")


@rule
def sources_start_with_their_licence(tree):
    for path in tree.named(".c", ".h", ".py", ".sh", ".js", ".ts", ".css", ".sql", "meson.build",
                           "run.sh", "test.sh", ".ci/run"):
        head = tree.lines(path)[:2]
        first = head[1:2] if head and head[0].startswith("#!") else head[:1]
        if not first or "SPDX-License-Identifier: GPL-3.0-or-later" not in first[0]:
            yield Finding(path, 1, "first line is not the SPDX licence line")


def prototypes(code):
    """(start, end) of each statement at file level that declares a function."""
    level = start = 0
    flat = re.sub(r"^[ \t]*#.*(?:\\\n.*)*$", lambda m: re.sub(r"[^\n]", " ", m.group()), code,
                  flags=re.M)
    for at, char in enumerate(flat):
        level += (char == "{") - (char == "}")
        if char in ";}" and level == 0:
            text = flat[start:at + 1]
            if char == ";" and is_prototype(text):
                yield start + len(text) - len(text.lstrip()), at + 1
            start = at + 1


def is_prototype(text):
    text = text.strip()
    return bool(re.search(r"\w\s*\([^*]|\w\s*\(\*?\w", text)) and "{" not in text and \
        "=" not in text and not re.match(r"(typedef|struct \w+;|union|enum\s*\{|\})", text)


@rule
def public_prototypes_carry_a_contract(tree):
    """A comment on the same line or above the block of lines that the prototype is part of, or the
    comment of the struct or enum that the block follows. What frees (x_finish, x_destroy) needs
    none: it takes what x_init or x_create made."""
    for path in tree.named(".h", rooms=("solver/", "api/", "server/")):
        text = tree.text(path)
        for start, end in prototypes(tree.code(path)):
            trailing = text[end:].split("\n", 1)[0]
            frees = re.search(r"\w+_(finish|destroy)\(", text[start:end])
            if not (frees or "/*" in trailing or commented(text[:start])):
                yield Finding(path, line_of(text, start),
                              "prototype without a comment: units, shapes, ownership, failure")


def commented(above):
    """True when the block of lines right above begins with a comment, or follows a block that
    begins with a comment and ends with the type that it describes."""
    blocks = [b.strip() for b in re.split(r"\n\n(?! )", above)]
    before = blocks[-2] if len(blocks) > 1 else ""
    return blocks[-1].startswith("/*") and "*/" in blocks[-1] or \
        before.startswith("/*") and before.endswith("};")


@rule
def no_marks_of_unfinished_work(tree):
    mark = "TO" + "DO|FIX" + "ME|X" + "XX|HA" + "CK"
    files = [f for f in tree.named(".c", ".h", ".py", ".sh", ".js", ".ts", ".css", ".sql", ".md",
                                   "meson.build")]
    for path, line, found in matches(tree, files, rf"\b({mark})\b", tree.text):
        yield Finding(path, line, f"{found[1]}: finish it or write an issue")


@rule
def no_code_is_commented_out(tree):
    for path in tree.c_files():
        text = tree.text(path)
        for comment in re.finditer(r"/\*(.*?)\*/|//([^\n]*)", text, re.S):
            inside = comment[1] if comment[1] is not None else comment[2]
            code = re.search(r"^[ *]*(?:return\b.*|\w[\w.]*(?:->|\[)\S* [-+*/]?= .*|"
                             r"\w+\(.*\));\s*$", inside, re.M)
            if code:
                yield Finding(path, line_of(text, comment.start()), "code in a comment")


@rule
def no_struct_is_typedefed(tree):
    pattern = r"\btypedef\s+(struct|union|enum)\b[^();]*[;{]"
    for path, line, _ in matches(tree, tree.c_files(), pattern, tree.code):
        yield Finding(path, line, "name the struct, union or enum itself")


@rule
def no_path_of_a_workplace(tree):
    parent = str(tree.root.resolve().parent)
    places = [str(tree.root.resolve()) + "/", "/ho" + "me/", "/ro" + "ot/"]
    if parent not in ("/", "/tmp", "/srv", "/opt", "/usr/src", "/var/tmp"):
        places.append(parent + "/")
    pattern = "|".join(rf"(?<![\w.]){re.escape(p)}\w" for p in places)
    files = [f for f in tree.files if not f.endswith((".png", ".gz", ".zst", ".woff2", ".xz"))]
    for path, line, found in matches(tree, files, pattern, tree.text):
        yield Finding(path, line, f"path of one machine: {found[0]}...")


@rule
def every_unit_test_is_registered(tree):
    table = "tests/unit/meson.build"
    registered = tree.text(table) if table in tree.files else ""
    for path in tree.named(".c", rooms=("tests/unit/",)):
        name = PurePosixPath(path).stem
        if name.startswith("test_") and f"'{name.removeprefix('test_')}'" not in registered:
            yield Finding(path, 1, f"not in the table of {table}: it never runs")


@rule
def docs_name_only_files_that_exist(tree):
    """Backquoted paths in a room, and relative links, of every Markdown file."""
    folders = {f.split("/")[0] for f in tree.files if "/" in f}
    for path in tree.named(".md"):
        text = re.sub(r"^```.*?^```", lambda m: re.sub(r"[^\n]", " ", m[0]), tree.text(path),
                      flags=re.S | re.M)
        for line, name in mentioned(text):
            target = resolve(PurePosixPath(name))
            if target.split("/")[0] in folders or "/" not in target:
                if not exists(tree, target):
                    yield Finding(path, line, f"{name} does not exist")
        for line, link in links(text):
            if not exists(tree, resolve(PurePosixPath(path).parent / link)):
                yield Finding(path, line, f"link to {link}, which does not exist")


def mentioned(text):
    """Backquoted words that read as a path: a slash in them, no pattern and no placeholder."""
    for found in re.finditer(r"`(\.?[\w.-]+(?:/[\w.-]+)+)`", text):
        if not re.search(r"NNNN|NAME|build/", found[1]):
            yield line_of(text, found.start()), found[1]


def links(text):
    for found in re.finditer(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", text):
        yield line_of(text, found.start()), found[1]


def resolve(path):
    parts = []
    for part in path.parts:
        if part == "..":
            parts = parts[:-1]
        elif part != ".":
            parts.append(part)
    return "/".join(parts)


def exists(tree, target):
    return target in tree.files or any(f.startswith(target.rstrip("/") + "/") for f in tree.files)


@rule
def sources_are_formatted(tree):
    files = tree.c_files()
    if not files:
        return
    done = subprocess.run(["clang-format", "--dry-run", *files], cwd=tree.root,
                          capture_output=True, text=True, check=True)
    seen = set()
    for path, line in re.findall(r"^(\S+?):(\d+):\d+: warning", done.stderr, re.M):
        if path not in seen:
            seen.add(path)
            yield Finding(path, int(line), "not as clang-format lays it out: clang-format -i")


@rule
def shell_scripts_stop_at_errors(tree):
    for path in tree.files:
        text = tree.text(path) if path.endswith(".sh") or path == ".ci/run" else ""
        wanted = "set -eu\n" if text.startswith("#!/bin/sh") else "set -euo pipefail\n"
        if text.startswith("#!") and wanted not in text:
            yield Finding(path, 1, f"shell script without `{wanted.strip()}`")


@rule
def foreign_headers_are_documented(tree):
    """The layer table in docs/ARCHITECTURE.md names the same homes as tests/lint/layers.py."""
    page = "docs/ARCHITECTURE.md"
    text = tree.text(page) if page in tree.files else ""
    for path, _, found in matches(tree, tree.c_files(ROOMS[:3]), r"^\s*#\s*include\s+<([^>]+)>",
                                  tree.text):
        header, home = found[1], layers.home_of(found[1])
        if home and (header.split("/")[0] not in text or home.rsplit("/", 1)[1] not in text):
            yield Finding(page, 1, f"does not say that {home} alone sees {header}")


RULES.extend(WORDS_RULES)
