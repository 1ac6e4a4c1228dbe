"""Two jaws on bodies of triangles: a slab as a surface is the box that it is, jaws may be inclined, organs may meet."""

from math import cos, radians, sin
from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.study.read import parse
from tests import organs
from tests.cases import raw, refusal
from tests.solve.test_grasp import BALL, DISC, FINE, LARGE

MESHES = Path(__file__).resolve().parents[2] / "meshes"
SIDE = {"at": ["10 mm", "0 mm", "-15 mm"]}
HELD = {"below": "-35 mm"}
# Jaws through both organs, and through one of them above the other.
ACROSS, ABOVE = (
    {"at": ["-14 mm", "0 mm", f"{z} mm"], "axis": [1, 0, 0], "depth": "0.4 mm", "radius": "4 mm"} for z in (-2, 14)
)
# So low that the second jaw is next to the support.
LOW = {"at": ["-14 mm", "0 mm", "-10 mm"]}
SIZES = {"rim": "0.4 mm", "growth": 0.8, "fine": "6 mm"}


def grasp(first: dict[str, Any], second: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    """Return a study of two jaws; of the second one, only what differs from the first."""
    content = raw(**changes)
    content["probe"] = [first | {"together": "grasp"}, (second or {}) | {"together": "grasp"}]
    return content


def closed(content: dict[str, Any], comm: MPI.Comm = MPI.COMM_SELF) -> Any:
    """Return the record of a study of one grasp."""
    (record,) = compute(make_plan(parse(content)), comm).values()
    assert record.status == "ok", record.message
    return record


@pytest.fixture(scope="module")
def slab(tmp_path_factory):
    """A slab 20 mm thick as a surface; ``turned`` about z by so many degrees."""
    folder = tmp_path_factory.mktemp("slab")

    def made(turned: float = 0.0) -> dict[str, Any]:
        points, facets = organs.box(20e-3, 40e-3, 40e-3)
        c, s = cos(radians(turned)), sin(radians(turned))
        points = points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        file = organs.write_stl(folder / f"{turned:g}.stl", points, facets)
        return {"shape": "surface", "file": str(file), "unit": "mm", "size": None, "fixed": HELD}

    return made


def touching(**changes: Any) -> dict[str, Any]:
    """Return the body of two organs that touch, one twice as stiff as the other."""
    files = {"file": str(MESHES / "organs.nii.gz"), "names": str(MESHES / "organs.txt")}
    stomach = {"name": "stomach", "label": "stomach", "young": "20 kPa", "poisson": 0.3}
    body = {"shape": "image", "label": "liver", "size": None, "fixed": {"below": "-14 mm"}, "region": [stomach]}
    return body | files | changes


def agree(one: Any, other: Any, *names: str) -> None:
    """Check that forces, or the records of two jaws, differ by less than both bars."""
    assert abs(one.force / other.force - 1) < one.force_error + other.force_error
    bars = sum(r.largest["jaw_force_error"] / r.largest["jaw_force"] for r in (one, other))
    assert abs(one.largest["jaw_force"] / other.largest["jaw_force"] - 1) < bars


@pytest.mark.parametrize(
    ("jaws", "material"),
    [
        pytest.param((BALL, {"radius": "3 mm"}), {}, id="balls"),
        pytest.param((DISC, {"depth": "0.3 mm"}), {}, id="discs"),
        pytest.param((BALL | {"depth": "0.8 mm"}, {}), LARGE, id="large"),
        pytest.param((BALL | {"friction": 0.3}, {}), {}, id="friction", marks=pytest.mark.nightly),
    ],
)
def test_a_slab_of_triangles_is_a_box(slab, jaws, material):
    first, second = jaws
    box = {"size": ["20 mm", "40 mm", "40 mm"], "fixed": HELD}
    both = [closed(grasp(first | SIDE, second, body=body, mesh=FINE, material=material)) for body in (slab(), box)]
    agree(*both)
    assert both[0].force == pytest.approx(both[1].force, rel=1.5e-2)
    assert both[0].contact_area == pytest.approx(both[1].contact_area, rel=4e-2)
    assert both[0].balance < 1e-7


def test_a_slab_may_be_turned(slab):
    turn = radians(30)
    place = {"at": [f"{10 * cos(turn)} mm", f"{10 * sin(turn)} mm", "-15 mm"]}
    upright, turned = closed(grasp(BALL | SIDE, body=slab(), mesh=FINE)), closed(grasp(BALL | place, body=slab(30)))
    agree(upright, turned)
    x, y = (turned.largest[f"jaw_force_vector_{axis}"] for axis in "xy")
    assert (x, y) == pytest.approx((-turned.largest["jaw_force"] * np.array([cos(turn), sin(turn)])), rel=1e-2)


def test_jaws_inclined_to_the_surface_press_along_its_normal(slab):
    """At a small depth a linear law, whose gaps are along the surface's normal, is one of large displacements."""
    tilt = radians(10)
    jaw = BALL | SIDE | {"axis": [-cos(tilt), 0.0, sin(tilt)], "depth": "0.2 mm"}
    laws = {}, {"law": "neo-hookean"}
    linear, large = (closed(grasp(jaw, body=slab(), mesh=FINE, material=law)) for law in laws)
    assert linear.force == pytest.approx(large.force, rel=1e-2)
    assert linear.largest["jaw_force"] == pytest.approx(large.largest["jaw_force"], rel=1e-2)
    for found in (linear, large):
        x, z = (found.largest[f"jaw_force_vector_{axis}"] for axis in "xz")
        assert abs(z) < 5e-3 * abs(x)
        assert found.balance < 1e-7


@pytest.mark.nightly
def test_it_does_not_matter_on_which_organ_the_first_jaw_is():
    one = grasp(BALL | ACROSS, body=touching(), mesh=SIZES)
    case = next(parse(one).cases())
    there = {"at": [f"{x} m" for x in case.jaw.at], "axis": [-1, 0, 0]}
    both = closed(one), closed(grasp(BALL | ACROSS | there, body=touching(), mesh=SIZES))
    (first, second), (second_again, first_again) = ((r.force, r.largest["jaw_force"]) for r in both)
    bars = sum(max(r.force_error, r.largest["jaw_force_error"] / r.largest["jaw_force"]) for r in both)
    assert first == pytest.approx(first_again, rel=bars)
    assert second == pytest.approx(second_again, rel=bars)
    assert second > 1.5 * first  # the stiffer organ presses harder at the same depth


def test_organs_of_one_tissue_are_one_body():
    alike = touching()
    alike["region"][0]["young"] = "10 kPa"
    one = touching(label=["liver", "stomach"], region=None)
    agree(*(closed(grasp(BALL | ACROSS, body=body, mesh=SIZES)) for body in (alike, one)))


def test_both_patches_are_in_the_mesh():
    """Facets below each jaw are within its footprint, which projects along its axis to the disc that it is."""
    case = next(parse(grasp(BALL | ABOVE, {"radius": "3 mm"}, body=touching(), mesh=SIZES)).cases())
    mesh = mesh_arrays(case, ())
    for name, tool in (("probe", case.probe), ("jaw", case.jaw)):
        local = tool.frame_on(case.body).local(mesh.points[np.unique(mesh.facets[name])])
        assert np.hypot(*local[:, :2].T).max() == pytest.approx(tool.circumradius, rel=1e-9)
        corners = mesh.points[mesh.facets[name]]
        flat = corners @ tool.frame_on(case.body).axes[:2].T
        a, b = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
        area = abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2
        assert area == pytest.approx(np.pi * tool.circumradius**2, rel=0.1)


def test_the_label_map_has_two_organs_that_touch():
    values = np.asanyarray(nibabel.load(MESHES / "organs.nii.gz").dataobj)
    assert set(np.unique(values)) == {0, 1, 2}
    assert ((values[1:] == 2) & (values[:-1] == 1)).sum() > 100


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (grasp(BALL | ACROSS | {"at": ["-5 mm", "0 mm", "28 mm"], "axis": None}, body=touching()), "second jaw"),
        (grasp(BALL | ACROSS | LOW, {"radius": "8 mm"}, body=touching()), "the second jaw's edge"),
        (grasp(BALL | ACROSS | LOW, {"radius": "14 mm"}, body=touching()), "must not reach the support"),
        (grasp(BALL | ABOVE, {"radius": "60 mm"}, body=touching()), "of the second jaw, where the axis leaves the"),
        (
            grasp(BALL | ACROSS | {"friction": 0.3, "pull": "0.1 mm", "pull_direction": [0, 0, 1]}, body=touching()),
            "gaps of a linear law stay",
        ),
        (grasp(BALL | ACROSS, body=touching(fixed="none")), "must be a height"),
    ],
)  # fmt: skip
def test_places_that_do_not_fit_are_told(content, said):
    assert said in refusal(content)


@pytest.mark.mpi
def test_ranks_agree(slab):
    content = grasp(BALL | SIDE, {"depth": "0.5 mm"}, body=slab(), mesh=FINE | {"rim": "0.6 mm"})
    alone, both = (closed(content, comm) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-7)
    assert both.largest["jaw_force"] == pytest.approx(alone.largest["jaw_force"], rel=1e-7)
    assert both.largest["jaw_contact_area"] == pytest.approx(alone.largest["jaw_contact_area"], rel=1e-6)
