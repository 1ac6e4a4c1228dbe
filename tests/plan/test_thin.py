"""Layers and regions too thin to be meshed: refused when a study is planned; named where a mesh of them fails."""

import numpy as np
import pytest

from epsmesh.mesh import of_case
from epsmesh.mesh.generate import MeshError
from epsmesh.plan.plan import make_plan
from epsmesh.plan.thin import MOST, cause
from epsmesh.run.problem import CaseFailure, check_memory
from epsmesh.shapes.shell import Shell
from epsmesh.shapes.triangles import Triangles
from epsmesh.study.problems import StudyError
from tests.cases import study

SKIN = {"name": "skin", "young": "50 kPa", "poisson": 0.3}
# A plate, clear of the z axis: corners in units of its half sizes, and its facets.
CORNERS = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
FACETS = np.array([
    [0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
    [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5],
])  # fmt: skip


def plate(thickness: float) -> Shell:
    points = CORNERS * [10e-3, 10e-3, thickness / 2] + [1e-3, 2e-3, -8e-3]
    return Shell(Triangles(points, FACETS))


def layered(thickness: str, **changes):
    return study(body={"layer": [SKIN | {"thickness": thickness}]}, **changes)


@pytest.fixture
def with_plate(tmp_path):
    """Return a function that writes a plate of a thickness (m) and returns a study in which it is a region."""

    def made(thickness: float):
        shell = plate(thickness).triangles
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in (1e3 * shell.points).tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (FACETS + 1).tolist()]
        (tmp_path / "plate.obj").write_text("\n".join(lines))
        return study(body={"region": [SKIN | {"file": str(tmp_path / "plate.obj"), "unit": "mm"}]})

    return made


@pytest.mark.parametrize("thickness", [0.5e-3, 0.2e-3, 20e-6, 1e-6])
def test_the_thickness_of_a_plate_is_known_however_thin_it_is(thickness):
    """One thinner than the distance of the points that are looked at counted as thick, and was not told."""
    found = plate(thickness)
    assert 0.9 * thickness < 2 * found.least < 1.2 * thickness
    assert found.is_thin


def test_a_layer_too_thin_to_be_meshed_is_refused_with_what_it_would_take():
    with pytest.raises(StudyError) as caught:
        make_plan(layered("0.5 um", probe={"at": ["4 mm", "3 mm"]}))
    (problem,) = caught.value.problems
    assert problem.key == "body.layer[1].thickness" and problem.value == "0.0005 mm"
    for word in ("skin is 0.0005 mm thick", "tetrahedra", f"{MOST:,.0f}", "Make it at least", "epsilon"):
        assert word in problem.allowed


def test_a_layer_is_not_refused_where_no_mesh_of_it_is_made_or_it_is_cut_off():
    """On the meridian a thin layer costs little; the free column of a small ε has little of it."""
    cylinder = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm", "layer": [SKIN | {"thickness": "0.5 um"}]}
    make_plan(study(body=cylinder, plan={"without": []}))
    small = {"radius": "2 um", "depth": "0.1 um", "at": ["4 mm", "3 mm"]}
    short = {"epsilon": "20 um", "fine": "5 um", "coarse": "5 um", "rim": "1 um", "outside": "free"}
    make_plan(layered("0.5 um", probe=small, mesh=short))


def test_a_region_of_a_file_too_thin_to_be_meshed_is_refused(with_plate):
    make_plan(with_plate(0.2e-3))
    with pytest.raises(StudyError, match=r"plate.obj.*skin is 0.00999 mm thick.*tetrahedra.*Make it at least 0.\d+ mm"):
        make_plan(with_plate(10e-6))


def test_a_mesh_that_fails_names_the_region_that_makes_most_of_it(with_plate, monkeypatch):
    def fails(*_):
        raise MeshError("gmsh: overlapping facets")

    monkeypatch.setattr(of_case, "_meshed", fails)
    case = with_plate(0.2e-3).case(())
    with pytest.raises(MeshError, match=r"overlapping facets. body.region\[1\].file.*skin is 0.2.* mm thick.*thicker"):
        of_case.mesh_arrays(case, ())
    with pytest.raises(CaseFailure, match=r"smaller epsilon\. .*skin is 0.2"):
        check_memory(1.0, 2.0, "this case", case)
    assert cause(study().case(())) == ""
