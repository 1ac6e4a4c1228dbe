"""What a problem is given, and whether it can work: mesh, groups, laws, tool and supports, told before a solve."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from pydantic import ValidationError

from epsmesh.arrays import FloatArray, Int32Array
from epsmesh.mesh.distribute import BodyMesh, exterior_facets
from epsmesh.run.tools import tool_at
from epsmesh.scene.model import FIXED, FREE, MIRROR, PROBE
from epsmesh.shapes.contact import UPRIGHT
from epsmesh.shapes.frame import Frame, Vector, angle_between
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.registry import PROBES, specialised
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.laws import LAWS
from epsmesh.solve.loads import boundary_of
from epsmesh.solve.physics import MaterialLaw, Parameters
from epsmesh.study.plausible import LARGEST
from epsmesh.study.problems import Problems
from epsmesh.study.schema import Material, Mesh

# Sizes (m) of meshes: no patient's body is larger; a mesh in millimetres is.
_SMALLEST, _LARGEST = 1e-6, LARGEST
# Names of facet groups, and those of the solver.
_GROUPS = {"tool": PROBE, "fixed": FIXED, "mirror_x": MIRROR["x"], "mirror_y": MIRROR["y"]}
# How far the tool may be inside the body at depth 0, and a mirror's facets off their plane, in units of the extent.
_OFF = 1e-6
# Keys of a tool that say how it moves and where: of those a problem has its own.
_OF_STUDIES = frozenset(
    {
        "at",
        "axis",
        "contact",
        "depth",
        "together",
        "pull",
        "pull_direction",
        "mesh_depths",
        "force",
        "history",
        "incision",
        "insertion",
        "motion",
        "name",
        "path",
    }
)
# Points along an edge of a facet at which its distance to the tool is found, and how far the tool may then be above it,
# in units of the edge.
_ALONG, _ABOVE = 20, 2e-3
# The area of the facets of a flat tool with a sharp edge, in units of its own: they are the footprint, and a polygon.
_LEAST_AREA, _MOST_AREA = 0.8, 1.0 + 1e-6


def probe_of(tool: Mapping[str, Any], depth: float) -> Probe:
    """Return the probe with the keys of a ``tool`` at a ``depth`` (m).

    Raises:
        ValueError: if keys or values are wrong, with each key, its value and what is allowed.
    """
    keys = {"contact": "unilateral", "depth": f"{depth!r} m"} | dict(tool)
    shape = keys.get("shape")
    if shape not in PROBES:
        raise ValueError(f"tool: shape = {shape!r}: must be one of {', '.join(PROBES)}")
    if unknown := _OF_STUDIES & set(tool):
        raise ValueError(f"tool: {min(unknown)} is a key of studies: a problem has at and depth, and moves along -z")
    try:
        probe = specialised(PROBES[str(shape)].model_validate(keys))
    except ValidationError as error:
        problems = Problems()
        problems.from_pydantic("tool", error, PROBES[str(shape)], keys)
        raise ValueError("\n".join(map(str, problems.errors))) from None
    assert isinstance(probe, Probe)
    return probe


def placed_tool(body: BodyMesh, probe: Probe, at: Vector) -> Tool:
    """Return the tool ``at`` its place; a linear law has the normal of the facets that it touches first; collective."""
    tool = tool_at(probe, Frame(at), 0.0)
    if probe.is_flat:
        return tool
    facets = boundary_of(body, (PROBE,))
    points = _points_of(facets.corners)
    gaps = tool.height(points.reshape(-1, 3)).reshape(points.shape[:2]).min(axis=1)
    least = body.comm.allreduce(float(gaps.min(initial=np.inf)), op=MPI.MIN)
    touched = facets.normals[gaps <= least + _OFF * _extent(body.mesh)].sum(axis=0)
    normal = np.asarray(body.comm.allreduce(touched))
    normal[[*body.mirrored]] = 0.0
    x, y, z = map(float, normal / np.linalg.norm(normal))
    return tool if angle_between((x, y, z), (0.0, 0.0, 1.0)) <= UPRIGHT else replace(tool, normal=(x, y, z))


def _points_of(corners: FloatArray) -> FloatArray:
    """Return points (n, k, 3) on facets, whose ``corners`` (n, 3, 3) they include."""
    shares = np.array([(i, j, _ALONG - i - j) for i in range(_ALONG + 1) for j in range(_ALONG + 1 - i)]) / _ALONG
    return np.einsum("kc,ncd->nkd", shares, corners)


def check_place(body: BodyMesh, tool: Mapping[str, Any], at: Vector) -> None:
    """Check that a ``tool`` touches the body ``at`` a point at depth 0, and that the face of a flat one is its facets.

    Raises:
        ValueError: if not; collective.
    """
    extent = _extent(body.mesh)
    probe = probe_of(tool, 1e-3 * extent)
    corners = boundary_of(body, (PROBE,)).corners
    gaps = tool_at(probe, Frame(at), 0.0).height(_points_of(corners).reshape(-1, 3))
    least = body.comm.allreduce(float(gaps.min(initial=np.inf)), op=MPI.MIN)
    edges = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2)
    edge = body.comm.allreduce(float(edges.max(initial=0.0)), op=MPI.MAX)
    if least < -_OFF * extent:
        raise ValueError(f"at = {at}: the tool is {-least:.3g} m inside the body: it must touch the surface")
    if least > _ABOVE * edge:
        raise ValueError(f"at = {at}: the tool is {least:.3g} m above its facets: it must touch them")
    if probe.has_singular_edge:
        _check_footprint(body, probe, corners, at)


def _check_footprint(body: BodyMesh, probe: Probe, corners: FloatArray, at: Vector) -> None:
    """Raise an error unless the tool's facets, by their ``corners`` (n, 3, 3), are its face."""
    outline = probe.outline()
    reach = np.abs(corners[..., :2] - np.array(at[:2])) - np.abs(outline).max(axis=0)
    beyond = body.comm.allreduce(float(reach.max(initial=-np.inf)), op=MPI.MAX)
    sides = corners[:, 1:, :2] - corners[:, :1, :2]
    own = float(np.abs(np.linalg.det(sides)).sum()) / 2
    area = 2.0 ** len(body.mirrored) * body.comm.allreduce(own)
    (x, y), (after_x, after_y) = outline.T, np.roll(outline, -1, axis=0).T
    known = float(np.abs((x * after_y - y * after_x).sum())) / 2
    if beyond > _OFF * _extent(body.mesh) or not _LEAST_AREA <= area / known <= _MOST_AREA:
        raise ValueError(
            f'group "tool": its facets have {area:.3g} m², the face of the {probe.shape} has {known:.3g} m²: with '
            "a sharp edge it is known by its facets alone; mark those below it, or give the tool a rounded edge"
        )


def check_apart(body: BodyMesh) -> None:
    """Check that the faces of a bonded tool and of the support have no node in common; collective.

    Raises:
        ValueError: if they have: it would be moved and fixed.
    """
    faces = [boundary_of(body, (group,)).corners.reshape(-1, 3) for group in (PROBE, FIXED)]
    tool, fixed = ({tuple(point) for part in body.comm.allgather(own) for point in part.tolist()} for own in faces)
    if common := tool & fixed:
        x, y, z = min(common)
        raise ValueError(
            f'groups "tool" and "fixed": both have the node at ({x:.4g}, {y:.4g}, {z:.4g}) m: '
            "leave free facets between them"
        )


def parameters(table: Mapping[str, Any]) -> Parameters:
    """Return the parameters of a region from a table of its law."""
    given = dict(table)
    name = given.pop("law", "linear")
    if name not in LAWS:
        raise ValueError(f"law = {name!r}: must be one of {', '.join(LAWS)}")
    for key in ("young", "poisson"):
        if key not in given:
            raise ValueError(f"law: {key} is required")
    young, poisson = float(given.pop("young")), float(given.pop("poisson"))
    needed = LAWS[name].parameters
    if set(given) != set(needed):
        raise ValueError(f"law = {name!r}: has the parameters {', '.join(needed) or 'young and poisson alone'}")
    least = 0.0 if name == "linear" else Material.LEAST_OF_LARGE
    if not (young > 0 and least <= poisson <= 0.5):
        raise ValueError(f"young = {young} Pa, poisson = {poisson}: must be > 0, and {least} to 0.5 with this law")
    return Parameters.of_moduli(young, poisson, name, given)


def element_of(law: MaterialLaw, element: str, degree: int) -> str:
    """Return the kind of elements, chosen by Poisson's ratio as in a study."""
    if element not in ("auto", "displacement", "mixed"):
        raise ValueError(f'element = {element!r}: must be "auto", "displacement" or "mixed"')
    largest = max(each.poisson for each in law.parameters)
    chosen: dict[str, Any] = {"degree": degree, "element": element}
    mesh = Mesh.model_construct(**chosen)
    found: str = mesh.element_for(largest, is_large=not law.is_linear)
    if found == "displacement" and largest == 0.5:
        raise ValueError('poisson = 0.5: is incompressible: use element = "mixed"')
    return found


def body_of(
    mesh: Any, facets: Any, groups: Mapping[str, int], cells: Any, values: Sequence[Any], *, has_terms: bool
) -> BodyMesh:
    """Return the mesh with the facets of each group, after checks; collective."""
    topology = mesh.topology
    if topology.dim != 3 or mesh.geometry.dim != 3 or mesh.ufl_cell().cellname() != "tetrahedron":
        raise ValueError("the mesh must have tetrahedra in three dimensions")
    if np.dtype(PETSc.ScalarType).kind == "c":
        raise ValueError("PETSc has complex numbers: use one with real numbers")
    if not _SMALLEST <= (extent := _extent(mesh)) <= _LARGEST:
        raise ValueError(f"the mesh is {extent:.3g} m wide: coordinates are metres, {_SMALLEST:g} to {_LARGEST:g}")
    if unknown := set(groups) - set(_GROUPS):
        raise ValueError(f"group {min(unknown)!r}: must be one of {', '.join(_GROUPS)}")
    if "tool" not in groups or not ("fixed" in groups or has_terms):
        raise ValueError('groups need "tool" and "fixed"; without "fixed", a term must hold the body')
    for name, tags, dimension in (("facets", facets, 2), ("cells", cells, 3)):
        if tags is not None and tags.dim != dimension:
            raise ValueError(f"{name}: are tags of dimension {tags.dim}: must be {dimension}")
    exterior, _ = exterior_facets(mesh)
    found: dict[str, Int32Array] = {}
    for name, value in groups.items():
        found[_GROUPS[name]] = np.intersect1d(facets.find(value), exterior).astype(np.int32)
        if not mesh.comm.allreduce(len(found[_GROUPS[name]])):
            raise ValueError(f"group {name!r}: no facet of the boundary has the tag {value}")
    found.setdefault(FIXED, np.empty(0, dtype=np.int32))
    found[FREE] = np.setdiff1d(exterior, np.concatenate([*found.values()])).astype(np.int32)
    body = BodyMesh(mesh, found, topology.index_map(3).size_global, _regions(mesh, cells, values))
    for axis, name in enumerate("xy"):
        if f"mirror_{name}" in groups:
            away = np.abs(boundary_of(body, (MIRROR[name],)).corners[..., axis]).max(initial=0.0)
            if mesh.comm.allreduce(float(away), op=MPI.MAX) > _OFF * extent:
                raise ValueError(f'group "mirror_{name}": its facets must lie in the plane {name} = 0')
    return body


def _regions(mesh: Any, cells: Any, values: Sequence[Any]) -> Int32Array | None:
    """Return the number of the law of each local cell, from the tags of cells."""
    if cells is None:
        return None
    index_map = mesh.topology.index_map(3)
    regions = np.full(index_map.size_local + index_map.num_ghosts, -1, dtype=np.int32)
    for number, value in enumerate(values):
        regions[cells.find(value)] = number
    if mesh.comm.allreduce(bool((regions < 0).any()), op=MPI.LOR):
        raise ValueError(f"cells: some have none of the tags of the law, {', '.join(map(str, values))}")
    return regions


def _extent(mesh: Any) -> float:
    """Return the largest edge (m) of the bounding box; collective."""
    points = np.asarray(mesh.geometry.x)
    ends = np.concatenate([points.max(axis=0, initial=-inf), (-points).max(axis=0, initial=-inf)])
    mesh.comm.Allreduce(MPI.IN_PLACE, ends, MPI.MAX)
    return float((ends[:3] + ends[3:]).max())
