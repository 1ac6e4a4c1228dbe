#!/bin/bash
# Install Debian packages, a venv that sees them, and this project in the venv.
# Idempotent; takes a fraction of a second if nothing is missing.
# Debian packages named on the command line are optional: they are installed if that needs no password.
set -euo pipefail
cd "$(dirname "$0")/.."

# Libraries that bind to the ABI of MPI or numpy come from Debian; only pure Python comes from PyPI.
packages=(
    python3-dolfinx python3-gmsh python3-mpi4py python3-petsc4py python3-numpy python3-scipy
    python3-xarray python3-netcdf4 python3-matplotlib python3-venv python3-dev
    libopenblas0-pthread openmpi-bin gcc g++ make git ca-certificates
)
python=/usr/bin/python3
venv=.venv
# EXTRAS=run installs what studies need, without tests and documentation: half of the Python packages. A venv keeps what
# it has.
extras=dev,docs,images,repair,fmi,simulators
if [[ ${EXTRAS:-} == run ]] && ! compgen -G "$venv/lib/python*/site-packages/pytest" >/dev/null; then
    extras=images,repair
fi
[[ $extras == images,repair ]] || packages+=(libudunits2-0) # of cfchecker, in tests
stamp=$venv/.epsmesh-setup
mmg=mmgpy==0.17.1

fail() { echo "setup: $*" >&2; exit 1; }

# ---- Debian packages ----------------------------------------------------------------------------------
missing() {
    local installed
    # dpkg-query fails if any of them is unknown, but still prints the others.
    installed=$(dpkg-query -W -f '${db:Status-Abbrev}${Package}\n' "$@" 2>/dev/null | sed -n 's/^ii *//p') || true
    for package in "$@"; do
        grep -qx -- "$package" <<<"$installed" || echo "$package"
    done
}

command -v dpkg-query >/dev/null || fail "this is no Debian: use 'conda env create -f environment.yml', or the Dockerfile"
mapfile -t wanted < <(missing "${packages[@]}" "$@")
mapfile -t needed < <(missing "${packages[@]}")
if ((${#wanted[@]})); then
    install="apt-get install -y --no-install-recommends ${needed[*]}"
    if ((EUID == 0)); then
        as_root=(env)
    elif command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [[ -t 0 ]]; }; then
        as_root=(sudo)
    elif ((!${#needed[@]})); then
        echo "setup: without root, these optional packages are not installed: ${wanted[*]}" >&2
        wanted=()
    else
        fail "Debian packages are missing, and installing them needs root or sudo. Ask an administrator to run:
    apt-get update && $install"
    fi
fi
if ((${#wanted[@]})); then
    install="apt-get install -y --no-install-recommends ${wanted[*]}"
    echo "setup: installing ${#wanted[@]} Debian packages: ${wanted[*]}"
    log=$(mktemp)
    export DEBIAN_FRONTEND=noninteractive
    "${as_root[@]}" apt-get update >"$log" 2>&1 &&
        "${as_root[@]}" DEBIAN_FRONTEND=noninteractive $install >>"$log" 2>&1 </dev/null ||
        { tail -n 20 "$log" >&2; fail "apt-get failed; the whole log is in $log"; }
    rm -f "$log"
fi

# ---- venv ---------------------------------------------------------------------------------------------
# The stamp records the project file, interpreter and folder of the last complete setup. The other mark exists while the
# venv is being changed: after a killed setup the venv is made anew, because pip takes half a package for a whole one.
state=$({ cat pyproject.toml setup.py pipeline/epsmesh_realtime/setup.py scripts/setup.sh scripts/constraints.py; readlink -f "$python"; pwd; echo "$extras"; } | sha256sum)
unfinished=$venv/.epsmesh-unfinished
[[ -f $stamp && $(<"$stamp") == "$state" && -x $venv/bin/epsmesh && ! -e $unfinished ]] && exit 0

if [[ -e $unfinished || $(readlink -f "$venv/bin/python" 2>/dev/null) != $(readlink -f "$python") ]]; then
    echo "setup: making $venv"
    mkdir -p "$venv"
    touch "$unfinished"
    find "$venv/" -mindepth 1 ! -path "$venv/${unfinished##*/}" -delete
    "$python" -m venv --system-site-packages "$venv" || fail "could not make $venv"
fi
touch "$unfinished"
echo "setup: installing the project and its Python packages into $venv"
constraints=$venv/constraints.txt
"$python" scripts/constraints.py >"$constraints"
install() { # $1: a name for messages; the rest: pip's arguments. A failed pip rolls back, a killed one does not.
    local status=0
    # A pip configured for --user would install beside the venv.
    PIP_USER=0 "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-input "${@:2}" || status=$?
    ((status)) || return 0
    ((status > 128)) || rm -f "$unfinished"
    fail "pip could not install $1"
}
install "the project" -c "$constraints" -e ".[$extras]"
# This package contains the program mmgs, the remesher of surfaces. Its Python part is not used, so its dependencies (a
# newer numpy than Debian 12's) are not installed.
install "$mmg" --no-deps "$mmg"

# ---- check --------------------------------------------------------------------------------------------
"$venv/bin/python" - <<'PYTHON' || fail "the installed libraries do not work together"
import dolfinx, gmsh, matplotlib, mpi4py, netCDF4, numpy, petsc4py, scipy, xarray  # noqa: E401, F401

for module in (numpy, scipy, xarray, netCDF4, matplotlib, mpi4py, petsc4py, dolfinx, gmsh):
    assert module.__file__.startswith("/usr/lib/"), f"{module.__name__} does not come from Debian: {module.__file__}"

import epsmesh_realtime.library  # noqa: E402

epsmesh_realtime.library.library()  # compiles the checkout's sources
PYTHON
"$venv/bin/python" -m epsmesh.study.json_schema || fail "the schema of study files, for editors, could not be written"
multiarch=$("$python" -c 'import sysconfig; print(sysconfig.get_config_var("MULTIARCH"))')
for library in libblas.so.3 liblapack.so.3; do
    [[ $(readlink -f "/usr/lib/$multiarch/$library") == *openblas* ]] ||
        echo "setup: warning: $library is not OpenBLAS's, factorisations may take 8 times longer. To change it, as root:
    update-alternatives --auto $library-$multiarch" >&2
done
echo "$state" >"$stamp"
rm -f "$unfinished"
echo "setup: done; the command is $venv/bin/epsmesh"
