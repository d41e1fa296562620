#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Builds and tests everything; the last line is `N passed, N failed, N skipped`.
#
#   ./test.sh                 all suites but the slow tests: what has to pass before a commit lands
#   ./test.sh --all           the slow tests too, the other compiler too, the service under
#                             ThreadSanitizer, and valgrind
#   ./test.sh --suite NAME    one suite (may be repeated): unit api crash fuzz lint verification ...
#   ./test.sh --gcc|--clang   one compiler for every build; else clang sanitizes and gcc releases
#
# On Debian 12, as root or with sudo, it first installs what is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
source deploy/packages.sh

# Suites that run under AddressSanitizer and UndefinedBehaviorSanitizer; the others (solves that
# would take ten times as long, tools, benchmarks) run on the release build.
sanitized_suites=(unit api crash fuzz)
release_suites=(lint verification load browser docs proxy deploy)

usage() { sed -n '3,/^set/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"; }

all=no compiler='' wanted=()
while (($#)); do
  case $1 in
    --all) all=yes ;;
    --suite) wanted+=("${2:?--suite needs a name}") && shift ;;
    --gcc | --clang) compiler=${1#--} ;;
    -h | --help) usage && exit 0 ;;
    *) usage >&2 && exit 2 ;;
  esac
  shift
done

# chosen SUITE...: those of them that were asked for, one a line.
chosen() {
  local suite want
  for suite in "$@"; do
    ((${#wanted[@]})) || echo "$suite"
    for want in "${wanted[@]}"; do [[ $suite != "$want" ]] || echo "$suite"; done
  done
}

check_wanted() {
  local want
  for want in "${wanted[@]}"; do
    [[ " ${sanitized_suites[*]} ${release_suites[*]} " == *" $want "* ]] && continue
    echo "no suite called '$want': ${sanitized_suites[*]} ${release_suites[*]}" >&2
    exit 2
  done
}

# build DIR COMPILER OPTION...: sets DIR up once, then brings it up to date.
build() {
  local dir=$1 cc=$2
  shift 2
  echo "== building $dir with $cc"
  [[ -f $dir/build.ninja ]] || CC=$cc meson setup "$dir" "$@"
  ninja -C "$dir"
}

# Many tests wait (for a browser, a lease, a kill): one more at once than there are processors.
processes=$(($(nproc) + 1))
logs=() status=0
# run_suites DIR NAME ARGUMENT...: meson's tests of one build; its log joins the final count.
# (Meson appends the name of a test setup to the log's.) The time limits of the tests are for a test
# that hangs, not for a machine that is slow or busy: four times what meson.build says.
run_suites() {
  local dir=$1 name=$2
  shift 2
  rm -f "$dir/meson-logs/count-$name"*.json
  echo "== testing $dir: $name"
  meson test -C "$dir" --no-rebuild --print-errorlogs --num-processes "$processes" \
    --timeout-multiplier 4 --logbase "count-$name" "$@" || status=1
  logs+=("$dir/meson-logs/count-$name"*.json)
}

# test_build DIR NAME SUITE...: the chosen suites of one build.
test_build() {
  local dir=$1 name=$2 suite arguments=()
  shift 2
  for suite in "$@"; do arguments+=(--suite "$suite"); done
  [[ $all == yes ]] || arguments+=(--no-suite slow)
  run_suites "$dir" "$name" "${arguments[@]}"
}

check_wanted
mapfile -t sanitized < <(chosen "${sanitized_suites[@]}")
mapfile -t release < <(chosen "${release_suites[@]}")
sections=(build test)
[[ $all == no ]] || sections+=(all package)
install_packages "${sections[@]}"

sanitize_options=(--buildtype=debugoptimized -Db_sanitize=address,undefined -Db_lundef=false
  -Dsanitize_tests=true)
suffix=${compiler:+-$compiler}
if ((${#sanitized[@]})); then
  build "build/sanitize$suffix" "${compiler:-clang}" "${sanitize_options[@]}"
  test_build "build/sanitize$suffix" sanitize "${sanitized[@]}"
fi
if ((${#release[@]})); then
  build "build/release$suffix" "${compiler:-gcc}" --buildtype=release
  test_build "build/release$suffix" release "${release[@]}"
fi
if [[ $all == yes && ${#wanted[@]} -eq 0 ]]; then
  build build/other gcc "${sanitize_options[@]}"
  test_build build/other gcc-sanitize unit api
  build build/threads clang --buildtype=debugoptimized -Db_sanitize=thread -Db_lundef=false \
    -Dsanitize_tests=true
  run_suites build/threads threads --suite threads --no-suite slow
  build build/valgrind gcc --buildtype=debugoptimized # valgrind 3.19 cannot read clang's DWARF 5
  run_suites build/valgrind unit --setup valgrind --suite unit --no-suite slow
  run_suites build/valgrind bad-input --suite valgrind
fi

/usr/bin/python3 tests/count.py "${logs[@]}" || status=1
exit "$status"
