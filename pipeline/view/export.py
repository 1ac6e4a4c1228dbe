"""Fields as files that ParaView reads: VTU, or XDMF that holds its own numbers."""

import io
from pathlib import Path
from xml.etree import ElementTree as Xml

import meshio
import numpy as np

from pipeline.files import atomic
from pipeline.mesh.curve import EDGES
from pipeline.scene.model import FIXED, PROBE
from pipeline.view.fields import Fields

# Edges of the quadratic tetrahedron in the order of VTK's nodes 4 to 9.
_VTK_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))


def write_fields(fields: Fields, path: Path) -> Path:
    """Write ``fields`` to ``path``, ``….vtu`` or ``….xdmf``, in place of an earlier file only once it is whole.

    At points: ``displacement`` (m), ``on_probe`` and ``on_support`` (1 or 0). In cells: ``element_size`` (m),
    ``max_strain`` (largest principal strain by magnitude), ``within_epsilon`` (1 or 0).
    """
    mesh = _mesh(fields)
    with atomic(path) as temporary:
        if path.suffix == ".xdmf":
            _xdmf(mesh).write(temporary)
        else:
            meshio.vtu.write(temporary, mesh)
    return path


def _mesh(fields: Fields) -> meshio.Mesh:
    at_points = {name: _marked(fields, group) for name, group in (("on_probe", PROBE), ("on_support", FIXED))}
    in_cells = {"element_size": [fields.sizes], "within_epsilon": [fields.within_epsilon.astype(np.int32)]}
    if fields.displacement is not None and fields.strain is not None:
        at_points["displacement"] = fields.displacement
        in_cells["max_strain"] = [fields.strain]
    curved = fields.cells.shape[1] > 4
    cells = fields.cells[:, _vtk_order()] if curved else fields.cells
    return meshio.Mesh(
        fields.points, [("tetra10" if curved else "tetra", cells)], point_data=at_points, cell_data=in_cells
    )


def _xdmf(mesh: meshio.Mesh) -> Xml.ElementTree:
    """Return an XDMF document with its numbers as text: meshio's own writer needs h5py, and a second file."""
    (block,) = mesh.cells
    root = Xml.Element("Xdmf", Version="3.0")
    grid = Xml.SubElement(Xml.SubElement(root, "Domain"), "Grid", Name="Grid", GridType="Uniform")
    Xml.SubElement(grid, "Time", Value="0")  # some readers ask for it
    kind = {"tetra": "Tetrahedron", "tetra10": "Tetrahedron_10"}[block.type]
    topology = Xml.SubElement(grid, "Topology", TopologyType=kind, NumberOfElements=str(len(block.data)))
    _add_numbers(topology, block.data)
    _add_numbers(Xml.SubElement(grid, "Geometry", GeometryType="XYZ"), mesh.points)
    in_cells = {name: values for name, (values,) in mesh.cell_data.items()}
    for centre, data in (("Node", mesh.point_data), ("Cell", in_cells)):
        for name, values in data.items():
            shape = "Vector" if values.ndim > 1 else "Scalar"
            _add_numbers(Xml.SubElement(grid, "Attribute", Name=name, AttributeType=shape, Center=centre), values)
    return Xml.ElementTree(root)


def _add_numbers(parent: Xml.Element, values: np.ndarray) -> None:
    whole = np.issubdtype(values.dtype, np.integer)
    item = Xml.SubElement(
        parent,
        "DataItem",
        Dimensions=" ".join(map(str, values.shape)),
        Format="XML",
        NumberType="Int" if whole else "Float",
        Precision=str(values.dtype.itemsize),
    )
    text = io.StringIO()
    np.savetxt(text, values, fmt="%d" if whole else "%.16g")
    item.text = text.getvalue()


def _vtk_order() -> list[int]:
    """Return the positions of a cell's nodes in the order of VTK."""
    edges = [tuple(edge) for edge in EDGES.tolist()]
    return [0, 1, 2, 3, *(4 + edges.index(edge) for edge in _VTK_EDGES)]


def _marked(fields: Fields, group: str) -> np.ndarray:
    """Mark the points of a group of facets, and the mid nodes between them."""
    marks = np.zeros(len(fields.points), dtype=np.int32)
    facets = np.sort(fields.facets[group], axis=1)
    marks[facets] = 1
    if fields.cells.shape[1] > 4:
        pairs = np.unique(facets[:, [[0, 1], [0, 2], [1, 2]]].reshape(-1, 2), axis=0)
        size = len(fields.points)
        known = pairs[:, 0] * size + pairs[:, 1]
        for number, edge in enumerate(EDGES, start=4):
            ends = np.sort(fields.cells[:, edge], axis=1)
            on_facet = np.isin(ends[:, 0] * size + ends[:, 1], known)
            marks[fields.cells[on_facet, number]] = 1
    return marks
