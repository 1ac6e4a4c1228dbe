"""What random fields of the modulus do to F: sums over places, samples, symmetric parts, ranks, and refusals."""

from math import log1p, sinh
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.arrays import FloatArray
from epsmesh.plan.plan import make_plan
from epsmesh.quantities import quantity_of
from epsmesh.report.dataset import build
from epsmesh.report.influence import OF_NORMAL
from epsmesh.report.uncertainty import bars, unknowns
from epsmesh.run.execute import compute
from epsmesh.run.spread import Sources, _clusters, _integral
from epsmesh.study.read import parse, read_mapping
from epsmesh_identify.estimation.dataset import write
from tests.cases import raw, refusal
from tests.identifications import identification

WORLD = MPI.COMM_WORLD
SPREAD = {"young": "30 %", "correlation_length": "4 mm"}
SKIN = {"name": "skin", "thickness": "3 mm", "young": "30 kPa", "poisson": 0.3}
BALL = {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "contact": "unilateral"}


def dataset(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Any:
    """Return the dataset of the base study with changes, whose tissue has a spread."""
    plan = make_plan(parse(raw(**changes)))
    return build(plan, compute(plan, comm))


def deviation(spread: Any = SPREAD, comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> FloatArray:
    """Return the standard deviation of ln F of each case, alone if there is one."""
    return np.squeeze(logarithms(spread, comm, **changes)["tissue_spread"][:, 0])


def logarithms(spread: Any = SPREAD, comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> dict[str, FloatArray]:
    """Return the mean and the standard deviation of ln F of each case, with their bars, (cases, 2)."""
    material = changes.pop("material", {}) | ({"spread": spread} if spread else {})
    plan = make_plan(parse(raw(material=material, **changes)))
    records = compute(plan, comm)
    return {
        name: np.array([records[key].influence[name] for key in plan.keys]) for name in ("tissue_mean", "tissue_spread")
    }


@pytest.mark.parametrize("length", [0.5, 2.0, 10.0])
def test_the_sum_over_clusters_is_that_over_all_pairs(length):
    rng = np.random.default_rng(5)
    centres = np.abs(rng.normal(size=(3000, 3)) * rng.exponential(3, size=(3000, 1)))
    shares = rng.random(3000) / (1 + np.linalg.norm(centres, axis=1) ** 3)
    shares /= 4 * shares.sum()
    whole = np.concatenate([centres * [x, y, 1] for x in (1, -1) for y in (1, -1)])
    total = 0.0
    for rows in np.array_split(np.arange(3000), 10):
        away = np.sqrt(3) / length * np.linalg.norm(centres[rows, None] - whole[None], axis=2)
        total += 4 * float(shares[rows] @ ((1 + away) * np.exp(-away)) @ np.tile(shares, 4))
    sources = Sources(shares[:, None], centres, np.zeros(3000))
    clusters = sources.gathered(_clusters(sources, length))
    assert len(clusters.shares) < 1000
    assert _integral(MPI.COMM_SELF, clusters, length, (0, 1)) == pytest.approx(np.array([[total]]), rel=1e-3)


def test_a_field_without_change_is_one_unknown_modulus():
    found = deviation({"young": "30 %", "correlation_length": "10 m"})
    assert found == pytest.approx(log1p(0.3**2) ** 0.5, rel=1e-3)
    lengths = deviation({"young": "30 %", "correlation_length": ["1 mm", "4 mm", "16 mm"]})
    assert (np.diff(lengths) > 0).all()
    one, other = deviation({"young": ["10 %", "20 %"], "correlation_length": "4 mm"})
    assert other / one == pytest.approx((log1p(0.2**2) / log1p(0.1**2)) ** 0.5, rel=1e-6)


def test_coarse_cells_have_the_deviation_of_fine_ones_within_their_bar():
    for length in ("1 mm", "4 mm"):
        fine = {"fine": "2.5 mm", "coarse": "4 mm", "rim": "0.5 mm"}
        small = {"young": "3 %", "correlation_length": length}  # so small that the bar is that of the mesh
        (coarse, bar), (finer, least) = (logarithms(small, mesh=m)["tissue_spread"][0] for m in ({}, fine))
        assert coarse == pytest.approx(finer, abs=bar)
        assert least < bar < 0.1 * coarse


def test_the_mean_is_that_of_the_logarithm_unless_the_field_is_averaged_out():
    variance = log1p(0.3**2)
    lengths = ["1 mm", "4 mm", "10 m"]
    mean, error = logarithms({"young": "30 %", "correlation_length": lengths})["tissue_mean"].T
    assert mean[-1] == pytest.approx(-variance / 2, rel=1e-3)
    assert error[-1] < 1e-3 * variance
    assert (np.diff(mean) < 0).all()
    assert (np.diff(error) < 0).all()


@pytest.mark.mpi
@pytest.mark.parametrize("contact", [{}, {"probe": BALL, "mesh": {"rim": "0.5 mm"}}], ids=["bonded", "found"])
def test_a_quarter_has_the_deviation_of_the_whole_on_any_ranks(contact):
    quarter = deviation(**contact)
    assert deviation(comm=WORLD, **contact) == pytest.approx(quarter, rel=1e-4)
    whole = contact | {"mesh": contact.get("mesh", {}) | {"model": "3d"}}
    assert deviation(**whole) == pytest.approx(quarter, rel=0.03)


def test_tissues_vary_independently_and_only_where_that_is_said():
    def of(skin: Any, tissue: Any) -> float:
        return float(deviation(tissue, body={"layer": [SKIN | ({"spread": skin} if skin else {})]}))

    skin, tissue, both = of(SPREAD, None), of(None, SPREAD), of(SPREAD, SPREAD)
    assert min(skin, tissue) > 0.01
    assert skin**2 + tissue**2 == pytest.approx(both**2, rel=1e-6)


def test_the_bar_is_half_of_what_holds_95_per_cent_and_the_report_says_what_to_measure():
    found = dataset(material={"spread": {"young": "100 %", "correlation_length": "10 m"}})
    bar = found["force_uncertainty_tissue"]
    # E and F are log-normal alike, with a median of mean/√2.
    assert float(bar / found["force"]) == pytest.approx(sinh(1.959964 * np.log(2) ** 0.5) / 2**0.5, rel=1e-3)
    error = found["force_uncertainty_tissue_error"]
    assert error.attrs["units"] == "N"
    assert float(found["force_error"] / found["force"]) < float(error / bar) < 0.5
    assert bar.attrs["units"] == "N"
    assert bar.attrs["comment"] == "tissue ± 100 % over 1e+04 mm"
    said = unknowns(found)
    assert "(itself ± " in said
    assert "(tissue ± 100 % over 1e+04 mm). The tissue's spread decides: measure" in said
    radius = 1e3 * float(found["influence_radius"].sel(decided=0.5))
    assert f"within {radius:.2g} mm of the point of contact, where half of F is decided." in said
    assert "spread" not in unknowns(dataset())


def test_an_identified_tissue_with_a_spread_has_three_bars(tmp_path):
    write(identification(names=("young",)), tmp_path / "one.nc")
    content = raw() | {"material": {"from": "one.nc", "poisson": 0.4, "spread": SPREAD}}
    plan = make_plan(read_mapping(content, "using", tmp_path))
    found = build(plan, compute(plan, MPI.COMM_SELF))
    mesh, parameters, spread = bars(found)
    assert (mesh.cause, parameters.cause, spread.cause) == ("mesh", "tissue's parameters", "tissue's spread")
    assert mesh.share < parameters.share < spread.share
    # F is proportional to E, which is 12 ± 2 kPa.
    assert parameters.share == pytest.approx(2e3 / 12e3, rel=1e-6)
    known = logarithms(material={"poisson": 0.4})
    expected = np.exp(known["tissue_mean"]) * np.sinh(OF_NORMAL * known["tissue_spread"])
    assert spread.share == pytest.approx(float(expected[0, 0]), rel=1e-6)


def test_sweeps_of_a_spread_have_dimensions_of_their_own():
    skin = SKIN | {"spread": {"young": ["5 %", "10 %"], "correlation_length": "4 mm"}}
    swept = {"young": ["10 %", "20 %"], "correlation_length": {"from": "2 mm", "to": "4 mm", "steps": 2}}
    found = parse(raw(body={"layer": [skin]}, material={"spread": swept}))
    names = ["skin_spread_young", "spread_young", "spread_correlation_length"]
    assert [axis.name for axis in found.axes] == names
    assert [quantity_of(name).unit for name in names] == ["1", "1", "m"]
    assert len({*make_plan(found).keys}) == 8


def test_the_force_does_not_depend_on_the_spread():
    found, plain = dataset(material={"spread": SPREAD}, solve={"influence": True}), dataset(solve={"influence": True})
    for name in ("force", "force_error"):
        assert float(found[name]) == float(plain[name])
    for name in ("force_share", "influence_radius"):
        assert found[name].values.tolist() == plain[name].values.tolist()


@pytest.mark.parametrize(
    ("spread", "said"),
    [
        ({"young": "0 %", "correlation_length": "4 mm"}, "material.spread.young"),
        ({"young": "120 %", "correlation_length": "4 mm"}, "material.spread.young"),
        ({"young": "30 %", "correlation_length": 4}, "material.spread.correlation_length"),
        ({"young": "30 %", "correlation_length": "0 mm"}, "material.spread.correlation_length"),
        ({"young": "30 %"}, "material.spread.correlation_length"),
        ({"young": "30 %", "correlation_length": "4 mm", "poisson": 0.1}, "material.spread.poisson"),
    ],
)
def test_what_is_wrong_with_a_spread_is_named(spread, said):
    assert said in refusal(raw(material={"spread": spread}))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"probe": BALL | {"friction": 0.3}}, "no derivative of an energy"),
        ({"mesh": {"epsilon": "8 mm", "outside": "halfspace"}}, "beyond the cut"),
        ({"probe": {"force": "5 mN", "depth": None}}, "give a depth"),
    ],
)
def test_what_has_no_influence_has_no_spread(changes, said):
    message = refusal(raw(**changes, material={"spread": SPREAD}))
    assert "material.spread" in message
    assert said in message
    assert "solve.influence" not in message
