#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Builds static/dist/ from the sources and the lock file. Usage: static/build.sh [STAMP]
# STAMP is touched when the build succeeded (for meson).
set -eu
stamp=${1:-}
case $stamp in /* | '') ;; *) stamp=$PWD/$stamp ;; esac
cd "$(dirname "$0")"

# `npm ci` only when the lock file is not what is installed: a rebuild then takes a second.
if ! cmp -s package-lock.json node_modules/.ischia-lock; then
    npm ci --ignore-scripts --no-audit --no-fund --loglevel=error >&2
    cp package-lock.json node_modules/.ischia-lock
fi
node build.mjs
if [ -n "$stamp" ]; then touch "$stamp"; fi
