"""A scene of SOFA: run against stand-ins, and solved by linear tetrahedra of its own mesh."""

import runpy
import sys
from types import ModuleType, SimpleNamespace

import meshio
import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse
from scipy.sparse.linalg import spsolve

from epsmesh.run.solved import solve_alone
from epsmesh.view.compute import compute_fields
from epsmesh.view.sofa import write_sofa
from tests.cases import study
from tests.commands import epsmesh
from tests.studies import small_text


class Node:
    """A node of a scene: what it was given, by the name of the component."""

    def __init__(self):
        self.added, self.children, self.dt = {}, {}, SimpleNamespace(value=1.0)

    def addObject(self, kind, **data):
        made = kind if not isinstance(kind, str) else SimpleNamespace(**data)
        self.added.setdefault(kind if isinstance(kind, str) else "controller", []).append(made)
        return made

    def addChild(self, name):
        return self.children.setdefault(name, Node())


@pytest.fixture
def loaded(monkeypatch):
    """Return a scene's nodes, by its path: SOFA's modules are stand-ins."""
    sofa = ModuleType("Sofa")
    sofa.Core = SimpleNamespace(Controller=type("Controller", (), {"__init__": lambda self, name: None}), Node=Node)
    monkeypatch.setitem(sys.modules, "Sofa", sofa)
    return lambda path: runpy.run_path(str(path))["createScene"](Node())


def solved(root):
    """Return the displaced points of the scene's tetrahedra, by linear elasticity, as SOFA's method "small" does."""
    body, tool = root.children["body"].added, root.children["tool"].added
    (tissue,), (springs,), (support,) = (
        body[name] for name in ("TetrahedronFEMForceField", "RestShapeSpringsForceField", "FixedProjectiveConstraint")
    )
    mesh = meshio.read(body["MeshGmshLoader"][0].filename)
    points, (cells,) = mesh.points, [block.data for block in mesh.cells]
    young, poisson = np.array(tissue.youngModulus), np.array(tissue.poissonRatio)
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    slopes = np.linalg.inv(edges).transpose(0, 2, 1)
    slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
    volume = np.abs(np.linalg.det(edges)) / 6
    mu, lam = young / (2 + 2 * poisson), young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    part = lambda text, scale: np.einsum(f"n,nai,nbj->n{text}", scale * volume, slopes, slopes)  # noqa: E731
    same = np.einsum("n,nak,nbk,ij->naibj", mu * volume, slopes, slopes, np.eye(3))
    stiffness = (part("aibj", lam) + part("ajbi", mu) + same).reshape(len(cells), 12, 12)
    dofs = (3 * cells[:, :, None] + np.arange(3)).reshape(len(cells), 12)
    rows, columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
    matrix = sparse.coo_matrix((stiffness.ravel(), (rows, columns)), [points.size] * 2).tocsr()
    (hold,), held = springs.stiffness, 3 * np.array(springs.points)[:, None] + np.arange(3)
    ends = np.array(tool["MechanicalObject"][0].position)[springs.external_points]
    force, added = np.zeros(points.size), np.zeros(points.size)
    added[held] = hold
    force[held] = hold * (ends - points[springs.points])
    free = np.ones((len(points), 3), bool)
    free[support.indices] = False
    free = np.flatnonzero(free.ravel())
    moved = np.zeros(points.size)
    moved[free] = spsolve((matrix + sparse.diags(added))[free][:, free].tocsc(), force[free])
    return points + moved.reshape(-1, 3)


SCENES = {
    "disc": {},
    "bonded, to a side": {
        "probe": {"contact": "bonded", "at": ["4 mm", "2 mm"]},
        "mesh": {"outside": "coarse", "epsilon": "8 mm"},
    },
    "layers": {
        "body": {
            "layer": [
                {"name": "skin", "thickness": "5 mm", "young": "30 kPa", "poisson": 0.4},
            ]
        },
    },
}


# Of degree 2 and with a curved inclusion: linear elements are stiffer.
TUMOUR = {"name": "tumour", "at": ["2 mm", "0 mm", "-8 mm"], "radius": "4 mm", "young": "40 kPa", "poisson": 0.4}


def fields_of(**changes):
    made = study(**changes)
    (case,) = made.cases()
    return case, compute_fields(solve_alone(made, case), MPI.COMM_SELF)


def test_the_force_of_linear_elements_is_above_the_reference(loaded, tmp_path):
    case, fields = fields_of(body={"inclusion": [TUMOUR]})
    root = loaded(write_sofa(fields, tmp_path / "scene", "a scene", "1.2.3")[0])
    young = np.array(root.children["body"].added["TetrahedronFEMForceField"][0].youngModulus)
    assert set(young) == {1e4, 4e4}
    corners = meshio.read(tmp_path / "scene.msh")
    centres = corners.points[corners.cells[0].data].mean(axis=1)
    assert np.linalg.norm(centres[young == 4e4] - [2e-3, 0, -8e-3], axis=1).max() < 4e-3
    (monitor,) = root.added["controller"]
    monitor.tissue.position = SimpleNamespace(value=solved(root))
    monitor.tool.position = SimpleNamespace(value=monitor.tool.position)
    monitor.onAnimateEndEvent(None)
    assert 1 < monitor.force @ np.array(case.frame.axes[2]) / fields.force < 1.5


@pytest.mark.parametrize("name", SCENES)
def test_the_force_of_a_scene_is_that_of_the_same_elements(name, loaded, tmp_path, capsys):
    case, fields = fields_of(**SCENES[name] | {"mesh": SCENES[name].get("mesh", {}) | {"degree": 1}})
    paths = write_sofa(fields, tmp_path / "scene", 'a "scene"', "1.2.3")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in paths)
    root = loaded(paths[0])
    (monitor,) = root.added["controller"]
    monitor.tissue.position = SimpleNamespace(value=solved(root))
    monitor.tool.position = SimpleNamespace(value=monitor.tool.position)
    monitor.onAnimateEndEvent(None)
    reference = float(capsys.readouterr().out.split("epsmesh: ")[1].split()[0])
    assert reference == pytest.approx(fields.force, rel=1e-5)
    assert monitor.force @ np.array(case.frame.axes[2]) == pytest.approx(fields.force, rel=1e-4)


@pytest.mark.parametrize(
    ("changes", "arguments", "why"),
    [
        ({}, ("--mesh-only",), "--mesh-only"),
        ({"mesh": {"outside": "halfspace", "epsilon": "4 mm"}}, (), "half ball"),
        (
            {"load": {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}, "material": {"density": "1000 kg/m^3"}},
            (),
            "[load]",
        ),
    ],
)
def test_a_case_without_a_scene_is_refused(tmp_path, changes, arguments, why):
    (tmp_path / "small.toml").write_text(small_text(**changes))
    done = epsmesh("view", tmp_path / "small.toml", "0", "--sofa", *arguments, "--output", tmp_path / "out")
    assert done.exit_code == 2
    assert why in done.output
    assert not (tmp_path / "out").exists()
