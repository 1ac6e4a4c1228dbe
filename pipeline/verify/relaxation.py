"""Forces of relaxing tissue over time, against closed forms of the same elastic force."""

from collections.abc import Iterator
from math import exp
from typing import Any

import numpy as np
import xarray as xr
from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.report.dataset import build
from pipeline.run.execute import compute
from pipeline.study.read import parse
from pipeline.verify.row import Row
from pipeline.verify.sections import Section, cylinder, disc, study
from pipeline.viscoelastic import moduli

# Shares and times (s).
_TERMS = ((0.4, 2.0), (0.2, 30.0))
_RAMP, _HOLD = 1.5, 20.0
_FREQUENCY = 0.5
# The convolution is exact; a sine is steady once the transient of the longest time has decayed.
_EXACT, _PERIODS = 1e-6, 400
_SOURCE = "closed form (R. M. Christensen 1982) × elastic force"


def relaxation_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows; ``quick`` leaves out the sine; collective."""
    forces = _forces(comm, {"ramp": f"{_RAMP} s", "hold": f"{_HOLD} s"})
    for time in (_RAMP, _RAMP + _HOLD):
        yield _row(f"ramp and hold, t = {time:g} s", forces, float(forces["force"].sel(time=time)), _ramp_hold(time))
    if not quick:
        yield from _sine(comm)


def _sine(comm: MPI.Comm) -> Iterator[Row]:
    """Storage and loss modulus, from the last period of a sine."""
    sine = {"amplitude": "0.002 mm", "frequency": f"{_FREQUENCY} Hz", "periods": _PERIODS}
    forces = _forces(comm, {"sine": sine, "steps": 40})
    last = forces["force"].isel(time=slice(-41, -1))
    turn = np.exp(-2j * np.pi * _FREQUENCY * last["time"].values)
    wave = 2 * complex((last.values * turn).mean()) * 1j * (0.01 / 0.002)
    for name, value, known in zip(("storage", "loss"), (wave.real, wave.imag), moduli(_TERMS, _FREQUENCY), strict=True):
        yield _row(f"sine of {_FREQUENCY:g} Hz, {name} modulus", forces, value, known)


def _ramp_hold(time: float) -> float:
    """Return F over the elastic force, after a ramp at constant speed."""
    ramp, held = min(time, _RAMP), max(time - _RAMP, 0.0)
    rest = 1 - sum(share for share, _ in _TERMS)
    relaxed = sum(share * tau * (1 - exp(-ramp / tau)) * exp(-held / tau) for share, tau in _TERMS)
    return rest * ramp / _RAMP + relaxed / _RAMP


def _row(name: str, forces: xr.Dataset, value: float, ratio: float) -> Row:
    """Return the row of a force; ``ratio`` is the known one over the elastic force."""
    reference = ratio * float(forces["force_elastic"])
    message = str(forces["message"].values)
    return Row(f"relaxing tissue, disc, {name}", "2D", reference, _SOURCE, value, 0.0, _EXACT, message)


def _forces(comm: MPI.Comm, history: dict[str, Any]) -> xr.Dataset:
    """Return the dataset of a disc on a relaxing cylinder; collective."""
    scene: Section = study(0.3, cylinder(), disc(2) | {"history": history}, {"accuracy": "1 %"})
    scene["material"]["relaxation"] = [{"share": share, "time": f"{time} s"} for share, time in _TERMS]
    plan = make_plan(parse(scene))
    return build(plan, compute(plan, comm)).squeeze()
