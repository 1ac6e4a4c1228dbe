"""A dataset such as a study yields, made without solving anything."""

import itertools

import numpy as np

from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.record import Record
from epsmesh.study.read import parse
from tests.cases import BLADE, raw
from tests.fuzz.studies import toml


def dataset(failed: int = 0, pending: int = 0, **changes):
    """Return the dataset of a study with forces that follow the curves that real ones have."""
    return build(*planned(failed, pending, **changes), {"start": "2026-01-01"})


def planned(failed: int = 0, pending: int = 0, **changes):
    """Return the plan of that study and its records, by key."""
    content = raw(**changes)
    plan = make_plan(parse(content, text=toml(content)))
    records = {}
    for number, solve in enumerate(plan.solves):
        case = solve.case
        epsilon = 40e-3 if case.is_full else case.mesh.epsilon
        ratio = {"coarse": 1 + 0.3 * np.exp(-epsilon / 4e-3), "free": 1 - np.exp(-epsilon / 5e-3),
                 "fixed": 1 + 9 * np.exp(-epsilon / 4e-3)}["coarse" if case.is_full else case.mesh.outside]  # fmt: skip
        force = 0.02 * ratio * (1 + case.material.poisson)
        seconds = 4 * (epsilon / 40e-3) ** (1.5 + 0.2 * case.material.poisson + 500 * case.probe.depth)
        records[solve.key] = Record(
            solve.key, "ok", young=case.material.young, depth=case.probe.depth, force=force,
            force_error=0.01, force_vector=(0.0, 0.0, force), energy=force * 1e-4,
            largest={"max_strain": 0.1},
            balance=1e-12, dofs=1000, cells=300, iterations=9, memory=1e8, time_mesh=seconds,
            time_assemble=seconds, time_setup=seconds, time_solve=seconds, time_error=seconds,
            provenance={"host": "here", "ranks": 1},
        )  # fmt: skip
        if number < failed:
            records[solve.key] = Record(solve.key, "failed", "it went wrong")
    for key in itertools.islice(reversed(plan.keys), pending):
        records.pop(key, None)
    return plan, records


EPSILONS = ["4 mm", "5 mm", "7 mm", "10 mm", "15 mm", "20 mm", "full"]
FIGURE = {
    "probe": [
        {"name": "disc, pierce", **raw()["probe"], "radius": "2 mm"},
        {"name": "blade, cut", **BLADE, "length": "4 mm", "width": "1 mm"},
    ],
    "material": {"poisson": [0.30, 0.40, 0.45, 0.49]},
    "mesh": {"epsilon": EPSILONS, "outside": ["coarse", "free", "fixed"]},
}
