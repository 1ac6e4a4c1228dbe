"""A tool that deforms: Hertz's contact of two elastic bodies, limits, balances, bars, and what is refused."""

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.mesh.distribute import distribute
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.scene.model import PROBE, TOOL
from epsmesh.solve.compiled import vector_space
from epsmesh.solve.contact.surface import find_candidates
from epsmesh.solve.estimate import unresolved
from tests.cases import NO_SIZES, raw, refusal, solve, study

BALL: dict[str, Any] = {"shape": "sphere", "radius": "5 mm", "depth": "0.2 mm", "contact": "unilateral"}
SOFT: dict[str, Any] = BALL | {"young": "30 kPa", "poisson": 0.3}
WEDGE: dict[str, Any] = SOFT | {"shape": "wedge", "angle": "60 deg", "length": "10 mm", "tip": "2 mm", "height": "4 mm"}
del WEDGE["radius"]
MESH = {"fine": "4 mm", "coarse": "12 mm", "rim": "0.3 mm"}
# Contact of a hundredth of the radius, on a body of 200 contact radii: two elastic half-spaces.
FLAT: dict[str, Any] = {
    "body": {"size": ["200 mm", "200 mm", "100 mm"]},
    "mesh": {"fine": "20 mm", "coarse": "20 mm", "rim": "0.06 mm"},
}
WIDE: dict[str, Any] = BALL | {"radius": "50 mm", "depth": "5 um"}
GRAVITY: dict[str, Any] = {
    "material": {"density": "1060 kg/m^3"},
    "load": {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]},
}


def one(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Any:
    """Return the record of one case."""
    (record,) = solve(comm, **{"probe": SOFT, "mesh": MESH} | changes).values()
    assert record.status == "ok", record.message
    return record


def plane(young: float, poisson: float) -> float:
    return young / (1 - poisson**2)


@pytest.mark.parametrize(("young", "poisson"), [(100e3, 0.3), (10e3, 0.3), (3e3, 0.45), (20e3, 0.49)])
def test_two_elastic_bodies_have_the_force_of_hertz(young, poisson):
    """1/E* is the sum of both. F of the finite bodies is 2 % above that of half-spaces, as of a rigid ball."""
    found = one(probe=WIDE | {"young": f"{young} Pa", "poisson": poisson}, **FLAT)
    both = 1 / (1 / plane(10e3, 0.3) + 1 / plane(young, poisson))
    hertz = 4 / 3 * both * 50e-3**0.5 * 5e-6**1.5
    assert abs(found.force - hertz) < found.force * found.force_error < 0.05 * hertz
    assert abs(found.contact_radius / (50e-3 * 5e-6) ** 0.5 - 1) < found.contact_radius_error < 0.05
    shortening, bar = (found.largest[f"tool_shortening{end}"] for end in ("", "_error"))
    assert abs(shortening - 5e-6 * both / plane(young, poisson)) < bar + 0.01 * 5e-6


def test_a_stiff_tool_is_rigid():
    rigid, stiff = (one(probe=BALL | more) for more in ({}, {"young": "1 GPa", "poisson": 0.3}))
    assert abs(stiff.force - rigid.force) < stiff.force * stiff.force_error + rigid.force * rigid.force_error
    assert stiff.largest["tool_shortening"] < 1e-4 * 0.2e-3
    # Strain is that of the tissue.
    assert stiff.largest["max_strain"] == pytest.approx(rigid.largest["max_strain"], rel=0.1)


@pytest.mark.parametrize(
    "turned",
    [{}, pytest.param({"direction": [0.6, 0.8, 0.0], "at": ["4 mm", "2 mm"]}, marks=pytest.mark.nightly)],
    ids=["along x", "turned"],
)
def test_a_stiff_wedge_is_rigid(turned):
    """Its ends are sharp: the forces below them converge slowly, and alike."""
    keys = {key: WEDGE[key] for key in WEDGE if key not in ("young", "poisson", "height")}
    rough = MESH | {"rim": "0.6 mm", "growth": 1.0}
    rigid, stiff = (one(probe=keys | turned | more, mesh=rough) for more in ({}, {"young": "1 GPa", "poisson": 0.3}))
    assert abs(stiff.force - rigid.force) < stiff.force * stiff.force_error + rigid.force * rigid.force_error
    assert stiff.force == pytest.approx(rigid.force, rel=0.02)


def test_a_softer_tool_presses_less():
    forces = [one(probe=SOFT | {"young": young}).force for young in ("3 kPa", "30 kPa", "300 kPa")]
    assert forces == sorted(forces)


@pytest.mark.parametrize("changes", [{}, {"probe": SOFT | {"poisson": 0.5}}, GRAVITY], ids=["linear", "mixed", "loads"])
def test_what_acts_on_the_tool_acts_on_tissue_and_mount(changes):
    """The balance is that of the tool's force, the support's and the mount's."""
    assert one(**changes).balance < 1e-8


@pytest.mark.parametrize(
    "probe",
    [
        SOFT,
        pytest.param(SOFT | {"poisson": 0.5}, marks=pytest.mark.nightly),
        pytest.param(SOFT | {"height": "3 mm"}, marks=pytest.mark.nightly),
        pytest.param(SOFT | {"shape": "disc", "edge": "1 mm", "depth": "0.1 mm"}, marks=pytest.mark.nightly),
        SOFT | {"shape": "cone", "angle": "75 deg"},
        pytest.param(WEDGE, marks=pytest.mark.nightly),
    ],
    ids=["ball", "incompressible", "low", "disc", "cone", "wedge"],
)
def test_the_bars_cover_a_finer_mesh(probe):
    coarse, fine = (one(probe=probe, mesh=MESH | sizes) for sizes in ({}, {"rim": "0.12 mm", "fine": "2.5 mm"}))
    assert fine.force_error < coarse.force_error
    assert abs(coarse.force - fine.force) < coarse.force * coarse.force_error + fine.force * fine.force_error
    bars = coarse.largest["tool_shortening_error"] + fine.largest["tool_shortening_error"]
    assert abs(coarse.largest["tool_shortening"] - fine.largest["tool_shortening"]) < bars


@pytest.mark.nightly
def test_elements_larger_than_the_contact_widen_all_bars():
    found = one(mesh=MESH | {"rim": "3 mm", "fine": "4 mm"})
    least = unresolved(3e-3 / (5e-3 * 0.2e-3) ** 0.5)
    assert found.force_error >= least
    assert found.largest["tool_shortening_error"] >= least * found.largest["tool_shortening"]


def test_the_work_of_the_tool_is_the_energy_of_tissue_and_tool():
    shares = np.linspace(0, 1, 5)[1:]
    depths = [f"{0.2 * share**2:.6g} mm" for share in shares]
    probe = SOFT | {"depth": depths, "mesh_depths": [depths[0], depths[-1]]}
    found = [record for _, record in sorted(solve(probe=probe, mesh=MESH | {"rim": "0.1 mm"}).items())]
    # With d = t², F dd = 2 t F dt: Simpson's rule in t.
    slopes = [0.0, *(2 * 0.2e-3 * share * record.force for share, record in zip(shares, found, strict=True))]
    work = (slopes[0] + 4 * slopes[1] + 2 * slopes[2] + 4 * slopes[3] + slopes[4]) / 12
    assert work == pytest.approx(found[-1].energy, rel=0.01)


@pytest.mark.parametrize(("degree", "probe"), [(2, SOFT), (3, SOFT), (2, WEDGE)])
def test_a_pressure_along_the_axis_has_the_same_nodal_forces_on_both_faces(degree, probe):
    """A patch test of the coupling: nodes, and shares of a uniform pressure, are above each other."""
    case = study(probe=probe, mesh=MESH).case(())
    body = distribute(MPI.COMM_SELF, mesh_arrays(case, ("x", "y")))
    on_tissue, on_tool = (find_candidates(body, vector_space(body.mesh, degree), groups=(g,)) for g in (PROBE, TOOL))
    tissue, tool = (np.lexsort(np.round(found.points[:, :2].T, 12)) for found in (on_tissue, on_tool))
    assert on_tool.points[tool, :2] == pytest.approx(on_tissue.points[tissue, :2], abs=1e-15)
    assert on_tool.weights[tool] == pytest.approx(on_tissue.weights[tissue], abs=1e-12 * on_tissue.weights.max())
    height = case.probe.profile(on_tool.points[:, :2])
    assert on_tool.points[:, 2] == pytest.approx(height, abs=1e-6)


SKIN = {"name": "skin", "thickness": "6 mm", "young": "30 kPa", "poisson": 0.3}
LUMP = {"name": "lump", "at": ["0 mm", "0 mm", "-8 mm"], "radius": "3 mm", "young": "1 MPa", "poisson": 0.3}


@pytest.mark.parametrize(
    "body",
    [
        {"layer": [SKIN]},
        {"fixed": "none", "support": {"on": "bottom", "friction": "stick"}},
        pytest.param({"inclusion": [LUMP]}, marks=pytest.mark.nightly),
        pytest.param({"capsule": {"on": "free", "young": "1 MPa", "thickness": "0.1 mm"}}, marks=pytest.mark.nightly),
    ],
    ids=["layer", "support", "inclusion", "capsule"],
)
def test_with_more_tissue_a_stiff_tool_is_rigid_too(body):
    rigid, stiff = (one(probe=BALL | more, body=body) for more in ({}, {"young": "1 GPa", "poisson": 0.3}))
    assert abs(stiff.force - rigid.force) < stiff.force * stiff.force_error + rigid.force * rigid.force_error


def test_the_tool_may_be_beside_the_middle_and_on_a_side():
    middle, beside, side = (
        one(probe=SOFT | at) for at in ({}, {"at": ["5 mm", "3 mm"]}, {"at": ["20 mm", "0 mm", "-10 mm"]})
    )
    assert beside.force == pytest.approx(middle.force, rel=0.05)
    assert side.force == pytest.approx(middle.force, rel=0.1)
    assert side.force_vector[0] == pytest.approx(side.force)


def test_few_linear_solves():
    found = one()
    assert found.iterations <= 11  # and one for its bar


@pytest.mark.nightly
def test_a_factorisation_finds_what_iterations_find():
    iterated, factorised = (one(solve={"method": method}) for method in ("iterative", "direct"))
    assert factorised.force == pytest.approx(iterated.force, rel=1e-7)


@pytest.mark.mpi
def test_two_ranks_find_the_same():
    alone, both = (one(comm) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-7)
    for name in ("tool_shortening", "max_strain"):
        assert both.largest[name] == pytest.approx(alone.largest[name], rel=1e-5)


def test_its_keys_are_dimensions_of_their_own():
    names = [axis.name for axis in study(probe=SOFT | {"young": ["30 kPa", "1 MPa"], "height": ["5 mm", "6 mm"]}).axes]
    assert names == ["probe_young", "probe_height"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"probe": BALL | {"young": "30 kPa"}}, "probe.poisson"),
        ({"probe": BALL | {"height": "3 mm"}}, "add `young`"),
        ({"probe": SOFT | {"height": "0.5 mm"}}, "must be at least 0.98"),
        ({"probe": SOFT | {"depth": "2.5 mm"}}, "its side is steep"),
        ({"probe": SOFT | {"shape": "disc"}}, "is rigid"),
        ({"probe": WEDGE | {"edge": "0.5 mm"}}, "flat ends"),
        ({"probe": WEDGE | {"angle": "20 deg", "depth": "2.5 mm"}}, "its side is steep"),
        ({"probe": SOFT | {"shape": "paraboloid", "shaft": "4 mm"}}, "is rigid"),
        ({"probe": SOFT, "material": {"law": "neo-hookean"}}, "a law of large displacements"),
        ({"probe": SOFT | {"axis": [0.1, 0.0, -1.0]}}, "at right angles"),
        ({"probe": SOFT, "mesh": NO_SIZES | {"accuracy": "1 %"}}, "given sizes"),
        ({"probe": SOFT | {"history": {"ramp": "1 s"}}}, "time steps"),
        ({"probe": SOFT, "solve": {"influence": True}}, "below a tool that deforms"),
    ],
)
def test_what_is_not_computed_is_refused(changes, said):
    assert said in refusal(raw(**changes))
