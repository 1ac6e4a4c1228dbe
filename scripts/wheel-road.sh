#!/bin/bash
# From zero without root and without Debian's packages: build the wheel, install it with the extra `solver` in a bare
# virtual environment, and work with it outside of the checkout. With `short`: a small study on one rank, few tests.
# Without Python >= 3.12, or where no package index is within reach, it says so and succeeds.
set -euo pipefail
cd "$(dirname "$0")/.."
short=${1:-}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "wheel-road: $*" >&2; exit 1; }
skip() { echo "wheel-road: skipped: $*"; exit 0; }
say() { echo "wheel-road: $(($(date +%s) - begun)) s: $*"; }
begun=$(date +%s)
# Nothing of the surroundings: neither another environment's packages nor a home that knows the program.
unset PYTHONPATH PYTHONHOME VIRTUAL_ENV
export PIP_USER=0 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1 OMP_NUM_THREADS=1
export EPSMESH_CACHE="$work/cache" XDG_STATE_HOME="$work/state"

# Building leaves files beside the sources. First, because a set-up of the checkout may run beside this: a folder that it
# adds something to while tar reads it is tar's status 1.
mkdir "$work/source"
tar -cf - --warning=no-file-changed --exclude-vcs --exclude='./.*' --exclude=./results --exclude=./dist \
    --exclude=./build --exclude='*.egg-info' --exclude='*.so' --exclude=./meshes/cache --exclude=__pycache__ --exclude=./docs/_build --exclude=./docs/reference . |
    tar -xf - -C "$work/source" || (($? == 1)) || fail "the sources cannot be copied"

# ---- Python --------------------------------------------------------------------------------------------
fits() { # a shim of pyenv is on PATH, and need not be a Python
    timeout 30 "$1" -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 12))' >/dev/null 2>&1 </dev/null
}
python=
for candidate in ${WHEEL_PYTHON:-python3.12 python3.13 python3 /usr/bin/python3 \
    "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.12.*/bin/python3 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.13.*/bin/python3}; do
    if found=$(command -v "$candidate") && fits "$found"; then
        python=$found
        break
    fi
done
[[ $python ]] || skip "no Python ≥ 3.12 with venv (set WHEEL_PYTHON to one)"
[[ $(uname -sm) == "Linux x86_64" ]] || skip "the solver's wheels are for Linux on x86_64"
say "$("$python" --version), $python"

# ---- install -------------------------------------------------------------------------------------------
"$python" -m venv "$work/venv"
venv=$work/venv/bin
timeout 120 "$venv/python" -m pip download --quiet --no-deps --dest "$work/reached" "typer>=0.12" >"$work/log" 2>&1 ||
    skip "no package index is within reach"
"$venv/python" -m pip wheel --quiet --no-deps --wheel-dir "$work/wheels" "$work/source" >"$work/log" 2>&1 ||
    { tail -n 30 "$work/log" >&2; fail "cannot be built"; }
wheel=$(compgen -G "$work/wheels/epsmesh-*.whl")
"$venv/python" -m pip install --quiet --no-compile "epsmesh[solver] @ file://$wheel" >"$work/log" 2>&1 ||
    { tail -n 30 "$work/log" >&2; fail "cannot be installed"; }
say "installed $(basename "$wheel") and the solver, $(du -sm "$work/venv" | cut -f1) MB"

# ---- work, outside of the checkout ---------------------------------------------------------------------
mkdir "$work/away"
cd "$work/away"
epsmesh=$venv/epsmesh
where=$("$venv/python" -c 'import epsmesh; print(epsmesh.__file__)')
[[ $where == "$work/venv"/* ]] || fail "is run from $where"
"$epsmesh" --version --verbose
if [[ $short ]]; then "$epsmesh" new mine --like quick; else "$epsmesh" new mine; fi
"$epsmesh" run mine --quiet
say "the first study is done"
"$epsmesh" report mine >/dev/null
grep -q "<svg" results/mine.html || fail "the page has no figure"
if [[ ! $short ]]; then # beside other work, ranks wait long for each other
    "$venv/mpiexec" -n 2 "$epsmesh" run mine --quiet --output two
    cat >compare.py <<'PYTHON'
"""Forces of one rank and of two agree within a tenth of their error bars."""

import epsmesh

one, two = (epsmesh.open("studies/mine.toml", output=folder) for folder in ("results", "two"))
assert (one["status"] == "ok").all() and (two["status"] == "ok").all(), one
off = (abs(two["force"] - one["force"]) / one["force_error"]).max()
assert off < 0.1, float(off)
print(f"{one['status'].size} cases, F = {float(one['force'].max()):.6g} N at most; on 2 ranks off by {float(off):.1e} bars")
PYTHON
    "$venv/python" compare.py
fi
say "the report is made"
"$epsmesh" new curves --like identify-punch >/dev/null
"$epsmesh" identify curves --quiet
say "identification"
physics=tests/solve/test_physics.py
tests=("$physics"::test_{support_stiffens,scaling_all_lengths_scales_stiffness} tests/run/test_store.py tests/realtime/test_model.py)
if [[ ! $short ]]; then
    tests+=("$physics" tests/mesh/test_mesh.py)
    "$epsmesh" new model --like quick >/dev/null
    "$epsmesh" export model --no-surface --checks 4 --model box.epsm || (($? == 1)) # few checks need not calibrate
    "$venv/python" - <<'PYTHON'
import epsmesh

touch = epsmesh.realtime.read("box.epsm").query("disc", radius=2e-3, at=(0.0, 0.0, 0.0), depth=1e-4)
assert touch.status == "ok" and touch.force[2] > 0, touch
print(f"a touch: {touch.force[2]:.6g} N, off by at most {100 * touch.relative_error:.2g} %")
PYTHON
    say "a model and a touch"
fi

# ---- tests, of what is installed -----------------------------------------------------------------------
"$venv/python" -m pip install --quiet --no-compile "pytest>=7.4" "hypothesis>=6.90" "jsonschema>=4.17" >"$work/log" 2>&1 ||
    { tail -n 30 "$work/log" >&2; fail "the packages for tests cannot be installed"; }
cd "$work/source"
"$venv/python" -m pytest -q -p no:cacheprovider "${tests[@]}" </dev/null
if [[ ! $short ]]; then
    "$venv/mpiexec" -n 2 scripts/one-voice.sh "$venv/python" -m mpi4py -m pytest -q -m mpi -p no:cacheprovider \
        tests/solve/test_without_hypre.py -k "locking or inclusion" </dev/null # one mesh on both ranks
    cd "$work/away"
    "$epsmesh" verify
    say "verification"
fi
say "done: ${short:-all}"
