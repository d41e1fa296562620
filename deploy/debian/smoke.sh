#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# What a package build tries: usage: smoke.sh BUILD-FOLDER
set -eu
build=$1
OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
export OPENBLAS_NUM_THREADS OMP_NUM_THREADS
case ${DEB_BUILD_OPTIONS:-} in *nocheck*) exit 0 ;; esac

"$build/server/ischiad" --config deploy/ischiad.conf --state-dir "$build/state" --check-config
"$build/server/cli/ischia" version
"$build/server/cli/ischia" solve examples/table2_1R.json >"$build/smoke.json"
python3 - "$build/smoke.json" <<'PYTHON'
import json, sys
result = json.load(open(sys.argv[1]))
numerics = result['numerics']
assert numerics['converged'] and numerics['force_residual'] < 1e-6, numerics
print(f"eps_max {result['strain']['eps_max']:.3f} +- {numerics['eps_max_error']:.3f}")
PYTHON
