"""What is read off a solution cell by cell, from the mean of ∇u over each: principal strains, and largest values.

To report another one, write it as a function of :class:`Cells`, enter it in :data:`LARGEST`, and give it a line in
``pipeline/quantities.toml``. What is in Pa there is scaled with Young's modulus and the depth, all else with the depth.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from pipeline.arrays import BoolArray, FloatArray
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.solve.compiled import cellwise_space, form, vector_space
from pipeline.solve.forms import dx, one_cell
from pipeline.solve.physics import MaterialLaw, of_regions
from pipeline.solve.rim import clear_cells
from pipeline.solve.spaces import Front
from pipeline.stages import stage

# Of each mesh, by the front of its slit: which cells are clear of singular edges.
_clear: WeakKeyDictionary[Any, dict[Front | None, BoolArray]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Cells:
    """Owned cells of a solution: the mean ``gradient`` of the displacement (n, 3, 3), and λ and μ (n), in Pa.

    λ is infinite where tissue is incompressible; of mixed elements λ tr ε is not the mean pressure, so that a stress
    is not known there: return what is not a number.
    """

    gradient: FloatArray
    lame_lambda: FloatArray
    lame_mu: FloatArray
    is_linear: bool

    @cached_property
    def principal_strains(self) -> FloatArray:
        """Principal strains (n, 3), ascending; at large displacements they are principal stretches less 1."""
        if self.is_linear:
            return np.asarray(np.linalg.eigvalsh((self.gradient + self.gradient.swapaxes(1, 2)) / 2))
        return np.asarray(np.linalg.svd(np.eye(3) + self.gradient, compute_uv=False)[:, ::-1] - 1)


def _max_strain(cells: Cells) -> FloatArray:
    return np.asarray(np.abs(cells.principal_strains).max(axis=1, initial=0.0))


# Of which the largest value is reported, by its name in the dataset: one number for each cell. Nearer to a singular
# edge (:func:`pipeline.solve.rim.clear_cells`) strains grow without end as elements there get smaller.
LARGEST: dict[str, Callable[[Cells], FloatArray]] = {"max_strain": _max_strain}


class CellValues:
    """Reads what the present ``displacement`` of a space does to each cell of its mesh."""

    def __init__(self, body: BodyMesh, displacement: Any):
        """Compile; collective."""
        self._body = body
        space = displacement.function_space
        tensors = cellwise_space(space.mesh, (3, 3))
        test, ones = ufl.TestFunction(tensors), ufl.as_tensor(np.ones((3, 3)).tolist())
        self._integral, self._volume = (
            form(ufl.inner(integrand, test) * dx(space)) for integrand in (ufl.grad(displacement), ones)
        )

    @stage("strain")
    def cells(self, law: MaterialLaw) -> Cells:
        """Return what the owned cells do, of the material of ``law``; collective."""
        owned = self._body.owned_cells
        integral, volume = (
            np.asarray(fem.assemble_vector(part).array).reshape(-1, 3, 3)[:owned]
            for part in (self._integral, self._volume)
        )
        regions = self._body.regions
        return Cells(
            gradient=integral / volume,
            lame_lambda=of_regions(law.lame_lambda, regions, owned),
            lame_mu=of_regions(law.lame_mu, regions, owned),
            is_linear=law.is_linear,
        )

    def principal_strains(self, law: MaterialLaw) -> FloatArray:
        """Return the principal strains of each owned cell, ascending, (cells, 3); collective."""
        return self.cells(law).principal_strains

    def largest(self, law: MaterialLaw, front: Front | None = None) -> dict[str, Any]:
        """Return the largest of each of ``LARGEST`` over cells clear of singular edges, by name; collective."""
        cells, clear = self.cells(law), self._clear_of(front)
        found = [value(cells)[clear].max(initial=-np.inf) for value in LARGEST.values()]
        # Not a number on one rank is none on all, which MPI's own maximum does not promise.
        largest = np.max(self._body.comm.allgather(found), axis=0)
        return {name: float(value) if value > -np.inf else 0.0 for name, value in zip(LARGEST, largest, strict=True)}

    def _clear_of(self, front: Front | None) -> BoolArray:
        known = _clear.setdefault(self._body.mesh, {})
        if front not in known:
            known[front] = clear_cells(self._body, front)
        return known[front]


def compile_cell_values(degree: int, *, straight: bool) -> None:
    """Compile what reads displacements of ``degree``."""
    body = distribute(MPI.COMM_SELF, one_cell(straight=straight))
    CellValues(body, fem.Function(vector_space(body.mesh, degree)))
