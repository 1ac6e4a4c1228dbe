"""Small separate shells outside a surface, and bubbles inside it."""

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.files.check import check_shells, shell_volumes
from epsmesh.shapes.files.edges import Edges


def largest_shell(points: FloatArray, facets: IntArray, unit: float, most: float) -> tuple[IntArray, list[str]]:
    """Return the facets of the shell with the largest volume, and notices about the others.

    Raises:
        SurfaceError: if the others enclose more than the share ``most`` of its volume.
    """
    edges = Edges(facets)
    count, shell = edges.shells
    if count == 1:
        return facets, []
    volumes = np.abs(shell_volumes(points, facets, shell, count))
    largest = int(volumes.argmax())
    share = float(volumes.sum() / volumes[largest]) - 1 if volumes[largest] else np.inf
    if share > most:
        check_shells(points, edges, unit)
    kept = facets[shell == largest]
    return kept, [f"{count - 1:,} shells beside the largest one, {100 * share:.2g} % of its volume, left out"]
