/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_LABELS_H
#define ISCHIA_TESTS_LABELS_H

#include "solver/solver.h"

/* What a picture says in no language that anybody speaks. */
static const struct ischia_section_labels labels = {
    .language = "x-test",
    .title = "<titel> & co ]]>",
    .heading = "overskrift",
    .description = "beskrivelse",
    .plane = {"plan y", "plan x"},
    .strain = "tøyning",
    .index = "skjær",
    .threshold = "terskel",
    .bone = "bein",
    .fat = "fett",
    .skin = "hud",
    .seat = "sete",
    .decimal_mark = ',',
};

#endif
