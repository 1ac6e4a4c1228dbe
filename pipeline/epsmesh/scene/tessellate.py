"""Triangles of a solid in a CAD file: ``python -m epsmesh.scene.tessellate FILE UNIT OUT.npz``.

It is a separate program, so that a study is validated without a geometry kernel in its process. It imports neither MPI
nor solvers. It prints what is wrong with a file, and then exits with status 3.
"""

import sys
from contextlib import suppress
from pathlib import Path

import gmsh
import numpy as np

from epsmesh.arrays import FloatArray

# Edges around a circle, and largest and smallest size of triangles, in units of the solid's extent.
_ROUND, _LARGEST, _SMALLEST = 48, 1 / 5, 1 / 80
# The kernel enlarges its bounding box by its tolerance.
_TOLERANCE, _DIGITS = 1e-7, 6
_REFUSED = 3
_NAMES = {"m": "M", "cm": "CM", "mm": "MM", "um": "UM", "µm": "UM", "in": "INCH"}


class NotASolid(Exception):
    """The file does not contain exactly one solid; the message says what was found."""


def read_solid(path: str, unit: str, factor: float = 1.0) -> int:
    """Add the single solid of a file to gmsh's current model, its numbers in ``unit`` times ``factor``.

    Raises:
        NotASolid: if there is none, or several.
    """
    gmsh.option.setString("Geometry.OCCTargetUnit", _NAMES[unit])
    gmsh.option.setNumber("Geometry.OCCImportLabels", 0)
    gmsh.option.setNumber("Geometry.OCCScaling", factor)
    try:
        found = gmsh.model.occ.importShapes(path)
    except Exception as error:
        raise NotASolid(f"the geometry kernel cannot read it: {str(error) or gmsh.logger.getLastError()}") from None
    finally:
        gmsh.option.setNumber("Geometry.OCCScaling", 1.0)
    gmsh.model.occ.synchronize()
    solids = [tag for dim, tag in found if dim == 3]
    if len(solids) == 1 and len(found) == 1:
        return int(solids[0])
    if len(solids) > 1:
        raise NotASolid(
            f"has {len(solids)} solids: unite them, or export each to a file of its own. One is the body, without "
            "hollows for the others; these are its regions, [[body.region]]"
        )
    faces = len(gmsh.model.getEntities(2))
    raise NotASolid(
        f"has {faces} faces that bound no solid: sew them to a closed shell, make a solid of that, and export it"
        if faces else "has no solid: export the solid itself, not curves, points or an empty file"
    )  # fmt: skip


def tessellate(path: str, unit: str) -> dict[str, FloatArray]:
    """Return the triangles of the solid, in the file's unit, with the kernel's data of its faces."""
    volume = read_solid(path, unit)
    box = np.array(gmsh.model.occ.getBoundingBox(3, volume)).reshape(2, 3)
    extent = float(np.ptp(box, axis=0).max())
    for name, value in {
        "General.NumThreads": 1,
        "Mesh.MeshSizeFromCurvature": _ROUND,
        "Mesh.MeshSizeMax": _LARGEST * extent,
        "Mesh.MeshSizeMin": _SMALLEST * extent,
    }.items():
        gmsh.option.setNumber(name, value)
    gmsh.model.mesh.generate(2)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    number = np.full(int(tags.max()) + 1, -1)
    number[tags] = np.arange(len(tags))
    faces = [tag for _, tag in gmsh.model.getBoundary([(3, volume)], oriented=False)]
    parts = [_face(face, number) for face in faces]
    counts = [len(part[0]) for part in parts]
    return {
        "points": coordinates.reshape(-1, 3),
        "facets": np.concatenate([part[0] for part in parts]),
        "normals": np.concatenate([part[1] for part in parts]),
        "face": np.repeat(np.arange(len(faces)), counts),
        "is_plane": np.array([gmsh.model.getType(2, face) == "Plane" for face in faces]),
        "radius": np.array([part[2] for part in parts]),
        "box": _tight(box),
        "volume": np.array(gmsh.model.occ.getMass(3, volume)),
    }


def _face(face: int, number: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return the triangles (n, 3) of a face, the normals (n, 3, 3) at their corners, and its smallest radius there."""
    kinds, _, nodes = gmsh.model.mesh.getElements(2, face)
    if list(kinds) != [2]:
        raise NotASolid(f"face {face} cannot be triangulated: check the solid in the CAD program")
    corners = nodes[0].reshape(-1, 3)
    tags, _, parameters = gmsh.model.mesh.getNodes(2, face, includeBoundary=True, returnParametricCoord=True)
    normals = np.array(gmsh.model.getNormal(face, parameters)).reshape(-1, 3)
    at = np.zeros(len(number), dtype=np.int64)
    at[tags] = np.arange(len(tags))
    curvature = np.abs(np.array(gmsh.model.getCurvature(2, face, parameters)))
    most = float(np.max(curvature[np.isfinite(curvature)], initial=0.0))
    return number[corners], normals[at[corners]], float(f"{1 / most:.9g}") if most > 0 else np.inf


def _tight(box: FloatArray) -> FloatArray:
    """Return the bounding box (2, 3) without the kernel's tolerance."""
    tight = box + np.array([[_TOLERANCE], [-_TOLERANCE]])
    extent = float(np.ptp(tight, axis=0).max())
    places = _DIGITS - int(np.ceil(np.log10(extent)))
    return np.round(tight, max(0, places)) + 0.0


def main(path: str, unit: str, target: str) -> int:
    """Write the triangles of the solid in a file; return the exit status."""
    gmsh.initialize([""], readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        np.savez(Path(target), **tessellate(path, unit))
    except NotASolid as problem:
        print(problem)
        return _REFUSED
    except Exception as error:  # gmsh raises bare Exception
        print(f"its faces cannot be triangulated: {error}")
        return _REFUSED
    finally:
        with suppress(Exception):
            gmsh.finalize()
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
