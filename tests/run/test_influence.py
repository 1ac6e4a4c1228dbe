"""Where F is decided, in records, datasets and solutions; reductions give the same, or are not taken."""

from typing import Any

import numpy as np
import pytest
import ufl
import xarray as xr
from dolfinx import fem
from mpi4py import MPI

import epsmesh
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.report.figures import choose, figure
from epsmesh.run.execute import compute
from epsmesh.study.influence import DECIDED
from epsmesh.study.read import parse
from tests.cases import raw, refusal

WORLD = MPI.COMM_WORLD
SKIN = {"name": "skin", "thickness": "3 mm", "young": "30 kPa", "poisson": 0.3}
LUMP = {"name": "lump", "at": ["0 mm", "0 mm", "-8 mm"], "radius": "3 mm", "young": "50 kPa", "poisson": 0.3}
REGIONS = {"layer": [SKIN], "inclusion": [LUMP]}
BALL = {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "contact": "unilateral"}
FINER = {"fine": "3 mm", "coarse": "6 mm", "rim": "0.6 mm"}
ASKED = {"influence": True}


def dataset(comm: MPI.Comm = MPI.COMM_SELF, without: tuple[str, ...] = (), **changes: Any) -> xr.Dataset:
    """Return the dataset of the base study with changes, which asks for the influence."""
    plan = make_plan(parse(raw(**{"solve": ASKED} | changes)), without=without)
    return build(plan, compute(plan, comm))


def same(one: xr.Dataset, other: xr.Dataset, rel: float = 1e-6) -> None:
    for name in ("force_share", "poisson_effect", "influence_radius"):
        assert one[name].values == pytest.approx(other[name].values, rel=rel, nan_ok=True), name


@pytest.mark.parametrize(
    "changes",
    [{}, {"probe": BALL, "mesh": {"rim": "0.5 mm"}}, {"material": {"law": "neo-hookean"}}],
    ids=["bonded", "contact found", "large displacements"],
)
def test_bars_hold_the_shares_of_a_finer_mesh(changes):
    body, other = {"body": REGIONS}, changes | {"mesh": FINER | ({"rim": "0.3 mm"} if "probe" in changes else {})}
    coarse, fine = dataset(**body, **changes), dataset(**body, **other)
    assert coarse["region"].values.tolist() == ["tissue", "skin", "lump"]
    assert coarse["decided"].values.tolist() == [*DECIDED]
    assert float(coarse["force_share"].sum()) == pytest.approx(1.0, abs=1e-6)
    for name in ("force_share", "poisson_effect", "influence_radius"):
        off = np.abs(coarse[name] - fine[name])
        assert (off <= coarse[f"{name}_error"] + fine[f"{name}_error"]).all(), name
        assert (coarse[f"{name}_error"] > 0).all(), name
        # The effects of ν have either sign, and may cancel within a region.
        size = abs(coarse[name]).max() if name == "poisson_effect" else coarse[name]
        assert (coarse[f"{name}_error"] < 0.2 * size).all(), name
    assert (np.diff(coarse["influence_radius"]) > 0).all()


@pytest.mark.nightly
def test_bars_of_distances_hold_where_cells_are_as_large_as_the_distance():
    body = {"shape": "box", "size": ["36 mm", "32 mm", "19 mm"], "fixed": "bottom"}
    cone = {"shape": "cone", "angle": "70 deg", "radius": "9.5 mm", "tip": "1.2 mm", "depth": "0.5 mm"}
    sizes = {
        "epsilon": "10 mm",
        "fine": "3.2 mm",
        "coarse": "8 mm",
        "rim": "0.1 mm",
        "growth": 0.8,
        "outside": "coarse",
    }
    asked = {"body": body, "probe": cone | {"contact": "unilateral"}, "material": {"young": "20 kPa", "poisson": 0.5}}
    coarse, fine = (
        build(plan := make_plan(parse(asked | {"mesh": mesh, "solve": ASKED})), compute(plan, MPI.COMM_SELF))
        for mesh in (sizes, {"accuracy": "0.15 %"})
    )
    off = np.abs(coarse["influence_radius"] - fine["influence_radius"]) / coarse["influence_radius_error"]
    assert 0.5 < off.max() < 1


def test_distances_are_from_the_first_touch():
    """A ball inclined by 20° touches 1.8 mm beside its axis, and presses by d cos 20° across the surface."""
    inclined = dataset(probe=BALL | {"axis": [0.342, 0.0, -0.9397]}, mesh={"rim": "0.5 mm"})
    upright = dataset(probe=BALL | {"depth": "0.47 mm"}, mesh={"rim": "0.5 mm"})
    assert inclined["influence_radius"].values == pytest.approx(upright["influence_radius"].values, rel=0.08)


def test_a_column_in_compression_is_decided_in_proportion_to_its_volume():
    """A disc as wide as a cylinder of ν = 0: the strain is uniform, and the ball that has a share is known."""
    half = 6e-3
    found = dataset(
        body={"shape": "cylinder", "radius": "6 mm", "height": "12 mm", "fixed": "bottom", "size": None},
        material={"poisson": 0.0},
        probe={"radius": "5.999 mm", "depth": "0.1 mm"},
        mesh={"rim": "1 mm", "fine": "1.5 mm"},
    )
    within = 2 * np.pi / 3 * half**3 / (np.pi * half**2 * 2 * half)  # the half ball of the radius
    radius = np.interp(within, found["decided"], found["influence_radius"])
    assert radius == pytest.approx(half, rel=0.02)


@pytest.mark.mpi
def test_parts_of_the_body_ranks_and_scales_give_the_same():
    quarter = dataset(body=REGIONS)
    same(quarter, dataset(WORLD, body=REGIONS), 1e-5)
    same(quarter, dataset(body=REGIONS, mesh={"model": "3d"}), 0.03)
    scaled = dataset(body=REGIONS, probe={"depth": ["0.2 mm", "0.4 mm"]})
    assert set(scaled["origin"].values) > {"scaled"}
    for number in range(2):
        same(quarter, scaled.isel(depth=number))


def test_what_needs_fields_is_solved_in_three_dimensions():
    swept = {"material": {"poisson": [0.2 + 0.01 * number for number in range(12)]}}
    round_body = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm", "fixed": "bottom", "size": None}
    for changes in (swept, {"body": round_body, "plan": {"without": []}}):
        (asked, plain) = (make_plan(parse(raw(**changes, solve=solve))) for solve in (ASKED, {}))
        assert not any(solve.reduced or solve.axisymmetric for solve in asked.solves)
        assert any(solve.reduced or solve.axisymmetric for solve in plain.solves)
        assert not set(asked.keys) & set(plain.keys)
    depths = BALL | {"depth": [f"{0.3 + 0.02 * n:.2f} mm" for n in range(12)], "mesh_depths": ["0.3 mm", "0.52 mm"]}
    condensed = [
        {one.name for one in make_plan(parse(raw(probe=depths, mesh={"rim": "0.5 mm"}, solve=solve))).skipped}
        for solve in ({}, ASKED)
    ]
    assert ["condensed" in names for names in condensed] == [True, False]


def test_a_stored_case_has_its_shares(tmp_path):
    study = epsmesh.read(raw(body=REGIONS, solve=ASKED))
    first, second = (study.run(output=tmp_path) for _ in range(2))
    assert not study.plan(store=tmp_path / "cases.sqlite").solves
    same(first, second, 1e-12)


def test_depths_of_a_contact_have_shares_of_their_own():
    changes = {"body": {"layer": [SKIN]}, "mesh": {"rim": "0.5 mm"}}
    depths = ["0.2 mm", "0.3 mm", "0.4 mm", "0.5 mm"]
    together = dataset(**changes, probe=BALL | {"depth": depths})
    same(together.isel(depth=3), dataset(**changes, probe=BALL), 1e-5)
    assert (np.diff(together["force_share"].sel(region="tissue")) > 0).all()


@pytest.mark.mpi
@pytest.mark.parametrize("contact", [{}, {"probe": BALL, "mesh": {"rim": "0.5 mm"}}], ids=["bonded", "found"])
def test_a_solution_has_the_influence_as_a_function_and_at_points(contact):
    solution = epsmesh.read(raw(body=REGIONS, **contact)).solve(comm=WORLD, influence=True)
    influence, degree = solution.influence, {"quadrature_degree": 6}
    measure = ufl.Measure("dx", solution.mesh, subdomain_data=solution.regions, metadata=degree)
    found = dataset(body=REGIONS, **contact)
    for number, name in enumerate(solution.region_names):
        own = fem.assemble_scalar(fem.form(influence * measure(number)))
        share = solution.images * WORLD.allreduce(own, op=MPI.SUM)
        assert share == pytest.approx(float(found["force_share"].sel(region=name)), abs=1e-4)
    values = solution.at([["1 mm", "1 mm", "-1 mm"], ["-1 mm", "1 mm", "-1 mm"], ["90 mm", "0 mm", "0 mm"]])
    here, image, outside = values["influence"].values
    assert here == image > 0
    assert np.isnan(outside)
    assert values["influence"].attrs["units"] == "m-3"


def test_the_figure_has_the_curves_of_the_dataset_beside_epsilon():
    found = dataset(body=REGIONS, mesh={"epsilon": ["8 mm", "full"]})
    assert "influence" in choose(found)
    (axes,) = figure(found, "influence").axes
    curves = {line.get_label(): line for line in axes.lines}
    assert curves["ε"].get_xdata() == pytest.approx([8.0, 8.0])
    drawn = [bars.lines[0] for bars in axes.containers]
    for line, one in zip(drawn, found["influence_radius"].transpose("epsilon", "decided").values, strict=True):
        assert line.get_xdata() == pytest.approx(1e3 * one)
        assert line.get_ydata() == pytest.approx(100 * np.array(DECIDED))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"probe": BALL | {"friction": 0.3}}, "no derivative of an energy"),
        ({"probe": BALL, "load": {"traction": [{"on": "free", "pressure": "0.2 kPa"}]}}, "where the depth begins"),
        ({"mesh": {"epsilon": "8 mm", "outside": "halfspace"}}, "beyond the cut"),
        ({"probe": {"history": {"ramp": "1 s", "hold": "5 s"}}}, "over time"),
        ({"probe": {"force": "5 mN", "depth": None}}, "give a depth"),
    ],
)
def test_what_has_no_influence_is_refused_with_its_reason(changes, said):
    message = refusal(raw(**changes, solve=ASKED))
    assert "solve.influence" in message
    assert said in message


def test_a_solution_without_influence_says_why():
    rubbing = {"probe": BALL | {"friction": 0.3}, "mesh": {"rim": "0.5 mm"}}
    for changes, asked, said in ((rubbing, True, "no derivative of an energy"), ({}, False, "ask for it")):
        solution = epsmesh.read(raw(**changes)).solve(comm=MPI.COMM_SELF, influence=asked)
        with pytest.raises(ValueError, match=said):
            _ = solution.influence
        assert "influence" not in solution.at([["1 mm", "1 mm", "-1 mm"]])
