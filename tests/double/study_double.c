/* SPDX-License-Identifier: GPL-3.0-or-later */
/* `ischia study` over the double of the solver. */
#include "server/cli/study.h"

int main(int argc, char **argv) { return command_study(argc, argv); }
