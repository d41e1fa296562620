#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Builds a release and solves three sides of Table 2 of Macron et al. (2020).
# On Debian 12, as root or with sudo, it first installs what is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
source deploy/packages.sh

install_packages build
[[ -f build/release/build.ninja ]] || CC=${CC:-gcc} meson setup build/release --buildtype=release
ninja -C build/release server/cli/ischia

for side in 1R 7L 9L; do
  build/release/server/cli/ischia solve --summary "examples/table2_$side.json"
  echo
done
echo "More: build/release/server/cli/ischia --help; the same numbers as JSON without --summary."
