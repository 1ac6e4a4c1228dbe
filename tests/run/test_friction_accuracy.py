"""Accuracy with friction: F is within its bar of the meridian's frictionless force times the closed form."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.solve.convergence import Convergence
from epsmesh.solve.estimate import extrapolate_found
from epsmesh.study.read import parse
from tests.verification import known


def solved(friction, accuracy, law="linear", *, flat=False):
    """Return the record of a ball of 10 mm that is pressed in by 0.1 mm."""
    study = parse(
        {
            "body": {"shape": "cylinder", "radius": "20 mm", "height": "20 mm", "fixed": "bottom"},
            "material": {"young": "10 kPa", "poisson": 0.3, "law": law},
            "probe": {"shape": "sphere", "radius": "10 mm", "depth": "0.1 mm", "friction": friction},
            "mesh": {"accuracy": accuracy},
            "solve": {"exact": False},
        }
    )
    (record,) = compute(make_plan(study, without=() if flat else ("axisymmetric",)), MPI.COMM_SELF).values()
    return record


@pytest.mark.parametrize("law", ["linear", pytest.param("neo-hookean", marks=pytest.mark.nightly)])
def test_a_ball_to_which_tissue_sticks_is_within_the_accuracy(law):
    """At this depth neo-Hookean tissue has the force of a linear one up to some tenths of a per cent."""
    record = solved("stick", "1 %", law)
    truth = solved(0.0, "0.1 %", flat=True).force * known.stick_ratio(0.3, 2)
    assert record.status == "ok"
    assert record.force_error <= 0.01
    assert abs(record.force / truth - 1) <= record.force_error
    assert record.slip_area < 0.05 * record.contact_area


def test_friction_is_no_part_of_what_finer_elements_would_remove():
    """Extrapolation narrows the part of the bar for the mesh, and leaves the part for friction."""
    stiffness, decrements, bars = (np.array([[value]]) for value in (2.0, 0.02, 0.06))
    ball = Convergence(degree=2, element="displacement")
    _, smooth = extrapolate_found(stiffness, decrements, bars, ball)
    _, both = extrapolate_found(stiffness, decrements, bars + 0.02, replace(ball, friction_bar=0.01))
    assert both == pytest.approx(smooth + 0.02)
