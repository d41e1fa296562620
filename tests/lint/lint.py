#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the lint rules over the tree and reports each as one TAP test.

usage: lint.py [ROOT [RULE...]]
"""
import sys
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).parent))
from rules import RULES  # noqa: E402
from source import Tree  # noqa: E402


def main(root, wanted):
    tree = Tree(root)
    rules = [r for r in RULES if not wanted or r.__name__ in wanted]
    print(f"1..{len(rules)}")
    failed = False
    for number, rule in enumerate(rules, 1):
        findings = list(rule(tree))
        failed = failed or bool(findings)
        print(f"{'not ok' if findings else 'ok'} {number} - {rule.__name__}")
        for f in findings:
            print(f"# {f.path}:{f.line}: {f.text}")
    return 1 if failed or not rules else 0


if __name__ == "__main__":
    HERE = Path(__file__).resolve().parents[2]
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else HERE, sys.argv[2:]))
