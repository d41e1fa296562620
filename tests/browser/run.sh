#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Runs one file of the browser suite: tests/browser/run.sh NAME. Its tests drive Debian's Chromium
# against static/dist. Exit status 77: something the suite needs is not installed.
set -eu
cd "$(dirname "$0")"
for tool in node npm "${CHROMIUM:-chromium}" pdftotext; do
    command -v "$tool" >/dev/null || { echo "skipped: no $tool"; exit 77; }
done
if [ ! -f ../../static/dist/index.html ]; then
    echo "skipped: static/dist is not built (static/build.sh)"
    exit 77
fi
# Several tests may start at once: one installs, the others wait.
exec 9>.install-lock
flock 9
if ! cmp -s package-lock.json node_modules/.ischia-lock; then
    npm ci --ignore-scripts --no-audit --no-fund --loglevel=error >&2
    cp package-lock.json node_modules/.ischia-lock
fi
exec 9>&-
exec node --test --test-reporter=tap "$1.test.mjs"
