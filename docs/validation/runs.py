# SPDX-License-Identifier: GPL-3.0-or-later
"""The runs that docs/VALIDATION.md is written from, apart from the readings: what run.py makes and
what make.py says is missing."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Run:
    name: str
    title: str
    words: tuple  # of the command, from the root of the source

    def command(self):
        return " ".join(("ischia", *self.words))


MODELS = (("default", "default reading"), ("as_published", "as-published preset"))


def runs():
    for key, words in MODELS:
        model = ("--model", key.replace("_", "-"))
        yield Run(
            f"cohort_{key}",
            f"all 26 sides of Table 2, {words}",
            ("cohort", "examples/table2.csv", *model),
        )
        yield Run(
            f"table1_{key}",
            f"all 2187 points of Table 1, {words}",
            ("study", "factorial", "examples/design_table1.json", *model),
        )
        yield Run(
            f"sobol_{key}",
            f"256 points between those of Table 1, {words}",
            ("study", "factorial", "examples/design_table1_sobol.json", *model),
        )


# What the emulator is trained with beside table1_default; sobol_default has no part in that.
TRAINING = tuple(
    Run(f"{name}_default", title, ("study", "factorial", f"examples/design_{name}.json"))
    for name, title in (
        ("training", "1024 points between those of Table 1, for the emulator"),
        ("training_wide", "512 points in a wider box, for the emulator"),
    )
)

RUNS = (*runs(), *TRAINING)
