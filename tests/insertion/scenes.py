"""A scene of an insertion, and a body whose states have closed forms."""

import numpy as np

from epsmesh.insertion.near_tip import NearTip, strength
from epsmesh.insertion.paths import lacking
from epsmesh.plan.plan import make_plan
from epsmesh.run.record import Record
from epsmesh.states import FAILED, OK

LENGTH, WIDTH, YOUNG, POISSON = 8e-3, 0.4e-3, 20e3, 0.3
STIFFNESS, GROWTH, FAR = 80.0, 1e-3, 5e-3  # N/m, N, m
BLADE = {
    "shape": "blade",
    "length": "8 mm",
    "width": "0.4 mm",
    "contact": "unilateral",
    "friction": 0.25,
    "toughness": "5 J/m^2",
    "insertion": {"to": "6 mm", "steps": 12},
}
SCENE = {
    "body": {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"},
    "material": {"young": "20 kPa", "poisson": POISSON},
    "probe": BLADE,
    "mesh": {"accuracy": "10 %"},
}
# Of a round needle; the tool is the test's.
SHAFT = {
    "body": {"shape": "cylinder", "radius": "30 mm", "height": "40 mm"},
    "material": {"young": "30 kPa", "poisson": 0.49, "law": "neo-hookean"},
    "mesh": {"accuracy": "2 %"},
}
FIELD = NearTip(strength(YOUNG, POISSON, WIDTH / 2), 700.0)


def answered(study, record):
    """Return the plan of a study, and what ``record`` returns for its solves, and for those that follow from these."""
    plan = further = make_plan(study)
    records = {}
    while further:
        records |= {solve.key: record(solve) for solve in further.solves}
        further = lacking(plan, records)
    return plan, records


def stored(depth, ahead, beside=None):
    """Return the energy (J) of the body with a slit, whose front is as far beside the blade if that is not given."""
    beside = ahead if beside is None else beside
    corners = (FIELD.corners(ahead, FAR) + FIELD.corners(beside, FAR)) / 2
    return GROWTH * depth + LENGTH * FIELD.per_length(ahead, FAR) + 2 * depth * FIELD.per_length(beside, FAR) + corners


def elastic(depth, ahead):
    """Return the change of that energy with the depth (N), with the front at a fixed distance."""
    return GROWTH + 2 * FIELD.per_length(ahead, FAR)


def _record(key, case, bar, deepest):
    slit = case.probe.slit
    if slit is not None and slit.depth > deepest:
        return Record(key, FAILED, "the mesh is too coarse")
    scale = {"young": case.scale.stress, "depth": case.scale.length, "force_error": bar}
    if slit is None:
        force = STIFFNESS * case.probe.depth
        return Record(key, OK, force=force, energy=force * case.probe.depth / 2, **scale)
    release = FIELD.release(slit.ahead)
    drive = elastic(slit.tip, slit.beside) + (LENGTH + 2 * slit.ahead) * release
    of_front = {"energy_release": release, "energy_release_error": bar}
    return Record(key, OK, force=drive, energy=stored(slit.tip, slit.ahead, slit.beside), **of_front, **scale)


def solved(study, bar=1e-3, deepest=np.inf):
    """Return the plan of a study of that body, and its records; states below the ``deepest`` front (m) fail."""
    return answered(study, lambda solve: _record(solve.key, solve.case, bar, deepest))
