#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Builds a release, starts the service on this machine with its data in ./data, has it solve one
# side of Table 2 of Macron et al. (2020), and stays until Ctrl-C. Usage: ./run.sh [ADDRESS:PORT]
# On Debian 12, as root or with sudo, it first installs what is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
source deploy/packages.sh
listen=${1:-127.0.0.1:8080}

install_packages build
[[ -f build/release/build.ninja ]] || CC=${CC:-gcc} meson setup build/release --buildtype=release
ninja -C build/release server/ischiad server/cli/ischia

says=$(mktemp -u)
mkfifo -m 600 "$says"
build/release/server/ischiad --listen "$listen" --state-dir data >"$says" &
service=$!
exec {said}<"$says"
rm "$says"
trap 'kill -TERM "$service" 2>/dev/null; wait "$service"' EXIT
# "listening on http://…": one that cannot start has said why, and whatever else answers there is
# not asked.
read -r _ _ address <&"$said" || { wait "$service" || exit; }
python3 deploy/first_side.py "$address" examples/table2_1R.json ||
  echo "There was no result; the service stays, its log is above." >&2
trap 'kill -TERM "$service" 2>/dev/null' INT TERM
wait "$service"
