# SPDX-License-Identifier: GPL-3.0-or-later
"""Who may include whom, and who may link what: docs/ARCHITECTURE.md in words, here as tables."""

PLAIN = ("solver/case.h", "solver/error.h", "solver/result.h", "solver/units.h")

# First matching row decides: (files of, what they may include; a trailing slash means a folder).
ROOMS = (
    ("solver/study/", ("solver/",)),
    ("solver/case.", PLAIN),
    ("solver/error.", PLAIN),
    ("solver/result.", PLAIN),
    ("solver/", ("solver/!study/",)),
    ("api/", ("api/", "words/keys.h", "solver/study/design.h", "solver/study/predictor.h",
              "solver/study/sampling.h", "solver/study/uncertainty.h", *PLAIN)),
    ("server/cli/", ("server/!http/!store/", "api/", "solver/solver.h", "solver/study/", *PLAIN)),
    ("server/store/", ("server/!http/!cli/", "api/", *PLAIN)),
    ("server/", ("server/!cli/", "api/", *PLAIN)),
)

# Headers of the C library, POSIX and Linux: open to all rooms.
SYSTEM_HEADERS = frozenset("""
assert ctype errno fenv float inttypes limits locale math setjmp signal stdalign stdarg stdatomic
stdbool stddef stdint stdio stdlib stdnoreturn string strings time wchar
dirent endian fcntl fnmatch getopt glob grp libgen netdb poll pthread pwd regex sched semaphore
spawn syslog termios unistd
arpa/inet net/if netinet/in netinet/tcp
sys/epoll sys/eventfd sys/file sys/ioctl sys/mman sys/pidfd sys/prctl sys/random sys/resource
sys/select sys/sendfile sys/signalfd sys/socket sys/stat sys/statvfs sys/syscall sys/time
sys/timerfd sys/types sys/uio sys/un sys/utsname sys/wait gnu/libc-version linux/limits
""".split())

# Every other header: the beginning of the paths that may see it, one file wherever it can be one.
FOREIGN = {
    "cholmod.h": "solver/linear.c",
    "lapacke.h": "solver/",  # small systems in dense.c, fits in study/least_squares.c
    "cblas.h": "solver/dense.c",
    "cjson/cJSON.h": "api/json.c",
    "microhttpd.h": "server/http/http.c",
    "gnutls": "server/",  # signatures in jose.c, TLS in hl7/link.c
    "curl/curl.h": "server/outbound/web.c",
    "zlib.h": "server/",  # packs replies, and the fields that are kept (cli/field_blob.c)
    "sqlite3.h": "server/store/store_sqlite",
    "libpq-fe.h": "server/store/store_postgresql",
    "sodium": "server/",  # hashing, tokens, random numbers and constant-time comparison
    "systemd/sd-daemon.h": "server/notify.c",
    "systemd/sd-journal.h": "server/log.c",
    "seccomp.h": "server/cli/worker_sandbox.c",
    "linux/audit.h": "server/sandbox.c",
    "linux/filter.h": "server/sandbox.c",
    "linux/landlock.h": "server/sandbox.c",
}

# What a program must never load, directly or through a library of ours.
NEVER_LINKED = {
    "ischiad": ("libcholmod", "libopenblas", "libblas", "liblapack", "libumfpack"),
    "ischia": ("libmicrohttpd", "libsqlite3", "libpq", "libgnutls"),
}

# Calls that no file may make, and why.
BANNED_CALLS = {
    "strcpy": "knows no size: snprintf or memcpy",
    "strcat": "knows no size: snprintf",
    "strncpy": "may leave no terminator: snprintf or memcpy",
    "sprintf": "knows no size: snprintf",
    "vsprintf": "knows no size: vsnprintf",
    "gets": "knows no size: fgets or getline",
    "scanf": "undefined on overflow: strtod, strtol",
    "sscanf": "undefined on overflow: strtod, strtol",
    "fscanf": "undefined on overflow: strtod, strtol",
    "atoi": "cannot report an error: strtol",
    "atol": "cannot report an error: strtol",
    "atof": "cannot report an error: strtod",
    "strtok": "keeps hidden state: strchr, strsep",
    "setlocale": "changes how numbers are read and written everywhere",
    "system": "runs a shell: posix_spawn",
    "popen": "runs a shell: posix_spawn",
    "tmpnam": "races: mkstemp",
    "mktemp": "races: mkstemp",
    "alloca": "may overflow the stack",
    "rand": "hidden state, poor numbers: a generator of our own with a seed",
    "srand": "hidden state: a generator of our own with a seed",
}

# The libraries return what happened; talking, ending, clocks and threads are for programs.
QUIET_ROOMS = ("solver/", "api/")
LOUD_CALLS = ("printf", "vprintf", "puts", "putchar", "perror", "syslog", "exit", "_exit", "abort",
              "getenv", "time", "clock", "clock_gettime", "gettimeofday", "pthread_create")
LOUD_STREAMS = ("stderr", "stdout")


def home_of(header):
    """Beginning of the paths that may include a foreign header; None when nobody may."""
    family = header.split("/")[0].removesuffix(".h")
    return FOREIGN.get(header) or FOREIGN.get(family)
