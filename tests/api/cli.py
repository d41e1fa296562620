# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests of the program share: how it is run, and a good case."""
import os
import pty
import subprocess
import sys
import tempfile
import unittest

PROGRAM = os.environ["ISCHIA"]
UNDER = os.environ.get("ISCHIA_UNDER", "").split()  # valgrind and its options, say
GOOD = {"R1": 7.1, "R2": 22.8, "eM": 31, "eF": 10, "muM": 8, "muF": 5, "F": 258}
HEADER = "R1_mm,R2_mm,eM_mm,eF_mm,muM_kPa,muF_kPa,F_N"


def run(*arguments, stdin=b"", timeout=600, **more):
    if isinstance(stdin, str):
        stdin = stdin.encode()
    return subprocess.run([*UNDER, PROGRAM, *arguments], input=stdin, capture_output=True,
                          timeout=timeout, **more)


def on_terminal(*arguments, stdin, TERM="xterm"):
    """What a terminal is sent when both outputs go there."""
    ours, theirs = pty.openpty()
    with subprocess.Popen([PROGRAM, *arguments], stdin=subprocess.PIPE, stdout=theirs, stderr=theirs,
                          env={**os.environ, "TERM": TERM}) as program:
        os.close(theirs)
        program.stdin.write(stdin.encode())
        program.stdin.close()
        shown = b""
        try:
            while piece := os.read(ours, 65536):
                shown += piece
        except OSError:  # how Linux tells that nobody writes there any more
            pass
        os.close(ours)
        return shown.decode()


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def write(self, name, text):
        with open(self.path(name), "wb") as file:
            file.write(text if isinstance(text, bytes) else text.encode())
        return self.path(name)

    def assertEnds(self, done, status, lines=None):
        """The exit status, and how many lines stderr has: never a trace of a crash."""
        errors = done.stderr.decode()
        self.assertEqual(done.returncode, status, errors)
        if lines is not None:
            self.assertEqual(len(errors.splitlines()), lines, errors)
        for line in errors.splitlines():
            self.assertRegex(line, r"^ischia( [a-z0-9-]+)?: .")
        return errors


def main():
    unittest.main(argv=sys.argv[:1], verbosity=1)
