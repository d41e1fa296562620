#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Runs a command here, after what package-lock.json names is installed. usage: run.sh COMMAND...
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
# Several tests may start at once: one installs, the others wait.
exec 9>.install-lock
flock 9
if ! cmp -s package-lock.json node_modules/.ischia-lock; then
  npm ci --ignore-scripts --no-audit --no-fund --omit=optional --loglevel=error >&2
  cp package-lock.json node_modules/.ischia-lock
fi
exec 9>&-
exec "$@"
