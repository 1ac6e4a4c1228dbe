"""A blade in a slit: the energy release rate of the front, compared with closed forms and the change of energy."""

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh import compat
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import conditions_of, movement_of
from epsmesh.solve.cell_values import clear_cells
from epsmesh.solve.convergence import Convergence
from epsmesh.solve.crack import Release, moved_on
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from tests.cases import BLADE, solve, study
from tests.solve.test_mixed import law

QUARTER = ("x", "y")
BODY = {"shape": "box", "size": ["20 mm", "16 mm", "12 mm"], "fixed": "bottom"}
SLIT_BLADE = {**BLADE, "length": "6 mm", "width": "1 mm", "incision": "4 mm"}
COARSEST = {"rim": "0.5 mm", "growth": 1.0, "fine": "4 mm"}
COARSE = {"rim": "0.3 mm", "growth": 0.7, "fine": "3 mm"}


def case_of(mesh=COARSE, body=BODY, load=None, **probe):
    material = {"density": "1060 kg/m^3"} if load else {}
    return study(body=body, probe={**SLIT_BLADE, **probe}, mesh=mesh, material=material, load=load or {}).case(())


def run(case, mirrors=QUARTER, kind="displacement", poisson=0.3, comm=MPI.COMM_SELF, **options):
    mesh = mesh_case(case, mirrors, comm)
    with Spaces(mesh) as spaces, QuasiStaticProblem(spaces, case.mesh.degree, conditions_of(case), kind) as problem:
        return problem.solve(law(poisson), movement_of(case), **options)


def finer(solution):
    """Return potential energy (J) and release (J/m) in elements of one degree more."""
    line, loaded = solution.front, solution.load_response
    form, decrements = (solution.stiffness, solution.decrements) if loaded is None else (loaded.form, loaded.decrements)
    energy = float(line.amounts @ (form - decrements) @ line.amounts) / 2
    return energy, float(line.amounts @ line.finer @ line.amounts)


@cache
def quarter():
    return run(case_of(), estimate=True)


def test_change_of_energy():
    """A deeper front below the same blade releases the loss of energy: within 2 %."""
    step = 0.15e-3
    found = [
        finer(run(case_of(ends="open", incision=f"{4 + 1e3 * s} mm", ahead=f"{1 + 1e3 * s} mm"), estimate=True))
        for s in (-step, 0.0, step)
    ]
    (before, _), (_, release), (after, _) = found
    assert release == pytest.approx((before - after) / (2 * step), rel=0.02)


# They pull the faces apart, and along the sides at which the front ends; the edge of the cap is in the moved region.
LOADS = {
    "gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"],
    "traction": [
        {"on": "sides", "pressure": "-0.3 kPa"},
        {"on": {"around": ["10 mm", "0 mm", "-3.5 mm"], "radius": "1.5 mm"}, "traction": ["0 Pa", "0 Pa", "-3 kPa"]},
    ],
}


@pytest.mark.parametrize("kind", [pytest.param("displacement", marks=pytest.mark.nightly), "mixed"])
def test_change_of_energy_under_loads(kind):
    """The release is the loss of potential energy of blade and loads, as nodes move with the front or the tip.

    Half of it belongs to the loads.
    """
    case, step = case_of(load=LOADS, ends="open", contact="frictionless"), 1e-6
    mesh, conditions = mesh_case(case, QUARTER, MPI.COMM_SELF), conditions_of(case)

    def solved():
        with Spaces(mesh) as spaces, QuasiStaticProblem(spaces, 2, conditions, kind) as problem:
            return problem.solve(law(0.3), movement_of(case), method="direct")

    def energy(front, step):
        with moved_on(mesh, front, step):
            found = solved()
            return float(found.front.amounts @ found.load_response.form @ found.front.amounts) / 2

    here = solved()
    for line, advance in ((conditions.front, here.front), (conditions.tip, here.tip)):
        slope = (energy(line, step) - energy(line, -step)) / (2 * step)
        assert -advance.released == pytest.approx(slope, rel=1e-5)
        assert abs(advance.of_loads().released) > 0.3 * abs(advance.released)
    assert here.reaction[2] + here.load_force[2] == pytest.approx(slope, rel=1e-5)


def test_loads_that_close_a_slit():
    """A pressure on all sides closes it at its front: the case fails, and the message says why."""
    pressed = {"traction": [{"on": "sides", "pressure": "2 kPa"}]}
    (record,) = solve(body=BODY, probe={**SLIT_BLADE, "incision": "4 mm"}, mesh=COARSEST, load=pressed).values()
    assert record.status == "failed"
    assert "the loads press the slit shut" in record.message


def test_a_study_of_a_slit_under_loads():
    """The loads' force on a sliding blade has a bar; the loads open the slit, and pull the blade in."""
    probe = {**SLIT_BLADE, "incision": "4 mm"}
    movement = {"traction": [{"on": "sides", "pressure": "-0.3 kPa"}]}
    alone = solve(body=BODY, probe=probe, mesh=COARSEST)[()]
    bonded = solve(body=BODY, probe=probe, mesh=COARSEST, load=movement)[()]
    slid = solve(body=BODY, probe={**probe, "contact": "frictionless"}, mesh=COARSEST, load=movement)[()]
    assert bonded.force == pytest.approx(alone.force, rel=1e-9)
    assert bonded.energy_release > 1.3 * alone.energy_release
    assert bonded.load_force_error > 0
    assert slid.load_force < 0 < slid.force
    assert 0 < slid.load_force_error < 0.3 * abs(slid.load_force)


def test_strain_is_taken_clear_of_the_front():
    """Cells around it are left out, and no others."""
    case = case_of()
    mesh = mesh_case(case, QUARTER, MPI.COMM_SELF)
    front = conditions_of(case).front
    whole, clear = clear_cells(mesh), clear_cells(mesh, front)
    corners = compat.geometry_dofs(mesh.mesh)[: mesh.owned_cells, :4]
    _, y, z = mesh.mesh.geometry.x[corners].mean(axis=1).T
    away = np.hypot(y, z + 4e-3)
    assert np.array_equal(clear, whole & (away > away[whole & ~clear].max()))
    assert 0 < np.count_nonzero(whole & ~clear) < 30


def test_release_is_quadratic_in_the_motions():
    form = np.array([[2.0, 0.3, -0.7], [0.3, 1.0, 0.2], [-0.7, 0.2, 4.0]])

    class Known(Release):
        def __init__(self):
            self.amounts = np.zeros(3)

        def __call__(self):
            return float(self.amounts @ form @ self.amounts)

    release = Known()
    assert release.matrix(3, lambda amounts: setattr(release, "amounts", amounts)) == pytest.approx(form)


def test_flanks_that_slide():
    """The force that drives a blade on, with a fixed front, is the gain of energy: within the bar."""
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
    best = here.extrapolated(Convergence(degree=2, element="displacement", has_others=True))
    assert best.reaction[2] == pytest.approx(slope, rel=0.03)
    assert here.balance < 1e-6


def test_fronts_nearer_to_the_ends_of_the_blade():
    """Less is cut there: more is stored, by about what the front below releases per area."""
    far, near, step = quarter(), run(case_of(beside="0.8 mm"), estimate=True), 0.2e-3
    mean = finer(far)[1] / (2 * 4e-3)  # of the front below
    released = (finer(near)[0] - finer(far)[0]) / (2 * step * 4e-3)
    assert 0.3 * mean < released < 1.5 * mean


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("mirrors", "place"), [(("x",), {"at": ["0 mm", "0.01 mm"]}), ((), {"direction": [1.0, 0.01, 0.0]})]
)
def test_doubled_nodes(mirrors, place):
    """A slit inside the mesh, slightly off the plane of symmetry or rotated, opens like the one in that plane."""
    inside = run(case_of(**place), mirrors, comm=MPI.COMM_WORLD)
    assert inside.release == pytest.approx(quarter().release, rel=quarter().release_bar)
    assert inside.reaction[2] == pytest.approx(quarter().reaction[2], rel=0.01)
    assert inside.energy == pytest.approx(quarter().energy, rel=0.005)
    assert inside.balance < 1e-6


def test_mixed_elements():
    """Both kinds of elements agree within their bars at a ratio that both support."""
    one, other = quarter(), run(case_of(), kind="mixed", estimate=True)
    for name, bar in (("release", "release_bar"), ("energy", "bar")):
        apart = abs(getattr(one, name) - getattr(other, name)) / getattr(one, name)
        assert apart < getattr(one, bar) + getattr(other, bar)
    assert finer(one) == pytest.approx(finer(other), rel=0.01)


def test_bar_of_release():
    """The bars cover the truth, from elements of degree 3 on a finer mesh, and are of the same order."""
    fine = run(case_of({"rim": "0.2 mm", "growth": 0.6, "fine": "3 mm", "degree": 3}), estimate=True)
    truth = fine.extrapolated(Convergence(degree=3, element="displacement"))
    found = quarter()
    best = found.extrapolated(Convergence(degree=2, element="displacement", has_others=True))
    for solution in (found, best):
        error = abs(solution.release / truth.release - 1)
        assert error < solution.release_bar < 0.15


def test_study_of_incisions():
    """Deeper blades have a larger force. F is proportional to Young's modulus, not to the depth. A bonded slice moves
    the faces with the blade, and leaves the energy release at the front unchanged.
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
