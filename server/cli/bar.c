/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/bar.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { BAR_WIDTH = 30 };

/* A terminal that can go back to the start of a line. */
static bool can_redraw(void)
{
    const char *kind = getenv("TERM");
    return isatty(STDERR_FILENO) == 1 && kind != NULL && strcmp(kind, "dumb") != 0;
}

void bar_init(struct bar *ret)
{
    ret->shown = can_redraw();
    ret->drawn = false;
}

void bar_draw(struct bar *bar, double fraction, const char *words)
{
    char cells[BAR_WIDTH + 1];
    if (!bar->shown) return;
    if (fraction > 1) fraction = 1;
    const bool known = fraction >= 0;
    const int full = known ? (int)(fraction * BAR_WIDTH) : 0;
    memset(cells, '.', BAR_WIDTH);
    memset(cells, '#', (size_t)full);
    cells[BAR_WIDTH] = '\0';
    bar->drawn = true;
    /* "\x1b[K" wipes what a longer line has left behind. */
    if (known)
        (void)fprintf(stderr, "\r[%s] %3d %%  %.60s\x1b[K", cells, (int)(100 * fraction), words);
    else
        (void)fprintf(stderr, "\r%.90s\x1b[K", words);
}

void bar_clear(struct bar *bar)
{
    if (bar->shown && bar->drawn) (void)fprintf(stderr, "\r\x1b[K");
    bar->drawn = false;
}
