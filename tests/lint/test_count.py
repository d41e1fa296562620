#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The counts that ./test.sh ends with, from logs written as meson writes them."""
import json
import subprocess
import tempfile
import unittest
from pathlib import Path

COUNT = Path(__file__).resolve().parents[1] / "count.py"
CMOCKA = """[==========] Running 3 test(s).
[ RUN      ] one
[       OK ] one
[ RUN      ] two
[  FAILED  ] two
[ RUN      ] three
[  SKIPPED ] three
[==========] 3 test(s) run.
[  PASSED  ] 1 test(s).
[  FAILED  ] 1 test(s), listed below:
[  FAILED  ] two
"""


def test(result="OK", stdout="", stderr="", name="a"):
    return {"name": name, "result": result, "stdout": stdout, "stderr": stderr}


class Count(unittest.TestCase):
    def closing(self, *tests):
        with tempfile.NamedTemporaryFile("w", suffix=".json") as log:
            log.write("".join(json.dumps(t) + "\n" for t in tests))
            log.flush()
            done = subprocess.run([COUNT, log.name], capture_output=True, text=True, check=False)
        return done.stdout.splitlines(), done.returncode

    def check(self, tests, line, status):
        lines, returned = self.closing(*tests)
        self.assertEqual((lines[-1], returned), (line, status))

    def test_a_program_that_says_nothing_is_one_test(self):
        self.check([test(), test("SKIP"), test("FAIL"), test("TIMEOUT")],
                   "1 passed, 2 failed, 1 skipped", 1)

    def test_tap(self):
        self.check([test(stdout="1..3\nok 1 - a\nok 2 - b # SKIP no root\nok 3 - c\n")],
                   "2 passed, 0 failed, 1 skipped", 0)
        self.check([test("FAIL", "1..2\nok 1 - a\nnot ok 2 - b\n")],
                   "1 passed, 1 failed, 0 skipped", 1)

    def test_cmocka_counts_a_failure_once(self):
        self.check([test("FAIL", stderr=CMOCKA)], "1 passed, 1 failed, 1 skipped", 1)

    def test_a_crash_in_the_middle_is_a_failure(self):
        self.check([test("FAIL", stderr="[ RUN      ] one\n[       OK ] one\n[ RUN      ] two\n")],
                   "1 passed, 1 failed, 0 skipped", 1)

    def test_a_failure_after_all_cases_passed_is_a_failure(self):
        self.check([test("FAIL", stderr="[ RUN      ] one\n[       OK ] one\nleak\n")],
                   "1 passed, 1 failed, 0 skipped", 1)

    def test_unittest(self):
        text = "Ran 9 tests in 0.2s\n\nFAILED (failures=1, errors=2, skipped=3)\n"
        self.check([test("FAIL", stderr=text)], "3 passed, 3 failed, 3 skipped", 1)
        self.check([test("FAIL", stderr="Ran 2 tests in 0.2s\n\nFAILED (failures=5)\n")],
                   "0 passed, 2 failed, 0 skipped", 1)
        self.check([test(stderr="Ran 1 test in 0.2s\n\nOK\n")], "1 passed, 0 failed, 0 skipped", 0)

    def test_a_closing_line_of_our_own_form(self):
        self.check([test(stdout="5 passed, 0 failed, 2 skipped\n")],
                   "5 passed, 0 failed, 2 skipped", 0)

    def test_a_skip_gives_its_reason(self):
        lines, _ = self.closing(test(), test("SKIP", "needs a network namespace\n", name="net"))
        self.assertIn("skipped: net: needs a network namespace", lines)

    def test_a_failure_repeats_the_last_it_said(self):
        said = "".join(f"line {i}\n" for i in range(100))
        lines, _ = self.closing(test(), test("FAIL", said, name="kill"))
        self.assertEqual(lines[0], "failed: kill")
        self.assertIn("    line 99", lines)
        self.assertNotIn("    line 50", lines)

    def test_nothing_ran_is_a_failure(self):
        self.check([], "0 passed, 0 failed, 0 skipped", 1)


if __name__ == "__main__":
    unittest.main()
