#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Fuzzes each target for a number of seconds (default 20) under libFuzzer, ASan and UBSan:
#   tests/fuzz/run.sh [SECONDS] [TARGET]...
# A sample that fails is left in build-fuzz/; keep it in tests/fuzz/corpus/TARGET/, where every
# build replays it.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=${1:-20}
[ $# -gt 0 ] && shift
targets=${*:-case_json cds config csv fhir field_blob form frame hl7 query result_json study}
[ -d build-fuzz ] || CC=clang meson setup build-fuzz -Dfuzz=true -Dbuildtype=debugoptimized \
  -Db_sanitize=address,undefined -Db_lundef=false >/dev/null
for target in $targets; do
  ninja --quiet -C build-fuzz "tests/fuzz/fuzz_$target"
  found=build-fuzz/found/$target
  mkdir -p "$found"
  echo "fuzz_$target: $seconds s"
  build-fuzz/tests/fuzz/"fuzz_$target" -max_total_time="$seconds" -max_len=8192 -timeout=60 \
    -artifact_prefix="build-fuzz/$target-" -print_final_stats=1 -verbosity=0 \
    "$found" "tests/fuzz/corpus/$target"
done
