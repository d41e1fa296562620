/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/progress.h"

#include <math.h>
#include <time.h>
#include <unistd.h>

enum { BAR_CELLS = 30 };

static double now_s(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

void progress_init(struct progress *ret, FILE *out, const char *what, size_t total, size_t before,
                   bool quiet)
{
    *ret = (struct progress){.out = out,
                             .what = what,
                             .total = total,
                             .before = before,
                             .terminal = isatty(fileno(out)) == 1,
                             .quiet = quiet,
                             .start_s = now_s()};
    ret->shown_s = ret->start_s;
}

/* "1 h 05 min", "3 min 10 s", "8 s". */
static void put_duration(FILE *out, double seconds)
{
    const long s = lround(seconds);
    if (s >= 3600) {
        (void)fprintf(out, "%ld h %02ld min", s / 3600, s / 60 % 60);
    } else if (s >= 60) {
        (void)fprintf(out, "%ld min %02ld s", s / 60, s % 60);
    } else {
        (void)fprintf(out, "%ld s", s);
    }
}

static void put_bar(const struct progress *p, size_t done)
{
    const size_t cells = p->total > 0 ? done * BAR_CELLS / p->total : BAR_CELLS;
    (void)fputs("\r[", p->out);
    for (size_t i = 0; i < BAR_CELLS; i++) (void)fputc(i < cells ? '#' : '.', p->out);
    (void)fputs("] ", p->out);
}

static void put_state(const struct progress *p, size_t done, size_t failed)
{
    const double elapsed = now_s() - p->start_s;
    if (p->terminal) put_bar(p, done);
    (void)fprintf(p->out, "%zu/%zu %s", done, p->total, p->what);
    if (failed > 0) (void)fprintf(p->out, ", %zu without result", failed);
    if (done > p->before && done < p->total) {
        (void)fputs(", about ", p->out);
        put_duration(p->out, elapsed / (double)(done - p->before) * (double)(p->total - done));
        (void)fputs(" left", p->out);
    } else if (done >= p->total) {
        (void)fputs(", took ", p->out);
        put_duration(p->out, elapsed);
    }
    (void)fputs(p->terminal ? "\x1b[K" : "\n", p->out);
    (void)fflush(p->out);
}

void progress_show(struct progress *progress, size_t done, size_t failed)
{
    const double now = now_s(), pause = progress->terminal ? 0.2 : 10;
    if (progress->quiet || now - progress->shown_s < pause) return;
    progress->shown_s = now;
    put_state(progress, done, failed);
}

void progress_finish(struct progress *progress, size_t done, size_t failed)
{
    if (progress->quiet) return;
    put_state(progress, done, failed);
    if (progress->terminal) (void)fputc('\n', progress->out);
}
