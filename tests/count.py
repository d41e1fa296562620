#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums the tests in meson's JSON logs and prints `N passed, N failed, N skipped` last.

A program that reports its own cases is counted case by case: TAP, cmocka, Python's unittest, or a
last line of the form printed here. Any other program is one test. A program that meson calls failed
always adds at least one failure, whatever it printed.

usage: count.py LOG.json...   exit status 1 when anything failed or nothing ran
"""
import json
import re
import sys
from collections import namedtuple

Count = namedtuple("Count", "passed failed skipped")
GOOD = {"OK", "EXPECTEDFAIL"}
LAST_LINES = 25  # of what a failed test said, repeated at the end


def add(a, b):
    return Count(*(x + y for x, y in zip(a, b)))


def tap(text):
    """ok, not ok and `# SKIP` lines, when there is a plan."""
    if not re.search(r"^1\.\.\d+", text, re.M):
        return None
    lines = re.findall(r"^(not )?ok\b([^\n]*)", text, re.M)
    skipped = sum("# SKIP" in rest for _, rest in lines)
    failed = sum(bool(bad) and "# SKIP" not in rest for bad, rest in lines)
    return Count(len(lines) - failed - skipped, failed, skipped)


def cmocka(text):
    """`[ RUN      ] name` once a test, then how it ended."""
    if "[ RUN      ]" not in text:
        return None
    ends = {word: len(re.findall(rf"^\[\s*{word}\s*\] [^\d\s]\S*$", text, re.M))
            for word in ("OK", "FAILED", "SKIPPED")}
    started = text.count("[ RUN      ]")
    return Count(ends["OK"], started - ends["OK"] - ends["SKIPPED"], ends["SKIPPED"])


def unittest(text):
    """`Ran 3 tests in 0.1s` and the words after OK or FAILED."""
    ran = re.search(r"^Ran (\d+) tests? in", text, re.M)
    if not ran:
        return None
    words = dict(re.findall(r"(failures|errors|skipped|unexpected successes)=(\d+)", text))
    skipped = int(words.pop("skipped", 0))
    # Failed subtests are reported one by one but were not counted as run.
    failed = min(sum(int(n) for n in words.values()), int(ran[1]) - skipped)
    return Count(int(ran[1]) - failed - skipped, failed, skipped)


def closing_line(text):
    last = re.findall(r"^(\d+) passed, (\d+) failed, (\d+) skipped$", text, re.M)
    return Count(*map(int, last[-1])) if last else None


def whole_program(result):
    return Count(int(result in GOOD), int(result not in GOOD | {"SKIP"}), int(result == "SKIP"))


def count(test):
    text = (test.get("stdout") or "") + "\n" + (test.get("stderr") or "")
    found = next((c for c in (read(text) for read in (tap, cmocka, unittest, closing_line)) if c),
                 None)
    whole = whole_program(test["result"])
    if found is None or not sum(found):
        return whole
    return found._replace(failed=max(found.failed, whole.failed))


def failure(test):
    """Lines for people: a failed test and the last it said, so that the end of a log tells why."""
    text = "\n".join(filter(None, (test.get("stdout"), test.get("stderr"))))
    return [f"failed: {test['name']}", *("    " + line for line in text.splitlines()[-LAST_LINES:])]


def skip_reasons(test):
    """Lines for people: which test was skipped, and its own words for why."""
    text = (test.get("stdout") or "") + "\n" + (test.get("stderr") or "")
    reasons = re.findall(r"^ok\b.*# SKIP\s*(.*)$", text, re.M) or \
        re.findall(r"skipped ['\"](.*)['\"]$", text, re.M)
    if not reasons and test["result"] == "SKIP":
        reasons = [line for line in text.splitlines() if line.strip()][-1:] or ["no reason given"]
    return [f"skipped: {test['name']}: {reason}" for reason in reasons]


def main(paths):
    total = Count(0, 0, 0)
    for path in paths:
        try:
            with open(path, encoding="utf-8") as log:
                tests = [json.loads(line) for line in log]
        except FileNotFoundError:
            print(f"no log {path}: meson ran nothing there")
            tests = []
        for test in tests:
            total = add(total, count(test))
            if test["result"] not in GOOD | {"SKIP"}:
                print("\n".join(failure(test)))
            for reason in skip_reasons(test):
                print(reason)
    print(f"{total.passed} passed, {total.failed} failed, {total.skipped} skipped")
    return 1 if total.failed or not total.passed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
