# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the tree for the lint rules: its files, C text without comments and strings, functions."""
import json
import re
import shutil
import subprocess
from collections import namedtuple
from functools import lru_cache
from pathlib import Path

Finding = namedtuple("Finding", "path line text")
Function = namedtuple("Function", "path name first last")

GENERATED = ("build", "node_modules", "dist", "__pycache__")
ROOMS = ("solver/", "api/", "server/", "tests/")


class Tree:
    """The tracked and new files below root that are not ignored, as relative POSIX paths."""

    def __init__(self, root):
        self.root = Path(root)
        self.files = sorted(self._git() or self._walk())

    def _git(self):
        if shutil.which("git") is None:
            return []
        done = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard"],
                              cwd=self.root, capture_output=True, text=True, check=False)
        here = [f for f in done.stdout.splitlines() if (self.root / f).is_file()]
        return here if done.returncode == 0 else []

    def _walk(self):
        paths = (p for p in self.root.rglob("*") if p.is_file())
        relative = (p.relative_to(self.root) for p in paths)
        return [r.as_posix() for r in relative
                if not any(part.startswith(GENERATED + (".git",)) for part in r.parts)]

    def named(self, *suffixes, rooms=("",)):
        return [f for f in self.files if f.endswith(suffixes) and f.startswith(tuple(rooms))]

    def c_files(self, rooms=ROOMS):
        return self.named(".c", ".h", rooms=rooms)

    def text(self, path):
        return _read(self.root / path)

    def lines(self, path):
        return self.text(path).splitlines()

    def code(self, path):
        return without_comments(self.text(path))

    def functions(self):
        """Every C function with its first and last line, by ctags."""
        files = self.named(".c", rooms=ROOMS)
        if not files:
            return []
        done = subprocess.run(["ctags", "--languages=C", "--kinds-C=f", "--fields=+ne",
                               "--output-format=json", "-L", "-"], cwd=self.root,
                              input="\n".join(files), capture_output=True, text=True, check=True)
        tags = (json.loads(line) for line in done.stdout.splitlines())
        return [Function(t["path"], t["name"], t["line"], t.get("end", t["line"])) for t in tags]


@lru_cache(maxsize=None)
def _read(path):
    return path.read_text(encoding="utf-8", errors="replace")


_COMMENT_OR_STRING = re.compile(
    r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'", re.S)


@lru_cache(maxsize=None)
def without_comments(text):
    """C text with comments and the insides of strings blanked; positions and lines stay."""

    def blank(match):
        found = match.group()
        if found[0] in "\"'":
            return found[0] + " " * (len(found) - 2) + found[0]
        return re.sub(r"[^\n]", " ", found)

    return _COMMENT_OR_STRING.sub(blank, text)


def line_of(text, position):
    return text.count("\n", 0, position) + 1


_TOKEN = re.compile(r"[A-Za-z_]\w*|[{}();:]")
_OPENERS = ("if", "for", "while", "switch")


class Nesting:
    """Walks the statements of one function body and finds how deep its control blocks nest."""

    def __init__(self, body):
        self.tokens = _TOKEN.findall(body)
        self.at = 0
        self.deepest = 0

    def depth(self):
        while self.at < len(self.tokens):
            self._statement(0)
        return self.deepest

    def _peek(self):
        return self.tokens[self.at] if self.at < len(self.tokens) else None

    def _skip_parentheses(self):
        level = 0
        while self.at < len(self.tokens):
            token = self.tokens[self.at]
            self.at += 1
            level += (token == "(") - (token == ")")
            if level == 0 and token == ")":
                return

    def _statement(self, depth):
        token = self._peek()
        self.at += 1
        self.deepest = max(self.deepest, depth)
        if token == "{":
            while self._peek() not in ("}", None):
                self._statement(depth)
            self.at += 1
        elif token in _OPENERS:
            self._controlled(token, depth)
        elif token == "do":
            self._statement(depth + 1)
            self._simple()
        elif token == "else":
            self._statement(depth)
        elif token not in (";", ":"):
            self.at -= 1
            self._simple()

    def _controlled(self, token, depth):
        self._skip_parentheses()
        self._statement(depth + 1)
        if token == "if" and self._peek() == "else":
            self.at += 1
            # `else if` continues the chain; a plain else is as deep as its if.
            self._statement(depth if self._peek() == "if" else depth + 1)

    def _simple(self):
        """An expression, declaration or label, up to its `;` or the colon of a case."""
        level = 0
        label = self._peek() in ("case", "default")
        while self.at < len(self.tokens):
            token = self.tokens[self.at]
            level += (token in "({") - (token in ")}")
            if level < 0:
                return
            self.at += 1
            if level == 0 and (token == ";" or (label and token == ":")):
                return
