"""What there is to see of one case: mesh, element sizes, displacement and strain as arrays of the whole body."""

from dataclasses import dataclass
from math import inf

import numpy as np

from pipeline.arrays import BoolArray, FloatArray, IntArray
from pipeline.study.sweep import Case


@dataclass(frozen=True)
class Fields:
    """The mesh of a case and, once solved, what happens on it; SI units, on one process.

    ``points`` (n, 3); ``cells`` (m, 4), or (m, 10) with mid nodes in basix's order; ``facets`` maps the name of a group
    to its boundary triangles (k, 3). ``displacement`` (n, 3) and ``strain`` (m,), the largest principal strain of each
    cell by magnitude, are None where only the mesh was asked for. The mesh is conforming to the mirror ``planes``
    ("x": x = 0); ``dofs`` counts the whole body's unknowns.
    """

    case: Case
    points: FloatArray
    cells: IntArray
    facets: dict[str, IntArray]
    planes: tuple[str, ...] = ()
    displacement: FloatArray | None = None
    strain: FloatArray | None = None
    dofs: int = 0

    @property
    def contact(self) -> FloatArray:
        """The point round which ε is measured (m)."""
        return np.array(self.case.frame.point)

    @property
    def epsilon(self) -> float:
        """Radius of the fine mesh (m), infinite where it holds the whole body."""
        return inf if self.case.is_full else self.case.mesh.epsilon

    @property
    def centres(self) -> FloatArray:
        """Centroid (m) of each cell's corners, shape (m, 3)."""
        return np.asarray(self.points[self.cells[:, :4]].mean(axis=1))

    @property
    def sizes(self) -> FloatArray:
        """Edge (m) of the regular tetrahedron of each cell's volume."""
        corners = self.points[self.cells[:, :4]]
        volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
        return np.asarray((6 * np.sqrt(2) * volume) ** (1 / 3))

    @property
    def within_epsilon(self) -> BoolArray:
        """Whether the middle of each cell is nearer to the contact than ε."""
        return np.asarray(np.linalg.norm(self.centres - self.contact, axis=1) <= self.epsilon)
