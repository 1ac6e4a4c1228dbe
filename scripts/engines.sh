#!/bin/bash
# Make .venv-engines with the simulators for `make engines`, and with PyTorch and JAX for `make hosts`. They come from
# PyPI; with PIP_EXTRA_INDEX_URL=https://download.pytorch.org/whl/cpu PyTorch comes without CUDA.
set -euo pipefail
cd "$(dirname "$0")/.."

venv=.venv-engines
wanted=(mujoco==4.0.0 newton==1.8.0 warp-lang==1.19.0 pybullet==3.2.7 torch==2.13.0 jax==0.10.0 numpy)
# What the tests of `make hosts` need.
wanted+=(pytest scipy xarray netCDF4 psutil)
stamp=$venv/.epsmesh-engines
state=$(sha256sum <scripts/engines.sh)
[[ -f $stamp && $(<"$stamp") == "$state" ]] && exit 0
echo "engines: making $venv"
/usr/bin/python3 -m venv --clear "$venv"
# A pip configured for --user would install beside the venv.
pip=(env PIP_USER=0 "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-input)
"${pip[@]}" --only-binary :all: "${wanted[@]}"
"$venv/bin/python" -c 'import jax, mujoco, newton, pybullet, torch'
echo "$state" >"$stamp"
echo "engines: done"
