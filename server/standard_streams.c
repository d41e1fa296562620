/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/standard_streams.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

void standard_streams_hold(void)
{
    /* Opened the wrong way round, so that using them still fails. */
    static const int modes[] = {
        [STDIN_FILENO] = O_WRONLY, [STDOUT_FILENO] = O_RDONLY, [STDERR_FILENO] = O_RDONLY};
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++)
        if (fcntl(fd, F_GETFD) < 0 && errno == EBADF) /* open takes the lowest number */
            (void)open("/dev/null", modes[fd]);       /* NOLINT(android-cloexec-open): inherited */
}

enum ischia_code standard_output_flush(struct ischia_error *err)
{
    CHECK(fflush(stdout) == 0 && ferror(stdout) == 0, err, ISCHIA_E_IO,
          "cannot write standard output: %s", strerror(errno));
    return ISCHIA_OK;
}
