#!/bin/bash
# Make a release in dist/: sdist and wheel of the program and of the evaluator alone, the notebooks, the JSON schema of study
# files, and a list of checksums. Sdist and wheel are installed into a fresh venv, and run a study away from the checkout.
# dolfinx, PETSc and gmsh are Debian's (scripts/setup.sh): the venv sees them, and pip leaves them alone.
set -euo pipefail
cd "$(dirname "$0")/.."
python=/usr/bin/python3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "release: $*" >&2; exit 1; }
quiet=(--quiet --disable-pip-version-check --no-input)

# Building leaves files beside the sources; and what is not theirs must not get in.
mkdir "$work/source"
tar -cf - --exclude-vcs --exclude='./.*' --exclude=./results --exclude=./dist --exclude='*.egg-info' \
    --exclude=libepsmesh.so --exclude=latency --exclude=.built --exclude=./build --exclude='*.so' --exclude=./studies/study.schema.json --exclude=./meshes/cache --exclude=__pycache__ --exclude=./docs/_build --exclude=./docs/reference . |
    tar -xf - -C "$work/source"
(cd "$work/source" && find . -type f -printf '%P\n') >"$work/files" # before the build adds its own

# ---- build: the wheel is made from the sdist, and has what that has ------------------------------------
"$python" -m venv "$work/build"
"$work/build/bin/python" -m pip install "${quiet[@]}" build
rm -rf dist
"$work/build/bin/python" -m build --outdir dist "$work/source" >"$work/log" 2>&1 || { tail -n 30 "$work/log" >&2; fail "cannot be built"; }
version=$(sed -nE 's/^__version__ = "(.*)"$/\1/p' pipeline/epsmesh/__init__.py)
[[ -f dist/epsmesh-$version.tar.gz ]] && compgen -G "dist/epsmesh-$version-py3-none-*.whl" >/dev/null || fail "dist/ has $(ls dist), not version $version"

# Templates, C sources, studies to begin with: all that a package folder holds.
"$python" - "$work/files" dist/epsmesh-*.whl dist/epsmesh-*.tar.gz <<'PYTHON'
import sys
import tarfile
import zipfile
from pathlib import Path

listed, wheel, sdist = sys.argv[1:]
held = set(zipfile.ZipFile(wheel).namelist())
sent = {name.split("/", 1)[-1] for name in tarfile.open(sdist).getnames()}
files = {Path(name) for name in Path(listed).read_text().splitlines()}
copied = {"studies": "epsmesh/study/examples", "meshes": "epsmesh/study/meshes"}
examples = {Path(copied[path.parts[0]], *path.parts[1:]) for path in files if path.parts[0] in copied}
# What builds the evaluator alone is not installed.
own = {Path(name) for name in ("setup.py", "pyproject.toml", "MANIFEST.in", "README.md", "LICENSE")}
packages = {path.relative_to("pipeline") for path in files if path.parts[0] == "pipeline"}
packages -= {path for path in packages if path.parts[1] == "wasm" or path.relative_to(path.parts[0]) in own}
package = {str(path) for path in packages | examples}
if missing := sorted(package - held):
    sys.exit(f"release: the wheel lacks {', '.join(missing)}")
if missing := sorted({str(path) for path in files} - sent):
    sys.exit(f"release: the sdist lacks {', '.join(missing)}")
print(f"release: {len(held)} files in the wheel, {len(sent)} in the sdist")
PYTHON
# Its own distribution, for the same machine as the one that builds it.
"$work/build/bin/python" -m build --outdir dist "$work/source/pipeline/epsmesh_realtime" >"$work/log" 2>&1 || { tail -n 30 "$work/log" >&2; fail "the evaluator cannot be built"; }

# ---- install -------------------------------------------------------------------------------------------
"$python" -m venv --system-site-packages "$work/venv"
"$python" scripts/constraints.py >"$work/constraints"
install=("$work/venv/bin/python" -m pip install "${quiet[@]}" -c "$work/constraints")
export PIP_USER=0

try() { # from the file $1: version, a new study, its run, its report
    rm -rf "$work/away"
    mkdir "$work/away"
    (
        cd "$work/away"
        export EPSMESH_CACHE="$work/cache" OMP_NUM_THREADS=1
        epsmesh=$work/venv/bin/epsmesh
        [[ $("$epsmesh" --version) == "epsmesh $version" ]] || fail "$1: says $("$epsmesh" --version), not $version"
        where=$("$work/venv/bin/python" -c 'import epsmesh; print(epsmesh.__file__)')
        [[ $where == "$work/venv"/* ]] || fail "$1: is run from $where"
        "$epsmesh" new mine --like quick >/dev/null
        "$epsmesh" run studies/mine.toml --quiet
        "$epsmesh" report studies/mine.toml >/dev/null
        "$epsmesh" new punch --like identify-punch >/dev/null
        for curve in studies/curves/*.csv; do "$epsmesh" view "$curve" >/dev/null; done
        "$work/venv/bin/python" - <<'PYTHON'
import epsmesh

dataset = epsmesh.open("studies/mine.toml")
assert (dataset["status"] == "ok").all() and (dataset["force_error"] < 0.1 * dataset["force"]).all(), dataset
assert "<svg" in open("results/mine.html", encoding="utf-8").read()
print(f"release: {dataset['status'].size} cases, F = {float(dataset['force'].max()):.6g} N at most")
PYTHON
    )
}

try_packages() { # identification, and a real-time query with and without the study program
    "$python" -m venv "$work/bare"
    "$work/bare/bin/python" -m pip install "${quiet[@]}" dist/epsmesh_realtime-*.whl
    (
        cd "$work/away"
        export EPSMESH_CACHE="$work/cache" OMP_NUM_THREADS=1
        "$work/venv/bin/epsmesh" new gel --like identify-punch >/dev/null
        "$work/venv/bin/epsmesh" identify studies/gel.toml >identified
        grep -q "if the body is as declared" identified || fail "identify says $(cat identified)"
        cat >studies/touched.toml <<'TOML'
[body]
shape = "cylinder"
radius = "20 mm"
height = "20 mm"
fixed = "bottom"

[material]
young = "10 kPa"
poisson = 0.45

[probe]
shape = "disc"
radius = "2 mm"
depth = "0.1 mm"
contact = "frictionless"

[mesh]
accuracy = "5 %"
TOML
        "$work/venv/bin/epsmesh" export studies/touched.toml --accuracy 5% --model body.epsm >exported 2>&1 || fail "export says $(cat exported)"
        ask='touch = realtime.read("body.epsm").query("disc", radius=2e-3, at=(0.0, 0.0, 0.0), depth=1e-4); print(touch.status, *touch.force)'
        with=$("$work/venv/bin/python" -c "import epsmesh; realtime = epsmesh.realtime; $ask")
        without=$("$work/bare/bin/python" -c "import epsmesh_realtime as realtime; $ask")
        [[ $with == ok* && $with == "$without" ]] || fail "real time: $with with epsmesh, $without without"
        echo "release: identify and export run; a query with and without epsmesh: $with"
    )
}
"${install[@]}" dist/epsmesh-*.whl
try wheel
try_packages
"${install[@]}" --force-reinstall --no-deps dist/epsmesh-*.tar.gz
try sdist

# ---- what is not installed, and the list ----------------------------------------------------------------
cp notebooks/*.ipynb dist/
"$work/venv/bin/python" -c 'from epsmesh.study.json_schema import schema_text; print(schema_text(), end="")' >dist/study.schema.json
(cd dist && sha256sum -- * >SHA256SUMS && sha256sum --check --quiet SHA256SUMS && cat SHA256SUMS)
echo "release: dist/ is complete; epsmesh-$version.tar.gz and .whl install and run on Debian $(cat /etc/debian_version)"
