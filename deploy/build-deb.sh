#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Builds the Debian package of this tree into build/deb (or OUT) and checks it with lintian.
#
# usage: deploy/build-deb.sh [--page FOLDER] [OUT]
#
# Beside the package lies its list of parts (SBOM) as CycloneDX JSON.
#
# On Debian 12, as root or with sudo, it first installs what is missing. The clinic page comes from
# static/build.sh, which takes what static/package-lock.json names from npm; with --page a folder
# that static/build.sh has built elsewhere is taken instead. After that nothing needs a network. The
# package is made from what git has committed, so that what lies about stays out.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source deploy/packages.sh

page='' out=build/deb
while (($#)); do
  case $1 in
    --page) page=${2:?--page needs a folder} && shift ;;
    -*) sed -n '/^# usage/s/^# //p' "$0" >&2 && exit 2 ;;
    *) out=$1 ;;
  esac
  shift
done

install_packages build package
if [[ -z $page ]]; then
  static/build.sh
  page=static/dist
fi

# The sources of the package: the commit, its page, and deploy/debian where dpkg wants it.
mkdir -p "$out"
out=$(realpath "$out")
version=$(dpkg-parsechangelog -l deploy/debian/changelog -S Version)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tree=$work/ischia-$version
mkdir -p "$tree/static"
git archive HEAD | tar -x -C "$tree"
cp -r "$page" "$tree/static/dist"
cp -r "$tree/deploy/debian" "$tree/debian"

(cd "$tree" && dpkg-buildpackage --unsigned-source --unsigned-changes --build=binary)
# The list of parts: what these very programs load and hold.
dpkg-deb -x "$work/ischia_${version}_$(dpkg --print-architecture).deb" "$work/installed"
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct) "$tree/deploy/sbom.py" \
  "$work"/installed/usr/bin/{ischiad,ischia} >"$out/ischia_$version.cdx.json"
cp "$work"/*.deb "$work"/*.changes "$work"/*.buildinfo "$out"
lintian --fail-on error,warning --info "$out/ischia_${version}_$(dpkg --print-architecture).changes"
ls -l "$out"/ischia_"$version"_*.deb "$out/ischia_$version.cdx.json"
