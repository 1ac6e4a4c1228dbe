"""Strain averaged over each cell."""

from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from pipeline.arrays import FloatArray
from pipeline.mesh.distribute import BodyMesh
from pipeline.stages import stage


@stage("strain")
def principal_strains(mean_strain: tuple[Any, Any], body: BodyMesh) -> FloatArray:
    """Return the principal strains, ascending, of the strain averaged over each owned cell, shape (cells, 3).

    ``mean_strain`` are the forms of :func:`pipeline.solve.forms.mean_strain_form`. Collective.
    """
    integral, volume = (fem.assemble_vector(form) for form in mean_strain)
    tensors = [np.asarray(v.array).reshape(-1, 3, 3)[: body.owned_cells] for v in (integral, volume)]
    return np.asarray(np.linalg.eigvalsh(tensors[0] / tensors[1]))


def largest_strain(mean_strain: tuple[Any, Any], body: BodyMesh) -> float:
    """Return the largest of :func:`principal_strains`, by magnitude; collective."""
    local = float(np.abs(principal_strains(mean_strain, body)).max(initial=0.0))
    return float(body.comm.allreduce(local, op=MPI.MAX))
