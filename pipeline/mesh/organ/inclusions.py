"""The surfaces of inclusions as triangles to the size field, which the mesh of a body of triangles is made round."""

from collections.abc import Sequence

import gmsh
import numpy as np

from pipeline.arrays import FloatArray, IntArray
from pipeline.compat import gmsh_session
from pipeline.mesh.generate import MeshError, model_options
from pipeline.mesh.organ.field import Field, set_field
from pipeline.scene.regions import draw_inclusions
from pipeline.shapes.regions import Inclusion
from pipeline.stages import stage

_SIZE = 100.0  # extent of the largest one in the model, in its unit
_TRIANGLE = 2


@stage("gmsh")
def inclusion_surfaces(inclusions: Sequence[Inclusion], field: Field) -> list[tuple[FloatArray, IntArray]]:
    """Return points (n, 3), in m, and facets (m, 3) of the surface of each inclusion, its points on the true one.

    Raises:
        MeshError: with gmsh's own words, if it fails.
    """
    if not inclusions:
        return []
    scale = 2 * max(max(inclusion.surface.axes) for inclusion in inclusions) / _SIZE
    with gmsh_session():
        model_options()
        volumes = draw_inclusions(inclusions, lambda length: length / scale)
        set_field(field, scale, gmsh.model.occ)
        try:
            gmsh.model.mesh.generate(2)
        except Exception as error:  # gmsh raises bare Exception
            raise MeshError(f"gmsh: {error or gmsh.logger.getLastError()}") from error
        found = [_triangles(volume) for volume in volumes]
    return [
        (one.surface.project(scale * points), facets) for one, (points, facets) in zip(inclusions, found, strict=True)
    ]


def _triangles(volume: tuple[int, int]) -> tuple[FloatArray, IntArray]:
    """Return points (n, 3) and facets (m, 3), numbers of points, of the faces round a volume of gmsh's model."""
    faces = [tag for _, tag in gmsh.model.getBoundary([volume], oriented=False)]
    corners = np.concatenate([gmsh.model.mesh.getElementsByType(_TRIANGLE, face)[1] for face in faces])
    used, facets = np.unique(corners, return_inverse=True)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    points = coordinates.reshape(-1, 3)[order[np.searchsorted(tags[order], used)]]
    return points, facets.reshape(-1, 3).astype(np.int64)
