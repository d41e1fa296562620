# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad input and bad usage: one clear line a fault, exit status 2, nothing on stdout."""
import json
import math
import os
import subprocess

import cli
from cli import GOOD, HEADER, PROGRAM, UNDER, run


def case(**changes):
    members = {**GOOD, **changes}
    return json.dumps({k: v for k, v in members.items() if v is not None})


class BadCase(cli.Case):
    def refuse(self, text, *words, lines=None):
        done = run("solve", stdin=text)
        errors = self.assertEnds(done, 2, lines)
        self.assertEqual(done.stdout, b"")
        for word in words:
            self.assertIn(word, errors)
        return errors

    def test_each_fault_names_field_value_and_what_is_accepted(self):
        for text, words in [
                (case(muM=80), ["muM is 80 kPa; accepted 0.5 to 30 kPa"]),
                (case(muM=-1), ["muM is -1 kPa; accepted 0.5 to 30 kPa"]),
                (case(F=0), ["F is 0 N; accepted 1 to 600 N"]),
                (case(eM=1e308), ["eM is 1e+308 mm; accepted 5 to 60 mm"]),
                (case(F=600.0001), ["F is 600.0001 N; accepted 1 to 600 N"]),
                (case(F=0.999999999), ["F is 0.999999999 N; accepted 1 to 600 N"]),
                (case(R1=9.00000001, R2=9), ["R2 is 9 mm and R1 is 9.00000001 mm"]),
                (case(eM="31"), ['eM is "31"; accepted a number from 5 to 60 mm']),
                (case(eM=[31]), ["eM is an array; accepted a number from 5 to 60 mm"]),
                (case(eM=None), ["eM is missing; accepted 5 to 60 mm"]),
                (case(R1=12, R2=9), ["R2 is 9 mm and R1 is 12 mm; accepted R2 >= R1"]),
                (case(eG=3), ["eG is not a known key; did you mean eF?"]),
                (case(side="L"), ['side is "L"; accepted left, right']),
                (case(sd={"R1": 13}), ["sd.R1 is 13", "0 to 12 mm"]),
        ]:
            with self.subTest(text):
                self.refuse(text, *words, lines=1)

    def test_not_a_number(self):
        for value in (math.nan, math.inf, -math.inf):
            with self.subTest(value):
                self.refuse(case(muM=value), "muM", "NaN and Infinity are not JSON", lines=1)

    def test_duplicates(self):
        good = case()[1:-1]
        self.refuse("{%s,\"F\":258}" % good, "F is given more than once", lines=1)
        self.refuse("{%s,\"\u03bcM\":8}" % good, "also as muM", lines=1)
        self.refuse("{%s,\"\\u00b5M\":8}" % good, "also as muM", lines=1)

    def test_all_faults_at_once(self):
        self.refuse(case(R1="7", eM=-1, F=1e9, muF=None, colour="red"), "R1", "eM", "F is", "muF",
                    "colour", lines=5)

    def test_not_a_document(self):
        for text, word in [("", "empty"), (" \n", "empty"), ("{", "expected"), ("R1=7", "expected"),
                           (case() + "x", "nothing more"), (b"{\"label\":\"\xff\"}", "UTF-8"),
                           (b"\x00" * 10, "expected"), (b"\x7fELF\x02\x01", "expected"),
                           ("[]", "an array; accepted an object"), ("[" * 1000, "16 deep"),
                           ("[" * 10_000_000, "64 KiB"), (" " * 70000, "64 KiB")]:
            with self.subTest(text[:20]):
                self.refuse(text, word, lines=1)

    def test_what_comes_in_does_not_reach_the_terminal_as_it_is(self):
        errors = self.refuse(case(**{"x\x1b[2J\x07": 1, "side": "\x1b]0;t\x07"}), lines=2)
        self.assertNotIn("\x1b", errors)
        self.assertNotIn("\x07", errors)

    def test_files(self):
        self.assertEnds(run("solve", self.folder.name), 2, 1)
        self.assertEnds(run("solve", self.path("none.json")), 2, 1)
        self.assertEnds(run("solve", self.write("empty.json", "")), 2, 1)
        self.assertEnds(run("export", "--inp", self.folder.name), 2, 1)


class BadCohort(cli.Case):
    def test_headers(self):
        for text, words in [("", ["empty"]),
                            ("\n\n", ["empty"]),
                            (HEADER.replace("F_N", "F_kN"), ["column F is missing (or F_N)"]),
                            (HEADER + ",R1", ["R1 is there more than once"]),
                            (HEADER + ",\u00b5M", ["muM is there more than once"]),
                            (HEADER + ",status", ["status is the name of a result column"]),
                            (HEADER.replace(",", ";"), ["separate columns by commas"]),
                            ("\"" + HEADER, ["quote is not closed"]),
                            (b"\xff\xfe", ["UTF-8"])]:
            with self.subTest(text):
                done = run("cohort", stdin=text)
                errors = self.assertEnds(done, 2)
                self.assertEqual(done.stdout, b"")
                for word in words:
                    self.assertIn(word, errors)

    def test_files(self):
        self.assertEnds(run("cohort", self.folder.name), 2, 1)
        self.assertEnds(run("cohort", self.path("none.csv")), 2, 1)
        path = self.write("in.csv", HEADER + "\n")
        self.assertIn("is the input", self.assertEnds(run("cohort", path, "-o", path), 2, 1))
        with open(path) as file:
            self.assertEqual(file.read(), HEADER + "\n")
        with open(path, "a") as end:  # what is appended would be read again
            done = subprocess.run([*UNDER, PROGRAM, "cohort", path], stdout=end,
                                  stderr=subprocess.PIPE, timeout=600)
        self.assertIn("standard output is the input", self.assertEnds(done, 2, 1))
        utf16 = self.write("utf16.csv", HEADER.encode("utf-16"))
        self.assertIn(utf16 + ": line 1: a NUL byte, as in UTF-16; save the file as UTF-8",
                      self.assertEnds(run("cohort", utf16), 2, 1))

    def test_rows_of_nothing_but_bad_input(self):
        rows = ["7,22,31,10,8,5", "7,22,31,10,\"8,0\",5,258", "7,22,31,10,nan,5,258",
                "7,22,31,10,,5,258", "22,7,31,10,8,5,258", "7,22,31,10,8,5,258,9", "7,\"22,31"]
        done = run("cohort", stdin="\n".join([HEADER, *rows]))
        errors = self.assertEnds(done, 2)
        for line in range(2, 9):
            self.assertIn("line %d: " % line, errors)
        output = done.stdout.decode().splitlines()
        self.assertEqual(len(output), 8)
        for line in output[1:]:
            self.assertIn(",refused,", line)


class BadOutput(cli.Case):
    """Found before anything is solved; what is there stays as it was."""

    def refuse(self, word, *arguments, status=2):
        done = run(*arguments)
        self.assertIn(word, self.assertEnds(done, status, 1))
        self.assertEqual(done.stdout, b"")

    def test_an_output_that_is_an_input(self):
        path = self.write("case.json", case())
        for arguments in (["solve", path, "--vtu", path], ["solve", path, "--svg", path],
                          ["export", "--inp", path, "-o", path]):
            self.refuse(path + " is the input", *arguments)
        link = self.path("link.json")
        os.symlink(path, link)
        self.refuse("is the input", "solve", path, "--vtu", link)
        with open(path) as file:
            self.assertEqual(file.read(), case())

    def test_two_outputs_in_one_place(self):
        path = self.write("case.json", case())
        self.refuse("--vtu and --svg both name", "solve", path, "--vtu", self.path("x"), "--svg", self.path("x"))
        for option in ("--vtu", "--svg"):
            self.refuse(option + " needs the name of a file", "solve", path, option, "-")

    def test_where_nothing_can_be_written(self):
        path = self.write("case.json", case())
        self.refuse("is a directory; give a file", "solve", path, "--vtu", self.folder.name)
        self.refuse("is a directory; give a file", "export", "--svg", path, "-o", self.folder.name)
        self.refuse("No such file or directory", "solve", path, "--svg", self.path("no/x"), status=1)


class BadMessage(cli.Case):
    def test_what_is_no_side_is_no_message(self):
        for text in ("", "garbage", "[1]", HEADER, "MSH|^~\\&|"):
            done = run("hl7", "message", stdin=text)
            self.assertIn("not JSON" if text != "[1]" else "object", self.assertEnds(done, 2, 1))
            self.assertEqual(done.stdout, b"")

    def test_every_fault_is_a_line(self):
        errors = self.assertEnds(run("hl7", "message", stdin=case(muM=80, F=None)), 2, 2)
        self.assertIn("standard input: muM is 80 kPa; accepted 0.5 to 30 kPa", errors)

    def test_options_that_a_message_cannot_carry_are_not_left_out(self):
        for option in ({"skin": {"mu": 100}}, {"model": {"friction": 0.2}}):
            done = run("hl7", "message", stdin=case(**option))
            self.assertIn("no place for single options", self.assertEnds(done, 2, 1))
            self.assertEqual(done.stdout, b"")
        self.assertIn(b"||as-published|", run("hl7", "message", stdin=case(model="as-published")).stdout)

    def test_what_is_no_message_is_not_sent(self):
        for text in ("", "garbage", HEADER):
            self.assertIn("not JSON", self.assertEnds(run("hl7", "send", "127.0.0.1:1", stdin=text), 2, 1))
        for address, word in (("x", "is not HOST:PORT"), ("127.0.0.1:70000", "not one of 0 to 65535")):
            self.assertIn(word, self.assertEnds(run("hl7", "send", address, stdin=case()), 2, 1))


class BadUsage(cli.Case):
    def test_usage(self):
        for arguments, word in [(["slove"], "did you mean solve?"), (["solve", "--vut", "x"], "--vtu"),
                                (["solve", "--vtu"], "needs a value"), (["solve", "a", "b"], "too many"),
                                (["solve", "--summary=1"], "no value"), (["cohort", "-j", "0"], "1 to 256"),
                                (["cohort", "-jx"], "1 to 256"), (["cohort", "-j", "1.5"], "1 to 256"),
                                (["export"], "one of"), (["export", "--inp", "--vtu"], "one of"),
                                (["cohort", "--resolution", "x"], "standard, fine, coarse"),
                                (["cohort", "--model", "x"], "default"),
                                (["check-tangent", "x"], "too many"), (["help", "x"], "not a command")]:
            with self.subTest(arguments):
                done = run(*arguments)
                self.assertIn(word, self.assertEnds(done, 2, 1))
                self.assertEqual(done.stdout, b"")
        self.assertIn("accepted standard, fine, coarse",
                      self.assertEnds(run("solve", "--resolution", "x", stdin=case()), 2, 1))
        self.assertEqual(run().returncode, 2)
        for other in (["foo"], ["solve", "--foo"]):
            self.assertNotIn("did you mean", self.assertEnds(run(*other), 2, 1))

    def test_help(self):
        self.assertIn(b"Usage: ischia study merge", run("help", "study", "merge").stdout)
        overview = run("help").stdout.decode()
        for command in ("solve", "cohort", "export", "check-tangent", "version"):
            with self.subTest(command):
                self.assertIn("\n  %s " % command, overview)
                done = run(command, "--help")
                self.assertEnds(done, 0, 0)
                self.assertIn("Usage: ischia " + command, done.stdout.decode())
                self.assertEqual(run("help", command).stdout, done.stdout)
        self.assertEqual(run("--help").stdout, run("help").stdout)

    def test_version(self):
        text = run("--version").stdout.decode()
        self.assertRegex(text, r"^ischia [0-9.]+\nmodel [a-z0-9-]+ [0-9]+\ncJSON [0-9.]+\n")


if __name__ == "__main__":
    cli.main()
