"""Time steps of relaxing tissue: convolution where laws are linear, limits at once and after a long time, energies."""

from contextlib import ExitStack
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of, problem_of
from epsmesh.solve.history import Course, History
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import Spaces
from epsmesh.solve.time_steps import FootprintIndentation, TimeSteps
from epsmesh.viscoelastic import Motion, Terms, respond
from tests.cases import study

TERMS = ((0.4, 0.5), (0.2, 3.0))
LARGE = {"law": "neo-hookean", "poisson": 0.45}
LINEAR = {"poisson": 0.45}
SKIN = {"layer": [{"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.4}]}
# A jump, a ramp, unloading and a hold.
JUMP = (0.0, 0.5, 1.0, 3.0), (0.3, 1.0, 0.5, 0.5)
LONG = (0.0, 1.0, 300.0), (0.0, 1.0, 1.0)


def course_of(motion: tuple[tuple[float, ...], tuple[float, ...]], steps: int) -> Course:
    times = np.unique(np.concatenate([np.linspace(a, b, steps + 1) for a, b in pairwise(motion[0])]))
    breaks = np.flatnonzero(np.isin(times, motion[0]))
    return Course(tuple(times), tuple(np.interp(times, *motion)), frozenset(breaks.tolist()))


def followed(motion, *terms: Terms, steps: int = 4, **changes) -> tuple[History, float, float]:
    """Return the history, and force and energy of the elastic body; ``terms`` are those of each region."""
    (solve,) = make_plan(study(**changes)).solves
    mesh = mesh_case(solve.case, solve.mirrors, MPI.COMM_SELF, None)
    with Spaces(mesh) as spaces, problem_of(spaces, solve.case) as problem, ExitStack() as stack:
        law, movement, elements = law_of(solve.case), movement_of(solve.case), problem.elements
        static = problem.solve(law, movement)
        of_regions = terms if len(terms) > 1 else terms * len(law.parameters)
        each = zip(law.parameters, of_regions, strict=True)
        law = MaterialLaw(tuple(replace(one, relaxation=own) for one, own in each))
        elements.set_law(law)
        linear = elements.linearised(law, stack, direct=True)
        pressed = FootprintIndentation(elements, law, linear, movement, stack)
        course = course_of(motion, steps)
        found = TimeSteps(law, pressed, movement.amounts[0], stack, mirrored=mesh.mirrored).follow(course)
        return found, static.reaction[2], static.energy


@pytest.mark.parametrize(
    "changes",
    [
        {"material": LINEAR},
        {"material": LINEAR, "mesh": {"element": "mixed"}},
        {"material": LINEAR, "body": SKIN},
        {"material": LINEAR, "probe": {"contact": "frictionless"}},
    ],
)
def test_linear_tissue_is_the_convolution(changes):
    found, force, energy = followed(JUMP, TERMS, **changes)
    known, heat = respond(Motion(*JUMP), TERMS, found.times)
    assert found.forces[:, 2] == pytest.approx(force * known, abs=1e-7 * force)
    assert found.bars.max() < 1e-8 * force
    assert found.dissipated == pytest.approx(2 * energy * heat, rel=1e-6, abs=1e-9 * energy)


@pytest.mark.nightly
def test_work_is_stored_or_dissipated():
    found, _, energy = followed(JUMP, TERMS, material=LINEAR, steps=16)
    assert np.abs(found.imbalance).max() < 2e-3 * energy  # of the trapezoidal rule of the work
    assert (np.diff(found.dissipated) >= 0).all()
    large, _, energy = followed(JUMP, TERMS, material=LARGE, probe={"depth": "0.6 mm"})
    assert (np.diff(large.dissipated) >= 0).all()
    assert np.abs(large.imbalance).max() < 0.1 * large.dissipated[-1]


def test_a_law_of_large_displacements_begins_and_ends_elastic():
    """At once F is that of the elastic law, and after a long time what is left of it."""
    changes = {"material": LARGE, "probe": {"depth": "0.6 mm"}}
    motion = (0.0, 300.0), (1.0, 1.0)
    found, force, _ = followed(motion, TERMS, **changes)
    assert found.forces[0, 2] == pytest.approx(force, rel=1e-7)
    assert found.forces[-1, 2] == pytest.approx(0.4 * force, rel=1e-6)


@pytest.mark.parametrize("material", [pytest.param(LINEAR, marks=pytest.mark.nightly), LARGE])
def test_regions_that_relax_differently_end_as_a_body_of_their_long_term_moduli(material):
    """At once the moduli are those of the regions, after a long time what is left of each."""
    changes = {"material": material, "body": SKIN, "probe": {"depth": "0.4 mm"}}
    left = {"layer": [SKIN["layer"][0] | {"young": "48 kPa"}]}
    found, force, _ = followed(LONG, TERMS, ((0.2, 1.0),), **changes)
    _, known, _ = followed(
        ((0.0, 1.0), (0.0, 0.0)), (), **changes | {"body": left, "material": material | {"young": "4 kPa"}}
    )
    assert found.forces[-1, 2] == pytest.approx(known, rel=1e-6)
    alone, *_ = followed(LONG, TERMS, **changes)
    assert found.forces[4, 2] > 1.05 * alone.forces[4, 2]
    assert found.forces[4, 2] < force


@pytest.mark.nightly
def test_the_error_of_steps_falls_with_their_square_and_is_in_the_bar():
    changes = {"material": LARGE, "probe": {"depth": "0.75 mm"}}
    motion = (0.0, 1.0, 4.0), (0.0, 1.0, 1.0)
    runs = {steps: followed(motion, TERMS, steps=steps, **changes)[0] for steps in (4, 8, 16)}
    peaks = {steps: run.forces[steps, 2] for steps, run in runs.items()}
    errors = {steps: abs(peaks[steps] - peaks[16]) for steps in (4, 8)}
    assert 4 < errors[4] / errors[8] < 6
    for steps in (4, 8):
        bar = runs[steps].bars[steps]
        assert errors[steps] < bar < 5 * errors[steps]
        ends = runs[steps].forces[::steps, 2] - runs[16].forces[::16, 2]
        assert (np.abs(ends) <= runs[steps].bars[::steps]).all()


@pytest.mark.nightly
def test_steps_that_end_early_name_the_time_and_the_depth():
    with pytest.raises(LargeError, match=r"time steps reached .* s of 1 s, at a depth of .* mm") as caught:
        followed(((0.0, 1.0), (0.0, 16.0)), TERMS, steps=2, material=LARGE, probe={"depth": "1 mm"})
    assert caught.value.reached is not None
    depth, force = caught.value.reached
    assert 0.3e-3 < depth < 16e-3
    assert force > 0
