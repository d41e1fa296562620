#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants one violation of every lint rule and checks that this rule, and only this, finds it."""
import sys
import tempfile
import unittest
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).parent))
from rules import RULES  # noqa: E402
from source import Nesting, Tree  # noqa: E402

SPDX = "/* SPDX-License-Identifier: GPL-3.0-or-later */\n"
BODY = "int f(void) { return 0; }\n"
FILL = """void f(double upto)
{
    fill(WORD_A_B, WORDS(word_number("from", 1, 6), word_number("upto", upto, 6)));
}
"""
CLEAN = {
    "words/en.json": '{"a.b": "{from} to {upto}"}\n',
    "words/fr.json": '{"a.b": "{from} à {upto}"}\n',
    "api/risk.c": SPDX + FILL,
    "solver/case.c": SPDX + '#include "solver/case.h"\n\n#include <math.h>\n\n' + BODY,
    "solver/case.h": SPDX + "/* Always 0. */\nint f(void);\n",
    "solver/linear.c": SPDX + "#include <cholmod.h>\n",
    "server/cli/ischia.c": SPDX + '#include "solver/solver.h"\n',
    "tests/unit/meson.build": "# SPDX-License-Identifier: GPL-3.0-or-later\ntests = ['case']\n",
    "tests/unit/test_case.c": SPDX + '#include "solver/case.h"\n',
    "tests/lint/exceptions.txt": "# rule path:name  # reason\n",
    "docs/ARCHITECTURE.md":
        "`cholmod.h` only in linear.c; see `solver/case.h` and [it](../run.sh).\n",
    "run.sh": "#!/bin/bash\n# SPDX-License-Identifier: GPL-3.0-or-later\nset -euo pipefail\n",
}


def function_of(lines, name="f"):
    return f"int {name}(void)\n{{\n" + "    f();\n" * (lines - 4) + "    return 0;\n}\n"


# rule: the files that break it (added to CLEAN, or instead of a file of CLEAN)
PLANTED = {
    "rooms_include_only_what_the_layer_table_allows":
        {"solver/case.c": SPDX + '#include "api/json.h"\n'},
    "foreign_headers_are_seen_by_one_file":
        {"solver/case.c": SPDX + "#include <cholmod.h>\n"},
    "functions_are_short":
        {"solver/case.c": SPDX + function_of(101) +
         "".join("\n" + function_of(6, f"f{i}") for i in range(12))},
    "nine_functions_in_ten_are_very_short":
        {"solver/case.c": SPDX + "\n".join(function_of(41, f"f{i}") for i in range(3))},
    "files_are_short":
        {"solver/case.c": SPDX + "\n".join(f"int v{i};\n" for i in range(400)) + "int w;\n"},
    "lines_are_not_too_wide":
        {"docs/tool.py": "# SPDX-License-Identifier: GPL-3.0-or-later\n#" + "x" * 120 + "\n"},
    "control_flow_nests_shallowly":
        {"solver/case.c": SPDX + "int f(int a)\n{\n    while (a)\n        if (a)\n"
         "            for (;;)\n                if (a--) return 1;\n    return 0;\n}\n"},
    "exceptions_are_still_needed":
        {"tests/lint/exceptions.txt": "functions_are_short solver/case.c:gone  # a kernel\n"},
    "banned_calls_are_absent":
        {"solver/case.c": SPDX + "int f(char *a) { return atoi(a); }\n"},
    "libraries_are_quiet":
        {"solver/case.c": SPDX + 'void f(void) { printf("x"); }\n'},
    "sources_start_with_their_licence":
        {"solver/case.c": BODY},
    "public_prototypes_carry_a_contract":
        {"solver/case.h": SPDX + "#include <math.h>\n\nint f(void);\n"},
    "no_marks_of_unfinished_work":
        {"solver/case.c": SPDX + "/* TO" + "DO */\n" + BODY},
    "no_code_is_commented_out":
        {"solver/case.c": SPDX + "/* return 0; */\n" + BODY},
    "no_struct_is_typedefed":
        {"solver/case.c": SPDX + "typedef struct point {\n    int x;\n} point;\n"},
    "no_path_of_a_workplace":
        {"docs/ARCHITECTURE.md": CLEAN["docs/ARCHITECTURE.md"] + "in /ho" + "me/someone/ischia\n"},
    "every_unit_test_is_registered":
        {"tests/unit/test_newton.c": SPDX},
    "docs_name_only_files_that_exist":
        {"docs/ARCHITECTURE.md": CLEAN["docs/ARCHITECTURE.md"] + "and `solver/gone.c`\n"},
    "sources_are_formatted":
        {"solver/case.c": SPDX + "int  f ( void ) ;\n"},
    "shell_scripts_stop_at_errors":
        {"run.sh": "#!/bin/bash\n# SPDX-License-Identifier: GPL-3.0-or-later\ntrue\n"},
    "foreign_headers_are_documented":
        {"docs/ARCHITECTURE.md": "See `solver/case.h`.\n"},
    "languages_say_the_same":
        {"words/fr.json": '{"a.b": "de {from} à {to}"}\n'},
    "every_word_is_used":
        {"words/en.json": '{"a.b": "{from} to {upto}", "c.d": "nobody"}\n',
         "words/fr.json": '{"a.b": "{from} à {upto}", "c.d": "personne"}\n'},
    "words_get_the_values_that_they_name":
        {"api/risk.c": SPDX + FILL.replace('"upto"', '"to"')},
    "what_people_read_stands_in_words":
        {"server/http/page.c": SPDX + "const char *f(void) { return \"<p>Be patient\"; }\n"},
}


class Lint(unittest.TestCase):
    def findings(self, files):
        """{rule name: findings} over a tree of these files, laid out by the project's style."""
        style = Path(__file__).resolve().parents[2] / ".clang-format"
        with tempfile.TemporaryDirectory() as root:
            for name, text in {**files, ".clang-format": style.read_text()}.items():
                path = Path(root, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text)
            tree = Tree(root)
            found = {r.__name__: list(r(tree)) for r in RULES}
            return {name: findings for name, findings in found.items() if findings}

    def test_a_clean_tree_has_no_findings(self):
        self.assertEqual(self.findings(CLEAN), {})

    def test_every_rule_has_a_planted_violation(self):
        self.assertEqual({r.__name__ for r in RULES}, set(PLANTED))

    def test_each_rule_and_no_other_finds_its_violation(self):
        for name, files in PLANTED.items():
            with self.subTest(rule=name):
                self.assertEqual(set(self.findings({**CLEAN, **files})), {name})

    def test_an_exception_spares_a_function(self):
        files = {**CLEAN, **PLANTED["functions_are_short"],
                 "tests/lint/exceptions.txt": "functions_are_short solver/case.c:f  # a kernel\n"}
        self.assertEqual(self.findings(files), {})

    def test_depth_counts_control_blocks_only(self):
        for body, depth in (
                ("return 0;", 0),
                ("{ { x = (struct p){1, {2}}; } }", 0),
                ("if (a) b(); else if (c) d(); else e();", 1),
                ("for (;;) { while (a) { do b(); while (c); } }", 3),
                ("switch (a) { case 1: if (b) c(); break; default: d(); }", 2),
                ("int t[] = {1, 2}; if (f(g(1), 2)) { x = t[0] ? 1 : 2; }", 1)):
            with self.subTest(body=body):
                self.assertEqual(Nesting(body).depth(), depth)


if __name__ == "__main__":
    unittest.main()
