"""A blade that stands in a slit: what the slit's front releases, against closed forms and the change of energy."""

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from pipeline import compat
from pipeline.run.meshing import mesh_case
from pipeline.run.problem import conditions_of, loads_of
from pipeline.solve.crack import Release
from pipeline.solve.quasi_static import QuasiStaticProblem
from pipeline.solve.rim import clear_cells
from pipeline.solve.spaces import Spaces
from pipeline.verify.slits import strip
from tests.cases import BLADE, solve, study
from tests.solve.test_mixed import law

QUARTER = ("x", "y")
BODY = {"shape": "box", "size": ["20 mm", "16 mm", "12 mm"], "fixed": "bottom"}
SLIT_BLADE = {**BLADE, "length": "6 mm", "width": "1 mm", "incision": "4 mm"}
COARSEST = {"rim": "0.5 mm", "growth": 1.0, "fine": "4 mm"}
COARSE = {"rim": "0.3 mm", "growth": 0.7, "fine": "3 mm"}


def case_of(mesh=COARSE, body=BODY, **probe):
    return study(body=body, probe={**SLIT_BLADE, **probe}, mesh=mesh).case(())


def run(case, mirrors=QUARTER, kind="displacement", poisson=0.3, comm=MPI.COMM_SELF, **options):
    mesh = mesh_case(case, mirrors, comm)
    with Spaces(mesh) as spaces, QuasiStaticProblem(spaces, case.mesh.degree, conditions_of(case), kind) as problem:
        return problem.solve(law(poisson), loads_of(case), **options)


def finer(solution):
    """Return energy (J) and release (J/m) as elements of one degree more have them."""
    amounts = solution.response.amounts
    energy = solution.energy - float(amounts @ solution.decrements @ amounts) / 2
    return energy, float(amounts @ solution.front.finer @ amounts)


@cache
def quarter():
    return run(case_of(), estimate=True)


def test_strip():
    """A long crack in a strip of half height h, whose edges are moved by ± δ, releases E δ²/h at ν = 0 (J. R. Rice,
    J. Appl. Mech. 35, 379, 1968).
    """
    released, bar = strip(MPI.COMM_SELF, 2)
    error = abs(released / 0.02 - 1)  # 10 kPa (0.1 mm)² / 5 mm
    assert error < 0.003
    assert error < bar < 0.01


def test_change_of_energy():
    """A front that is deeper, below the same blade, releases what the energy loses: within 2 %."""
    step = 0.15e-3
    found = [
        finer(run(case_of(ends="open", incision=f"{4 + 1e3 * s} mm", ahead=f"{1 + 1e3 * s} mm"), estimate=True))
        for s in (-step, 0.0, step)
    ]
    (before, _), (_, release), (after, _) = found
    assert release == pytest.approx((before - after) / (2 * step), rel=0.02)


def test_strain_is_read_clear_of_the_front():
    """Of the cells about it, and of no other."""
    case = case_of()
    mesh = mesh_case(case, QUARTER, MPI.COMM_SELF)
    front = conditions_of(case).front
    whole, clear = clear_cells(mesh), clear_cells(mesh, front)
    corners = compat.geometry_dofs(mesh.mesh)[: mesh.owned_cells, :4]
    _, y, z = mesh.mesh.geometry.x[corners].mean(axis=1).T
    away = np.hypot(y, z + 4e-3)
    assert np.array_equal(clear, whole & (away > away[whole & ~clear].max()))
    assert 0 < np.count_nonzero(whole & ~clear) < 30


def test_what_pairs_of_motions_release_is_that_of_their_sums():
    form = np.array([[2.0, 0.3, -0.7], [0.3, 1.0, 0.2], [-0.7, 0.2, 4.0]])

    class Known(Release):
        def __init__(self):
            self.amounts = np.zeros(3)

        def __call__(self):
            return float(self.amounts @ form @ self.amounts)

    release = Known()
    assert release.matrix(3, lambda amounts: setattr(release, "amounts", amounts)) == pytest.approx(form)


def test_flanks_that_slide():
    """What it takes to push a blade on, with the front where it is, is what the energy gains: within the bar."""
    step = 0.15e-3
    found = [
        run(case_of(contact="frictionless", ends="open", ahead=f"{1 + 1e3 * s} mm"), estimate=True)
        for s in (-step, 0.0, step)
    ]
    (deeper, here, less_deep), amounts = found, found[1].response.amounts
    slope = (finer(deeper)[0] - finer(less_deep)[0]) / (2 * step)
    assert -float(amounts @ here.tip.finer @ amounts) == pytest.approx(slope, rel=0.03)
    assert here.reaction[2] == pytest.approx(slope, rel=here.tip.bar)
    assert 0.02 < here.tip.bar < 0.1
    best = here.extrapolated(2, "displacement", elsewhere=True)
    assert best.reaction[2] == pytest.approx(slope, rel=0.03)
    assert here.balance < 1e-6


def test_symmetry():
    """A quarter of the body gives what the whole does, whose slit is made by reflection."""
    whole = run(case_of(), ())
    assert whole.release == pytest.approx(quarter().release, rel=1e-5)
    assert whole.reaction[2] == pytest.approx(quarter().reaction[2], rel=1e-6)
    assert whole.energy == pytest.approx(quarter().energy, rel=1e-8)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("mirrors", "place"), [(("x",), {"at": ["0 mm", "0.01 mm"]}), ((), {"direction": [1.0, 0.01, 0.0]})]
)
def test_doubled_nodes(mirrors, place):
    """A slit inside the mesh, a little off the plane of symmetry or turned a little, opens as the one in it does."""
    inside = run(case_of(**place), mirrors, comm=MPI.COMM_WORLD)
    assert inside.release == pytest.approx(quarter().release, rel=quarter().release_bar)
    assert inside.reaction[2] == pytest.approx(quarter().reaction[2], rel=0.01)
    assert inside.energy == pytest.approx(quarter().energy, rel=0.005)
    assert inside.balance < 1e-6


def test_mixed_elements():
    """Both kinds of elements agree within their bars where both serve."""
    one, other = quarter(), run(case_of(), kind="mixed", estimate=True)
    for name, bar in (("release", "release_bar"), ("energy", "bar")):
        apart = abs(getattr(one, name) - getattr(other, name)) / getattr(one, name)
        assert apart < getattr(one, bar) + getattr(other, bar)
    assert finer(one) == pytest.approx(finer(other), rel=0.01)


def test_bar_of_release():
    """The bars hold the truth, from elements of degree 3 on a finer mesh, and are of its order."""
    fine = run(case_of({"rim": "0.2 mm", "growth": 0.6, "fine": "3 mm", "degree": 3}), estimate=True)
    truth = fine.extrapolated(3, "displacement")
    found = quarter()
    best = found.extrapolated(2, "displacement", elsewhere=True)
    for solution in (found, best):
        error = abs(solution.release / truth.release - 1)
        assert error < solution.release_bar < 0.15


def test_study_of_incisions():
    """Deeper blades take more force; F is proportional to Young's modulus, not to depth; the slit's faces slide
    with the blade, and its front does not tell.
    """
    probe = {**SLIT_BLADE, "incision": ["3 mm", "4 mm"]}
    material = {"young": ["10 kPa", "20 kPa"], "poisson": 0.3}
    records = solve(body=BODY, probe=probe, mesh=COARSEST, material=material)
    assert all(record.status == "ok" for record in records.values())
    force, release = (np.array([[getattr(records[i, j], name) for j in (0, 1)] for i in (0, 1)])
                      for name in ("force", "energy_release"))  # fmt: skip
    assert (force[:, 1] > 1.1 * force[:, 0]).all()
    assert force[1] == pytest.approx(2 * force[0], rel=1e-12)
    assert release[1] == pytest.approx(2 * release[0], rel=1e-12)
    slid = solve(body=BODY, probe={**SLIT_BLADE, "slice": "0.2 mm"}, mesh=COARSEST)[()]
    pressed = records[0, 1]
    assert slid.energy_release == pytest.approx(pressed.energy_release, rel=1e-3)
    assert slid.force == pytest.approx(pressed.force, rel=1e-5)
    assert slid.energy > pressed.energy
    sliding = {**SLIT_BLADE, "contact": "frictionless", "incision": "4 mm"}
    soft, stiff = solve(body=BODY, probe=sliding, mesh=COARSEST, material=material).values()
    assert 0 < soft.force < force[0, 1]
    assert 0 < soft.force_error < 0.3
    assert (stiff.force, stiff.energy_release) == pytest.approx((2 * soft.force, 2 * soft.energy_release), rel=1e-12)
