# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual page and the program say the same: commands, options, limits, result columns."""
import os
import re

import cli
from cli import GOOD, HEADER, run

with open(os.path.join(os.path.dirname(__file__), "../../docs/man/ischia.1")) as file:
    MANUAL = file.read().replace("\\-", "-").replace("\\fI", "").replace("\\fR", "")


class Manual(cli.Case):
    def commands(self):
        listed = re.findall(r"^  ([a-z-]+)  ", run("help").stdout.decode(), re.MULTILINE)
        self.assertIn("solve", listed)
        return listed

    def test_commands_and_options(self):
        for command in self.commands():
            with self.subTest(command):
                self.assertIn("ischia " + command, MANUAL)
                if command in ("help", "study"):  # study's own commands: docs/STUDIES.md
                    continue
                options = re.findall(r"^\s+(?:-[a-z], )?(--[a-z-]+)",
                                     run(command, "--help").stdout.decode(), re.MULTILINE)
                self.assertIn("--help", options)
                for option in options[:-1]:
                    if option == "--output" and command == "export":
                        option = "-o"
                    self.assertIn(option, MANUAL)

    def test_limits(self):
        lines = run("solve", stdin="{}").stderr.decode().splitlines()
        self.assertEqual(len(lines), len(GOOD))
        for line in lines:
            key, low, high, unit = re.search(
                r"(\w+) is missing; accepted ([\d.]+) to ([\d.]+) (\w+)$", line).groups()
            self.assertIn("\n%s\t%s\t%s to %s\t" % (key, unit, low, high), MANUAL)

    def test_keys(self):
        line = run("solve", stdin='{"zzzzzzzz":0}').stderr.decode().splitlines()[0]
        for key in line.split("known: ")[1].split(", ")[len(GOOD):]:
            self.assertRegex(MANUAL, r"\.(B|BR) %s\b" % key)

    def test_result_columns(self):
        header = run("cohort", stdin=HEADER).stdout.decode().strip()
        for column in header[len(HEADER) + 1:].split(","):
            self.assertRegex(MANUAL, r"\.BR %s\b" % column)


if __name__ == "__main__":
    cli.main()
