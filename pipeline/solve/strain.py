"""Strain averaged over each cell."""

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from pipeline.arrays import BoolArray, FloatArray
from pipeline.mesh.distribute import BodyMesh
from pipeline.solve.release import Front
from pipeline.solve.rim import clear_cells
from pipeline.stages import stage

_clear: WeakKeyDictionary[Any, BoolArray] = WeakKeyDictionary()


@stage("strain")
def principal_strains(mean_strain: tuple[Any, Any], body: BodyMesh) -> FloatArray:
    """Return the principal strains, ascending, of the strain averaged over each owned cell, shape (cells, 3).

    ``mean_strain`` are the forms of :func:`pipeline.solve.forms.mean_strain_form`. Collective.
    """
    integral, volume = (fem.assemble_vector(form) for form in mean_strain)
    tensors = [np.asarray(v.array).reshape(-1, 3, 3)[: body.owned_cells] for v in (integral, volume)]
    return np.asarray(np.linalg.eigvalsh(tensors[0] / tensors[1]))


def largest_strain(mean_strain: tuple[Any, Any], body: BodyMesh, front: Front | None = None) -> float:
    """Return the largest of :func:`principal_strains`, by magnitude, of cells clear of singular edges; collective.

    Nearer to an edge (:func:`pipeline.solve.rim.clear_cells`) it grows without end as elements there get smaller.
    """
    return largest_of(principal_strains(mean_strain, body), body, front)


def largest_of(principal: FloatArray, body: BodyMesh, front: Front | None = None) -> float:
    """Return the largest of the ``principal`` strains (cells, 3), by magnitude, clear of singular edges; collective."""
    if body.mesh not in _clear:
        _clear[body.mesh] = clear_cells(body, front)
    local = float(np.abs(principal[_clear[body.mesh]]).max(initial=0.0))
    return float(body.comm.allreduce(local, op=MPI.MAX))
