# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways in which a solve can end, on the stand-in of tests/double (its force says how)."""
import csv
import io
import json
import os
import signal
import subprocess
import time

import cli
from cli import GOOD, HEADER, PROGRAM, run

DIVERGES, OUT_OF_MEMORY, KILLED, CANCELLED, SLOW = 401, 402, 403, 404, 405


def case(force):
    return json.dumps({**GOOD, "F": force})


def row(force):
    return "7.1,22.8,31,10,8,5,%s" % force


def table(text):
    return list(csv.DictReader(io.StringIO(text.decode() if isinstance(text, bytes) else text)))


def without_clock(text):
    return [{k: v for k, v in r.items() if k != "wall_s"} for r in table(text)]


class Solve(cli.Case):
    def test_a_result(self):
        done = run("solve", stdin=case(258))
        self.assertEnds(done, 0, 0)
        result = json.loads(done.stdout)
        self.assertEqual(list(result), ["strain", "clusters", "muscle_volume_mm3", "seat", "load_curve",
                                        "threshold_force_N", "risk", "numerics", "model"])
        self.assertTrue(result["numerics"]["converged"])
        self.assertEqual(result["load_curve"][-1]["F_N"], 258)
        self.assertIsNone(result["threshold_force_N"]["compression"])
        self.assertGreaterEqual(result["numerics"]["wall_s"], 0)
        self.assertEqual(len(result["risk"]["caveats"]), 3)

    def test_a_failure_is_a_document_too(self):
        done = run("solve", stdin=case(DIVERGES))
        self.assertIn("diverged_step", self.assertEnds(done, 1, 1))
        result = json.loads(done.stdout)
        self.assertIsNone(result["strain"])
        self.assertIsNone(result["risk"])
        self.assertFalse(result["numerics"]["converged"])
        self.assertEqual(result["numerics"]["last_converged_F_N"], 0.625 * DIVERGES)

    def test_errors(self):
        for force, word in [(OUT_OF_MEMORY, "out of memory"), (CANCELLED, "cancelled")]:
            with self.subTest(word):
                done = run("solve", stdin=case(force))
                self.assertIn(word, self.assertEnds(done, 1, 1))
                self.assertEqual(done.stdout, b"")

    def test_warnings_do_not_stop_a_solve(self):
        done = run("solve", stdin=json.dumps({**GOOD, "R2": 80}))
        self.assertIn("warning: R2 is 80 mm", self.assertEnds(done, 0, 1))

    def test_summary(self):
        text = run("solve", "--summary", stdin=case(258)).stdout.decode()
        for word in ("R1 7.1 mm", "muM 8 kPa", "F 258 N", "Green-Lagrange", "engineering", "mm³",
                     "not a medical device", "converged"):
            self.assertIn(word, text)
        text = run("solve", "--summary", stdin=case(DIVERGES)).stdout.decode()
        self.assertNotIn("eps_max", text)
        self.assertIn("last converged force is 250.6 N of 401 N", text)

    def test_fields_appear_complete_or_not_at_all(self):
        vtu, svg = self.path("a.vtu"), self.path("a.svg")
        self.assertEnds(run("solve", "--vtu", vtu, "--svg", svg, stdin=case(258)), 0, 0)
        self.assertEqual(sorted(os.listdir(self.folder.name)), ["a.svg", "a.vtu"])
        self.assertEqual(os.stat(vtu).st_mode & 0o777, 0o666 & ~current_umask())
        old = os.stat(vtu).st_mtime_ns
        self.assertEnds(run("solve", "--vtu", vtu, stdin=case(DIVERGES)), 1, 1)
        self.assertEqual(os.stat(vtu).st_mtime_ns, old)
        self.assertEnds(run("export", "--inp", "-o", svg, stdin=case(DIVERGES)), 1, 1)
        with open(svg) as file:
            self.assertEqual(file.read(), "<svg/>\n")
        self.assertEqual(sorted(os.listdir(self.folder.name)), ["a.svg", "a.vtu"])

    def test_outputs_that_cannot_be_written(self):
        self.assertEnds(run("solve", "--vtu", self.path("no/a.vtu"), stdin=case(258)), 1, 1)
        with open("/dev/full", "w") as full:
            done = subprocess.run([PROGRAM, "solve"], input=case(258).encode(), stdout=full,
                                  stderr=subprocess.PIPE, timeout=600)
        self.assertIn("No space left", self.assertEnds(done, 1, 1))

    def test_export(self):
        for name, text in [("--inp", b"*HEADING\n"), ("--vtu", b"<VTKFile/>\n"), ("--svg", b"<svg/>\n")]:
            done = run("export", name, stdin=case(258))
            self.assertEnds(done, 0, 0)
            self.assertEqual(done.stdout, text)
        self.assertEnds(run("export", "--vtu", stdin=case(DIVERGES)), 1, 1)


def current_umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


class Cohort(cli.Case):
    def test_rows_end_each_in_its_own_way(self):
        rows = [row(f) for f in (258, DIVERGES, OUT_OF_MEMORY, KILLED, CANCELLED, 259)]
        rows.insert(2, "x,22.8,31,10,8,5,258")
        done = run("cohort", "-j2", stdin="\n".join([HEADER, *rows]) + "\n")
        errors = self.assertEnds(done, 2, 6)
        self.assertIn("7 rows: 2 succeeded, 4 failed, 1 refused", errors)
        answers = table(done.stdout)
        self.assertEqual([a["status"] for a in answers], ["succeeded", "failed", "refused", "failed",
                                                          "failed", "failed", "succeeded"])
        self.assertEqual(answers[0]["eps_max"] == "", False)
        self.assertIn("250.6 N of 401 N", answers[1]["reason"])
        self.assertIn("R1 is \"x\"", answers[2]["reason"])
        self.assertIn("Killed", answers[4]["reason"])

    def test_exit_status_1_when_only_solves_failed(self):
        self.assertEnds(run("cohort", stdin="%s\n%s\n" % (HEADER, row(DIVERGES))), 1)
        self.assertEnds(run("cohort", stdin="%s\n%s\n" % (HEADER, row(200))), 0, 0)
        self.assertEnds(run("cohort", stdin=HEADER), 0, 0)

    def test_the_same_bits_however_many_processes(self):
        text = HEADER + "\n" + "".join(row(100 + i / 7) + "\n" for i in range(600))
        outputs = [without_clock(run("cohort", "-j", str(j), stdin=text).stdout) for j in (1, 2, 7)]
        self.assertEqual(len(outputs[0]), 600)
        self.assertEqual(outputs[0], outputs[1])
        self.assertEqual(outputs[0], outputs[2])
        self.assertEqual([r["F_N"] for r in outputs[0]], [r.split(",")[-1] for r in text.split()[1:]])

    def test_order_is_kept_when_a_row_is_slow(self):
        forces = [SLOW, 200, 201, 202, SLOW, 203]
        done = run("cohort", "-j3", stdin="\n".join([HEADER, *map(row, forces)]))
        self.assertEqual([float(r["F_N"]) for r in table(done.stdout)], forces)

    def test_columns_and_other_spellings(self):
        text = ("\ufeffid,F,R1, R2_mm ,eM,eF,\u03bcM_kPa,\u00b5F,skin.mu,resolution,note\r\n"
                "1,258,7.1,22.8,31,10,8,5,20,fine,\"a, \"\"b\"\"\"\r\n"
                "2,258,7.1,22.8,31,10,8,5,,,\r\n")
        done = run("cohort", stdin=text)
        self.assertEnds(done, 0, 0)
        answers = table(done.stdout)
        self.assertEqual(answers[0]["note"], "a, \"b\"")
        self.assertEqual(list(answers[0])[:3], ["id", "F", "R1"])
        self.assertEqual(list(answers[0])[11:14], ["status", "reason", "eps_max"])
        self.assertEqual(list(answers[0])[-2:], ["newton_iterations", "wall_s"])

    def test_rows_appear_as_they_finish(self):
        output = self.path("out.csv")
        program = subprocess.Popen([PROGRAM, "cohort", "-o", output], stdin=subprocess.PIPE)
        program.stdin.write("\n".join([HEADER, row(200), row(SLOW), row(SLOW)]).encode())
        program.stdin.close()
        deadline = time.monotonic() + 200
        seen = 0
        while time.monotonic() < deadline and seen < 2:
            time.sleep(0.02)
            if os.path.exists(output):
                with open(output, "rb") as file:
                    seen = file.read().count(b"\n")
        self.assertIsNone(program.poll(), "the first row was to be seen before the last was solved")
        self.assertEqual(program.wait(timeout=200), 0)
        with open(output, "rb") as file:
            self.assertEqual(file.read().count(b"\n"), 4)

    def test_killed_in_the_middle_leaves_whole_lines_and_no_process(self):
        output = self.path("out.csv")
        for delay in (0.02, 0.05, 0.09):
            with subprocess.Popen([PROGRAM, "cohort", "-j2", "-o", output], stdin=subprocess.PIPE,
                                  start_new_session=True) as program:
                rows = [row(100 + i / 100) for i in range(20000)] + [row(SLOW)] * 40
                try:
                    program.stdin.write("\n".join([HEADER, *rows]).encode())
                    program.stdin.close()
                except BrokenPipeError:
                    pass
                time.sleep(delay)
                program.send_signal(signal.SIGKILL)
                program.wait(timeout=100)
                self.assertTrue(session_ends(program.pid), "a solver process outlived the program")
            with open(output, "rb") as file:
                text = file.read()
            self.assertEqual(text[-1:], b"\n")
            self.assertEqual({line.count(b",") for line in text.splitlines()}, {24})

    def test_a_full_disk(self):
        with open("/dev/full", "w") as full:
            done = subprocess.run([PROGRAM, "cohort"], input=("%s\n%s\n" % (HEADER, row(200))).encode(),
                                  stdout=full, stderr=subprocess.PIPE, timeout=600)
        self.assertIn("No space left", self.assertEnds(done, 1, 1))

    def test_one_writer_a_file(self):
        output = self.path("out.csv")
        with subprocess.Popen([PROGRAM, "cohort", "-o", output], stdin=subprocess.PIPE) as first:
            first.stdin.write("\n".join([HEADER, row(200), row(SLOW), row(SLOW)]).encode())
            first.stdin.close()
            deadline = time.monotonic() + 200
            while time.monotonic() < deadline and not (os.path.exists(output) and os.path.getsize(output)):
                time.sleep(0.02)
            done = run("cohort", "-o", output, stdin=HEADER + "\n" + row(201))
            self.assertIn("is being written by another process", self.assertEnds(done, 2, 1))
            self.assertEqual(first.wait(timeout=200), 0)
        with open(output) as file:
            self.assertEqual([r["F_N"] for r in table(file.read())], ["200", str(SLOW), str(SLOW)])

    def test_without_standard_error_messages_go_nowhere(self):
        output = self.path("out.csv")
        done = subprocess.run(["/bin/sh", "-c", "exec \"$0\" cohort -o \"$1\" 2>&-", PROGRAM, output],
                              input=("%s\n%s\nNaN,1\n" % (HEADER, row(200))).encode(), timeout=600)
        self.assertEqual(done.returncode, 2)
        with open(output, "rb") as file:
            self.assertEqual([line.count(b",") for line in file.read().splitlines()], [24, 24, 24])

    def test_a_bar_and_rows_on_one_terminal(self):
        text = "%s\n%s\n%s\n" % (HEADER, row(200), row(201))
        shown = cli.on_terminal("cohort", stdin=text)
        self.assertIn("rows, 0 failed, 0 refused\x1b[K", shown)
        for line in shown.splitlines():  # of what is left of it when the bar has been wiped
            self.assertRegex(line.rpartition("\x1b[K")[2], r"^(R1_mm,|7\.1,|ischia cohort: |$)")
        plain = cli.on_terminal("cohort", stdin=text, TERM="dumb")
        self.assertNotIn("\x1b", plain)
        self.assertEqual(len(plain.splitlines()), 3)

    def test_a_file_size_limit_leaves_whole_lines(self):
        text = HEADER + "\n" + "".join(row(100 + i) + "\n" for i in range(60))
        output = self.path("out.csv")
        done = subprocess.run(["/bin/sh", "-c", "trap '' XFSZ; ulimit -f 8; exec \"$0\" cohort -o \"$1\"",
                               PROGRAM, output], input=text.encode(), stderr=subprocess.PIPE, timeout=600)
        self.assertIn("File too large", self.assertEnds(done, 1))
        with open(output, "rb") as file:
            text = file.read()
        self.assertEqual(text[-1:], b"\n")
        self.assertEqual({line.count(b",") for line in text.splitlines()}, {24})


def is_alive_in(session, process):
    try:
        with open("/proc/%s/stat" % process) as file:
            state, _, _, its_session = file.read().rpartition(")")[2].split()[:4]
    except OSError:
        return False
    return int(its_session) == session and state != "Z"


def session_ends(session):
    """Whether no process of the session is left, within some seconds."""
    deadline = time.monotonic() + 100
    while time.monotonic() < deadline:
        if not any(is_alive_in(session, p) for p in os.listdir("/proc") if p.isdigit()):
            return True
        time.sleep(0.05)
    return False


if __name__ == "__main__":
    cli.main()
