"""A case as a scene of SOFA: its mesh, tissue, support and tool, with the force of this program as a reference."""

from pathlib import Path

import meshio
import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.files import atomic, write_whole
from epsmesh.pages import render_text
from epsmesh.report.words import barred
from epsmesh.scene.model import FIXED, PROBE
from epsmesh.view.fields import Fields

_TEMPLATE = Path(__file__).parent / "templates" / "sofa.py.j2"
# Stiffness of the springs that move the tissue with the tool, in units of E times the largest element size: large
# enough to prescribe the displacement to a millionth, and small enough for a direct solver in double precision.
_HOLD = 1e6


def write_sofa(fields: Fields, stem: Path, title: str, version: str) -> list[Path]:
    """Write ``….py``, ``….msh`` and ``….npz`` for SofaPython3; return their paths.

    The mesh is that of ``fields`` with straight edges, as Gmsh 2.2 text: SOFA has linear tetrahedra. The points under
    the tool get the displacement of ``fields``. All tissues must be linear.

    Raises:
        OSError: if a file cannot be written.
    """
    assert fields.displacement is not None
    paths = [stem.with_name(f"{stem.name}.{ending}") for ending in ("py", "msh", "npz")]
    corners = fields.cells[:, :4]
    kept, numbers = np.unique(corners, return_inverse=True)
    points, cells = fields.points[kept], numbers.reshape(corners.shape)
    tool, support = (np.searchsorted(kept, np.unique(fields.facets[group][:, :3])) for group in (PROBE, FIXED))
    tool = np.setdiff1d(tool, support)
    young, poisson = _tissues(fields)
    scene = render_text(
        _TEMPLATE,
        title=" ".join(title.replace("\\", "/").replace('"', "'").split()),
        version=version,
        name=stem.name,
        force=fields.force,
        bar=fields.force_error,
        found=barred(fields.force, abs(fields.force) * fields.force_error, "N"),
        degree=fields.case.mesh.degree,
        depth=fields.case.probe.depth,
        axis=[float(part) for part in fields.case.frame.axes[2]],
        hold=_HOLD * float(young.max() * fields.sizes.max()),
    )
    region = np.zeros(len(cells), np.int32) if fields.regions is None else fields.regions.astype(np.int32)
    tags = {"gmsh:physical": [region + 1], "gmsh:geometrical": [region + 1]}
    with atomic(paths[1]) as temporary:
        meshio.gmsh.write(temporary, meshio.Mesh(points, [("tetra", cells)], cell_data=tags), "2.2", binary=False)
    with atomic(paths[2]) as temporary:
        np.savez_compressed(
            temporary, tool=tool, support=support, moved=points[tool] + fields.displacement[kept[tool]],
            young=young, poisson=poisson,
        )  # fmt: skip
    write_whole(paths[0], scene)
    return paths


def _tissues(fields: Fields) -> tuple[FloatArray, FloatArray]:
    """Return E (Pa) and ν of each cell."""
    case = fields.case
    if fields.regions is None:
        return np.full(len(fields.cells), case.material.young), np.full(len(fields.cells), case.material.poisson)
    of = [case.tissues[list(case.region_names).index(name)] for name in fields.region_names]
    young, poisson = (np.array([getattr(tissue, key) for tissue in of]) for key in ("young", "poisson"))
    return young[fields.regions], poisson[fields.regions]
