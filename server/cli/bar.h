/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_BAR_H
#define ISCHIA_SERVER_CLI_BAR_H

#include <stdbool.h>

/* A progress bar on standard error: drawn over itself on a terminal, nothing at all elsewhere. */
struct bar {
    bool shown;
    bool drawn;
};

void bar_init(struct bar *ret);
/* fraction: 0 ... 1, negative when it is not known; words: what is going on, one short line. */
void bar_draw(struct bar *bar, double fraction, const char *words);
void bar_clear(struct bar *bar); /* wipes it, so that a message can be printed */

#endif
