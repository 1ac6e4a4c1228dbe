"""Forces of relaxing tissue over time, against closed forms of the same elastic force."""

from collections.abc import Iterator
from math import exp
from typing import Any

import numpy as np
import xarray as xr
from mpi4py import MPI
from scipy.integrate import quad
from scipy.optimize import brentq

from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from epsmesh.study.read import parse
from epsmesh.verify import Row
from epsmesh.viscoelastic import moduli
from tests.verification.sections import Section, cylinder, disc, study

# Shares and times (s).
_TERMS = ((0.4, 2.0), (0.2, 30.0))
_RAMP, _HOLD = 1.5, 20.0
_FREQUENCY = 0.5
# The convolution is exact; a sine is steady once the transient of the longest time has decayed.
_EXACT, _PERIODS = 1e-6, 400
# Depth (mm) of a sphere of 1 m, whose contact is 1 mm wide, on a body that is a half-space to it (mm).
_BALL_DEPTH, _FAR = 0.001, 20_000
# Radius of contact over that of the body: so much, relatively, the elastic curve is off the power 3/2.
_FINITE = 1 / _FAR
_SOURCE_OF_CONTACT = "closed form (E. H. Lee, J. R. M. Radok 1960; T. C. T. Ting 1966) × elastic force"
_SOURCE = "closed form (R. M. Christensen 1982) × elastic force"


def relaxation_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows; ``quick`` leaves out the sine; collective."""
    forces = _forces(comm, {"ramp": f"{_RAMP} s", "hold": f"{_HOLD} s"})
    for time in (_RAMP, _RAMP + _HOLD):
        yield _row(f"ramp and hold, t = {time:g} s", forces, float(forces["force"].sel(time=time)), _ramp_hold(time))
    if not quick:
        yield from _sine(comm)
        yield from _sphere(comm)


def _sine(comm: MPI.Comm) -> Iterator[Row]:
    """Storage and loss modulus, from the last period of a sine."""
    sine = {"amplitude": "0.002 mm", "frequency": f"{_FREQUENCY} Hz", "periods": _PERIODS}
    forces = _forces(comm, {"sine": sine, "steps": 40})
    last = forces["force"].isel(time=slice(-41, -1))
    turn = np.exp(-2j * np.pi * _FREQUENCY * last["time"].values)
    wave = 2 * complex((last.values * turn).mean()) * 1j * (0.01 / 0.002)
    for name, value, known in zip(("storage", "loss"), (wave.real, wave.imag), moduli(_TERMS, _FREQUENCY), strict=True):
        yield _row(f"sine of {_FREQUENCY:g} Hz, {name} modulus", forces, value, known)


def _sphere(comm: MPI.Comm) -> Iterator[Row]:
    """A shallow sphere on a half-space, pressed and withdrawn at one speed: F goes like the depth to the power 3/2."""
    deep = _BALL_DEPTH
    table = [["0 s", "0 mm"], [f"{_RAMP} s", f"{deep} mm"], [f"{2 * _RAMP} s", "0 mm"]]
    probe: Section = {"shape": "sphere", "radius": "1000 mm", "history": {"table": table, "steps": 60}}
    forces = _forces(comm, {}, probe, cylinder(_FAR, _FAR))
    for share in (0.5, 1.0, 1.2):
        time = share * _RAMP
        until = time if share <= 1 else brentq(_unbalanced, 0.0, _RAMP, args=(time,))
        found = forces.sel(time=time, method="nearest")
        reference = float(forces["force_elastic"]) * _loaded(until, time)
        bar = float(found["force_error"] / found["force"])
        name = f"relaxing half-space, sphere, t = {share:g} ramps"
        yield Row(name, "2D", reference, _SOURCE_OF_CONTACT, float(found["force"]), bar, _FINITE)


def _unbalanced(start: float, time: float) -> float:
    """Return the integral of E(t - s) d'(s) from ``start`` on the way in to ``time`` on the way out."""
    loading, unloading = (quad(_modulus, time - b, time - a)[0] for a, b in ((start, _RAMP), (_RAMP, time)))
    return float(loading - unloading)


def _loaded(until: float, time: float) -> float:
    """Return F over the largest elastic force, of the loading until a time."""
    return float(quad(lambda s: 1.5 * (s / _RAMP) ** 0.5 / _RAMP * _modulus(time - s), 0.0, until)[0])


def _modulus(time: float) -> float:
    return 1 - sum(share for share, _ in _TERMS) + sum(share * exp(-time / tau) for share, tau in _TERMS)


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


def _forces(
    comm: MPI.Comm, history: dict[str, Any], probe: Section | None = None, body: Section | None = None
) -> xr.Dataset:
    """Return the dataset of a tool, by default a disc, on a relaxing cylinder; collective."""
    probe = probe or disc(2) | {"history": history}
    scene: Section = study(0.3, body or cylinder(), probe, {"accuracy": "1 %"})
    scene["material"]["relaxation"] = [{"share": share, "time": f"{time} s"} for share, time in _TERMS]
    plan = make_plan(parse(scene))
    return build(plan, compute(plan, comm)).squeeze()
