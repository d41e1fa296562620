#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""link_sets.py and tidy.py catch what they are for, on programs and sources made here; and what
docs/capacity.py is asked it does not write."""
import json
import subprocess
import tempfile
import unittest
from pathlib import Path

HERE = Path(__file__).resolve().parent
USES_CHOLMOD = "#include <suitesparse/cholmod.h>\n" \
               "int main(void) { cholmod_common c; return !cholmod_start(&c); }\n"
USES_NOTHING = "int main(void) { return 0; }\n"
FAULTY = "#include <string.h>\n" \
         "int f(const char *a);\n" \
         "int f(const char *a) { return strcmp(a, \"x\") == -1; }\n"


def run(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


class Tools(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)

    def program(self, name, source, *libraries):
        (self.root / "main.c").write_text(source)
        program = self.root / name
        status, text = run("gcc", "-o", program, self.root / "main.c", *libraries)
        self.assertEqual(status, 0, text)
        return program

    def test_a_daemon_with_cholmod_is_caught(self):
        status, text = run(HERE / "link_sets.py",
                           self.program("ischiad", USES_CHOLMOD, "-lcholmod"))
        self.assertEqual(status, 1)
        self.assertIn("loads libcholmod", text)

    def test_each_program_has_its_own_list(self):
        for name, source, libraries in (("ischia", USES_CHOLMOD, ("-lcholmod",)),
                                        ("ischiad", USES_NOTHING, ())):
            with self.subTest(program=name):
                status, text = run(HERE / "link_sets.py", self.program(name, source, *libraries))
                self.assertEqual(status, 0, text)

    def tidy(self, source):
        build = self.root / "build"
        build.mkdir(exist_ok=True)
        path = self.root / "solver.c"
        path.write_text(source)
        (build / "compile_commands.json").write_text(json.dumps(
            [{"directory": str(build), "command": f"gcc -Werror -c {path}", "file": str(path)}]))
        return run(HERE / "tidy.py", build, self.root)

    @unittest.skipUnless(Path("/usr/bin/clang-tidy").exists(), "clang-tidy comes with --all")
    def test_tidy_finds_a_fault_and_only_a_fault(self):
        status, text = self.tidy(FAULTY)
        self.assertEqual(status, 1)
        self.assertIn("bugprone-suspicious-string-compare", text)
        self.assertEqual(self.tidy(USES_NOTHING)[0], 0)

    def test_other_figures_leave_the_page_of_capacity_alone(self):
        for name in ("capacity.py", "CAPACITY.md"):
            (self.root / name).write_bytes((HERE.parents[1] / "docs" / name).read_bytes())
        before = (self.root / "CAPACITY.md").read_text(encoding="utf-8")
        status, text = run("/usr/bin/python3", self.root / "capacity.py", "cores=64")
        self.assertEqual(status, 0, text)
        self.assertIn("machines of 64 cores", text)
        self.assertEqual((self.root / "CAPACITY.md").read_text(encoding="utf-8"), before)
        self.assertNotIn("Traceback", run("/usr/bin/python3", self.root / "capacity.py", "cores=x")[1])


if __name__ == "__main__":
    unittest.main()
