"""Small studies for the tests, solved by the program's own run."""

import json
from typing import Any

import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.record import Record
from epsmesh.shapes.probe import Probe
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from epsmesh.study.sweep import Study
from tests.studies import changed

BASE: dict[str, Any] = {
    "body": {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"},
    "material": {"young": "10 kPa", "poisson": 0.3},
    "probe": {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm"},
    "mesh": {"epsilon": "full", "fine": "5 mm", "coarse": "8 mm", "rim": "1 mm", "growth": 0.8, "degree": 2},
    "solve": {"exact": False},
    "plan": {"without": ["axisymmetric"]},
}

# A mesh for what holds on any: limits, balances, symmetries, equalities of two ways.
ROUGH: dict[str, Any] = {"fine": "10 mm", "coarse": "10 mm", "rim": "2 mm", "growth": 1.0}
# In a mesh of an accuracy, no sizes are given.
NO_SIZES = dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth", "degree"))
_SOLVED: dict[tuple[int, str], Record] = {}
BLADE: dict[str, Any] = {"shape": "blade", "length": "10 mm", "width": "3 mm", "depth": "0.1 mm"}


def raw(**changes: Any) -> dict[str, Any]:
    """Return the base study with changes: see :func:`tests.studies.changed`."""
    return changed(BASE, **changes)


def study(**changes: Any) -> Study:
    """Return the base study with changes, parsed."""
    return parse(raw(**changes))


def refusal(content: dict[str, Any]) -> str:
    """Return what is said of a study that is refused."""
    with pytest.raises(StudyError) as caught:
        parse(content)
    return str(caught.value)


def probe(**keys: Any) -> Probe:
    """Return the tool of a study, by its keys."""
    return study(probe=keys).case(()).probe


def solve(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> dict[tuple[int, ...], Record]:
    """Run the base study with changes and return the record of every case, each place's own, by index."""
    plan = make_plan(study(**changes), without=("mirrored", "translated"))
    records = compute(plan, comm)
    return {
        case.index: records[key].scaled(plan.scale_of(case))
        for case, key in zip(plan.study.cases(), plan.keys, strict=True)
    }


def solved(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Record:
    """Return the record of a study of one case, which is solved once for all tests of a process."""
    key = comm.size, json.dumps(changes, sort_keys=True)
    if key not in _SOLVED:
        (record,) = solve(comm, **changes).values()
        assert record.status == "ok", record.message
        _SOLVED[key] = record
    return _SOLVED[key]


def force(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> float:
    """Run a study of one case and return its force (N)."""
    (record,) = solve(comm, **changes).values()
    assert record.status == "ok", record.message
    return record.force
