#!/bin/bash
# Make .venv-peers with the programs for `make peers`. They come from PyPI, with their own numpy; CalculiX from Debian.
set -euo pipefail
cd "$(dirname "$0")/.."

venv=.venv-peers
wanted=(ngsolve==6.2.2608 scikit-fem==12.0.2 scipy gmsh pypardiso cvxopt pyamg)
stamp=$venv/.epsmesh-peers

if ! command -v ccx >/dev/null; then
    # Without it, the other programs are compared.
    apt-get install -qq -y --no-install-recommends calculix-ccx >/dev/null || echo "peers: no CalculiX: apt-get failed" >&2
fi
state=$(sha256sum <scripts/peers.sh)
[[ -f $stamp && $(<"$stamp") == "$state" ]] && exit 0
echo "peers: making $venv"
/usr/bin/python3 -m venv --clear "$venv"
# A pip configured for --user would install beside the venv.
PIP_USER=0 "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-input --only-binary :all: "${wanted[@]}"
"$venv/bin/python" -c 'import cvxopt, gmsh, ngsolve, pyamg, pypardiso, skfem'
echo "$state" >"$stamp"
echo "peers: done"
