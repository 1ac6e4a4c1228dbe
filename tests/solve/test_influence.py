"""The influence is the derivative of F by the modulus at a place: sums, and differences of forces."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from epsmesh.arrays import FloatArray
from epsmesh.plan.plan import make_plan
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of, problem_of
from epsmesh.solve.compiled import cellwise_space, form, global_sum
from epsmesh.solve.measures import dx
from epsmesh.solve.physics import MaterialLaw, Parameters
from epsmesh.solve.points.state import State
from epsmesh.solve.solution import Request
from epsmesh.solve.spaces import Spaces
from tests.cases import study

WORLD = MPI.COMM_WORLD
# Of the modulus of a region, to both sides; the difference quotient of a force has the square of it as its error.
STEP = 0.01
# Of Poisson's ratio, downwards.
OF_POISSON = 0.001
BALL = {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "contact": "unilateral"}
BLADE = {"shape": "blade", "length": "8 mm", "width": "2 mm", "depth": "0.2 mm", "slice": "0.3 mm"}
ELLIPSOID = {"shape": "ellipsoid", "axes": ["24 mm", "22 mm", "20 mm"], "fixed": {"below": "-8 mm"}, "size": None}
NEO, OGDEN = {"law": "neo-hookean"}, {"law": "ogden", "terms": [{"share": 0.7, "alpha": 2.0}, {"alpha": 9.0}]}
FIELD = {"formula": "10 kPa * (1 + 0.5 * (x + y) / (20 mm) - 0.3 * z / (20 mm))"}
PULL = {"traction": [{"on": "free", "pressure": "0.5 kPa"}]}
HOLZAPFEL = {"law": "holzapfel", "fibres": {"direction": [1, 1, 0], "k1": 0.5, "k2": 2.0}}


def scene(poisson: float = 0.3, body: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    """Return changes of the base study: a box with a stiff skin and a lump, or another body with the lump."""
    soft = body is None
    lump = {"name": "lump", "at": ["0 mm", "0 mm", "-8 mm" if soft else "8 mm"], "radius": "3 mm"}
    regions: dict[str, Any] = {"inclusion": [lump | {"young": "50 kPa", "poisson": poisson}]}
    if soft:
        regions["layer"] = [{"name": "skin", "thickness": "3 mm", "young": "30 kPa", "poisson": poisson}]
    material = {"poisson": poisson} | changes.pop("material", {})
    return changes | {"body": (body or {}) | regions, "material": material}


CASES = {
    "bonded": scene(),
    "degree 1": {"mesh": {"degree": 1}, "body": {"layer": scene()["body"]["layer"]}},
    "degree 3": scene(mesh={"degree": 3}),
    "frictionless": scene(probe={"contact": "frictionless"}),
    "mixed": scene(0.49),
    "incompressible": scene(0.5),
    "sliding blade": scene(probe=BLADE | {"at": ["3 mm", "2 mm"]}),
    "six motions": scene(probe={"motion": "all"}),
    "ellipsoid": scene(body=ELLIPSOID, probe={"at": ["0 mm", "0 mm", "20 mm"]}),
    "tilted": scene(probe={"axis": [0.1736, 0.0, -0.9848]}),
    "found": scene(probe=BALL, mesh={"rim": "0.4 mm"}),
    "found, inclined": scene(probe=BALL | {"axis": [0.2588, 0.0, -0.9659]}, mesh={"rim": "0.4 mm"}),
    "found, degree 3": scene(probe=BALL, mesh={"rim": "0.4 mm", "degree": 3}),
    "found, incompressible": scene(0.5, probe=BALL, mesh={"rim": "0.4 mm"}),
    "found, flat": scene(probe={"contact": "unilateral"}),
    "neo-Hookean": scene(material=NEO),
    "Ogden": scene(material=OGDEN),
    "fibres": scene(material=HOLZAPFEL),
    "neo-Hookean, mixed": scene(0.49, material=NEO),
    "field": scene(material={"young": FIELD}),
    "field, found, mixed": scene(0.49, probe=BALL, mesh={"rim": "0.4 mm"}, material={"young": FIELD}),
    "loads": scene(load=PULL),
    "loads, mixed": scene(0.49, load=PULL),
    "linear beyond ε": scene(material=NEO, mesh={"epsilon": "8 mm", "outside": "linear"}),
    "found, neo-Hookean": scene(probe=BALL, mesh={"rim": "0.4 mm"}, material=NEO),
    "found, neo-Hookean, mixed": scene(0.49, probe=BALL, mesh={"rim": "0.4 mm"}, material=NEO),
}
BY_DAY = ("bonded", "incompressible", "neo-Hookean", "field", "loads")


class Scene:
    """A scene on its mesh, to be solved for several laws."""

    def __init__(self, changes: dict[str, Any], comm: MPI.Comm):
        (planned, *_) = make_plan(study(**changes)).solves
        self.case, self.comm, self.law = planned.case, comm, law_of(planned.case)
        self.mesh = mesh_case(self.case, planned.mirrors, comm, None)

    def force(self, law: MaterialLaw, *, influence: bool = False) -> tuple[float, State]:
        """Return the force, and the fields."""
        with Spaces(self.mesh) as spaces, problem_of(spaces, self.case) as problem:
            found = problem.answer(Request(law, movement_of(self.case), tolerance=1e-8, influence=influence))
            return found.reaction[2], problem.state()

    def shares(self, state: State, by: str = "young") -> FloatArray:
        """Return the integrals of the influence of a modulus over the regions of the whole body."""
        assert state.influence is not None
        owned, count = self.mesh.owned_cells, len(self.law.parameters)
        cell = ufl.TestFunction(cellwise_space(self.mesh.mesh, ()))
        volumes = fem.assemble_vector(form(cell * dx(state.displacement.function_space))).array[:owned]
        numbers = np.zeros(owned, int) if self.mesh.regions is None else self.mesh.regions[:owned]
        own = np.bincount(numbers, getattr(state.influence, by) * volumes, minlength=count)
        return 2.0 ** len(self.mesh.mirrored) * global_sum(self.comm, own)


def with_poisson(law: MaterialLaw, region: int, change: float) -> MaterialLaw:
    """Return a law with another Poisson's ratio of one region; what is in units of E stays so."""
    parameters = list(law.parameters)
    one = parameters[region]
    young, poisson = 2 * one.lame_mu * (1 + one.poisson), one.poisson + change
    stiff = (1 + poisson) / (1 + one.poisson)
    further = {name: value * stiff if name == "k1" else value for name, value in one.further}
    parameters[region] = Parameters.of_moduli(young, poisson, one.law, further)
    return MaterialLaw(tuple(parameters), law.unit)


def stiffer(law: MaterialLaw, region: int, factor: float) -> MaterialLaw:
    """Return a law with the moduli of one region times a factor."""
    parameters = list(law.parameters)
    one = parameters[region]
    parameters[region] = replace(one, lame_lambda=factor * one.lame_lambda, lame_mu=factor * one.lame_mu)
    return MaterialLaw(tuple(parameters), law.unit)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in BY_DAY else [pytest.mark.nightly]) for name in CASES]
)
def test_shares_are_derivatives_of_the_force_by_the_moduli(name):
    scene = Scene(CASES[name], WORLD)
    force, state = scene.force(scene.law, influence=True)
    shares = scene.shares(state)
    assert shares.sum() == pytest.approx(1.0, abs=1e-5)
    for region, share in enumerate(shares):
        more, less = (scene.force(stiffer(scene.law, region, 1 + sign * STEP))[0] for sign in (1, -1))
        assert share == pytest.approx((more - less) / (2 * STEP * force), abs=4e-5)
    for region, effect in enumerate(scene.shares(state, "poisson")):
        here, *below = (scene.force(with_poisson(scene.law, region, -n * OF_POISSON))[0] for n in range(3))
        slope = (3 * here - 4 * below[0] + below[1]) / (2 * OF_POISSON * force)
        assert effect == pytest.approx(slope, rel=2e-3, abs=2e-4)


def test_the_force_does_not_depend_on_whether_the_influence_is_asked_for():
    for name in ("bonded", "found", "neo-Hookean"):
        scene = Scene(CASES[name], WORLD)
        assert scene.force(scene.law)[0] == scene.force(scene.law, influence=True)[0]


@pytest.mark.mpi
@pytest.mark.parametrize("name", ["mixed", "found, neo-Hookean"])
def test_ranks_agree(name):
    alone, together = Scene(CASES[name], MPI.COMM_SELF), Scene(CASES[name], WORLD)
    one, several = (scene.shares(scene.force(scene.law, influence=True)[1]) for scene in (alone, together))
    assert several == pytest.approx(one, rel=1e-5)
