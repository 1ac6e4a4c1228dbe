"""Fields as a file that ParaView reads."""

from pathlib import Path

import meshio
import numpy as np

from epsmesh import compat
from epsmesh.files import atomic
from epsmesh.scene.model import FIXED, PROBE
from epsmesh.shapes.triangles import facet_keys
from epsmesh.solve.points.derived import von_mises
from epsmesh.view.fields import Fields

# Names of cells for meshio, and degrees, by the number of nodes.
_KINDS = {4: "tetra", 10: "tetra10", 20: "VTK_LAGRANGE_TETRAHEDRON"}
_DEGREES = {4: 1, 10: 2, 20: 3}
_ZERO = 1e-9


def write_fields(fields: Fields, path: Path) -> Path:
    """Write ``fields`` to ``path``, ``….vtu``, in place of an earlier file only once it is whole.

    At points: ``displacement`` (m), ``on_probe`` and ``on_support`` (1 or 0). In cells: ``element_size`` (m),
    ``max_strain`` (largest principal strain by magnitude), ``within_epsilon`` (1 or 0), ``region``, and ``young`` (Pa)
    where it varies within a region; ``stress`` (Pa, nine components, at the cell's centre) and ``von_mises``. The cells
    have the displacement's degree.
    """
    points, cells, displacement = fields.points, fields.cells, fields.displacement
    if (nodes := fields.nodes) is not None:
        points, cells, displacement = nodes.points, nodes.cells, nodes.displacement
    with atomic(path) as temporary:
        meshio.vtu.write(temporary, _mesh(fields, points, cells, displacement))
    return path


def _mesh(fields: Fields, points: np.ndarray, cells: np.ndarray, displacement: np.ndarray | None) -> meshio.Mesh:
    """Return the fields on ``cells`` of any degree, in the order of the fields' own, with ``points``."""
    count = len(fields.cells)
    at_points = {
        name: _marked(fields, group, len(points), cells) for name, group in (("on_probe", PROBE), ("on_support", FIXED))
    }
    regions = np.zeros(count, np.int32) if fields.regions is None else fields.regions.astype(np.int32)
    in_cells = {
        "element_size": fields.sizes,
        "within_epsilon": fields.within_epsilon.astype(np.int32),
        "region": regions,
    }
    if displacement is not None:
        at_points["displacement"] = displacement
    if fields.strain is not None:
        in_cells["max_strain"] = fields.strain
    if fields.young is not None:
        in_cells["young"] = fields.young
    if fields.stress is not None:
        in_cells |= {"stress": fields.stress.reshape(-1, 9), "von_mises": von_mises(fields.stress)}
    of_vtk = cells[:, compat.vtk_order(cells.shape[1])]
    blocks = {name: [values] for name, values in in_cells.items()}
    return meshio.Mesh(points, [(_KINDS[cells.shape[1]], of_vtk)], point_data=at_points, cell_data=blocks)


def _marked(fields: Fields, group: str, count: int, cells: np.ndarray) -> np.ndarray:
    """Mark the nodes of ``cells`` on a group of facets, of ``count`` nodes."""
    marks = np.zeros(count, dtype=np.int32)
    nodes = compat.equidistant_nodes(_DEGREES[cells.shape[1]])
    weights = np.column_stack([1 - nodes.sum(axis=1), nodes])
    known = facet_keys(fields.facets[group])
    for corner in range(4):
        facets = np.delete(fields.cells[:, :4], corner, axis=1)
        chosen = np.isin(facet_keys(facets), known)
        marks[cells[np.ix_(chosen, np.abs(weights[:, corner]) < _ZERO)]] = 1
    return marks
