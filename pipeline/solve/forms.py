"""Forms of linear elasticity, compiled once and kept in a cache of the project's own.

K = λ A_λ + μ A_μ with A_λ(u, v) = ∫ div u div v, A_μ(u, v) = ∫ 2 ε(u) : ε(v). λ and μ are constants of the
compiled form, or functions that are constant on each cell, so that no value of them is ever compiled in.
"""

from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from pipeline import compat
from pipeline.arrays import BoolArray, Int32Array
from pipeline.mesh.curve import EDGES
from pipeline.mesh.distribute import distribute
from pipeline.mesh.generate import MeshArrays
from pipeline.solve.compiled import cellwise_space, form, vector_space
from pipeline.solve.kernels import assembles, has_kernel
from pipeline.solve.kernels.curved import quadrature_degree
from pipeline.solve.kernels.stiffness import cell_kernel
from pipeline.solve.material import MaterialLaw, strain

# Marks of cells, and the bulge of an edge, in units of its length, that rounding may leave.
_NEITHER, _STRAIGHT, _CURVED = 0, 1, 2
_FLAT = 1e-9
_curved: WeakKeyDictionary[Any, BoolArray | None] = WeakKeyDictionary()


class ElasticForms:
    """Forms of elasticity on one space, each made when first asked for (collective).

    ``lame`` are λ and μ in them: constants, or, on a mesh of several ``regions`` (of the local cells, ghosts too),
    functions that are constant on each cell. ``displacement`` is the function that ``action``, K u, acts on.
    """

    def __init__(self, space: Any, regions: Int32Array | None = None):
        self._space, self._regions = space, regions
        self.displacement = fem.Function(space)
        if regions is None:
            self.lame = fem.Constant(space.mesh, 1.0), fem.Constant(space.mesh, 1.0)
            return
        cellwise = cellwise_space(space.mesh, ())
        self.lame = fem.Function(cellwise), fem.Function(cellwise)
        self._cells = compat.cell_dofs(cellwise).reshape(-1)

    def set_law(self, law: MaterialLaw) -> None:
        """Set λ and μ (Pa) for the next assembly."""
        for place, values in zip(self.lame, (law.lame_lambda, law.lame_mu), strict=True):
            if self._regions is None:
                (place.value,) = values
            else:
                place.x.array[self._cells] = np.array(values)[self._regions if len(values) > 1 else 0]

    def by_region(self, values: tuple[float, ...]) -> Any:
        """Return a constant of forms, or a function, that has one of ``values`` in each region."""
        if self._regions is None:
            return fem.Constant(self._space.mesh, values[0])
        result = fem.Function(cellwise_space(self._space.mesh, ()))
        result.x.array[self._cells] = np.array(values)[self._regions if len(values) > 1 else 0]
        return result

    @cached_property
    def stiffness(self) -> Any:
        """K."""
        return self._form(ufl.TrialFunction(self._space), dx(self._space), self._kernels())

    @cached_property
    def curved_stiffness(self) -> Any:
        """The part of K from cells with curved edges: the same code, but no other cell is marked for it."""
        return self._form(ufl.TrialFunction(self._space), dx(self._space, curved_only=True))

    @cached_property
    def action(self) -> Any:
        """K u."""
        return self._form(self.displacement, dx(self._space))

    def _kernels(self) -> dict[int, int]:
        """Return a kernel for the straight cells, which takes a twelfth of the time of the generated one."""
        degree, mesh = compat.degree(self._space), self._space.mesh
        if assembles(self._space) or not has_kernel(degree):
            return {}
        kernel = cell_kernel(degree, of_regions=self._regions is not None)
        return {compat.EVERYWHERE if curved_cells(mesh) is None else _STRAIGHT: kernel}

    def _form(self, u: Any, measure: Any, kernels: dict[int, int] | None = None) -> Any:
        v, (lame_lambda, lame_mu) = ufl.TestFunction(self._space), self.lame
        energy = lame_lambda * ufl.div(u) * ufl.div(v) + 2 * lame_mu * ufl.inner(strain(u), strain(v))
        return form(energy * measure, kernels)


def dx(space: Any, *, curved_only: bool = False, more: int = 0) -> Any:
    """Return the measure for forms of elasticity on ``space``, with its quadrature; of straight cells, too, or not.

    On straight cells 2p - 2 is exact; few cells of a curved mesh are curved. On straight cells degrees are ``more``
    than that, where integrands are no polynomials of degree 2p - 2.
    """
    degree, mesh = compat.degree(space), space.mesh
    exact, enough = ({"quadrature_degree": d} for d in (2 * degree - 2 + more, quadrature_degree(degree)))
    curved = curved_cells(mesh)
    if curved is None:
        return ufl.dx(metadata=exact)
    marks = np.where(curved, _CURVED, _NEITHER if curved_only else _STRAIGHT)
    measure = ufl.Measure("dx", domain=mesh, subdomain_data=compat.cell_tags(mesh, marks))
    return measure(_STRAIGHT, metadata=exact) + measure(_CURVED, metadata=enough)


def curved_cells(mesh: Any) -> BoolArray | None:
    """Tell which local cells have a mid node away from the middle of its edge, None if cells have no mid nodes."""
    if mesh not in _curved:
        _curved[mesh] = _find_curved(mesh)
    return _curved[mesh]


def has_curved_cells(mesh: Any) -> bool:
    """Tell whether any rank has a curved cell; collective."""
    curved = curved_cells(mesh)
    return bool(mesh.comm.allreduce(curved is not None and bool(curved.any()), op=MPI.LOR))


def _find_curved(mesh: Any) -> BoolArray | None:
    nodes = compat.geometry_dofs(mesh)
    if nodes.shape[1] == 4:
        return None
    points = mesh.geometry.x[nodes]
    ends = points[:, EDGES]
    bulge = np.abs(points[:, 4:] - ends.mean(axis=2)).max(axis=(1, 2))
    return np.asarray(bulge > _FLAT * np.abs(ends[:, :, 1] - ends[:, :, 0]).max(axis=(1, 2)))


def compile_elastic(degree: int, *, straight: bool, of_regions: bool) -> None:
    """Compile the forms of displacements of ``degree`` and of those below, and of one degree more for the error bar."""
    regions = np.zeros(1, dtype=np.int32) if of_regions else None
    mesh = distribute(MPI.COMM_SELF, one_cell(straight=straight)).mesh
    for level in range(1, degree + 2):
        space = vector_space(mesh, level)
        forms = ElasticForms(space, regions)
        _ = forms.stiffness, forms.action


def one_cell(*, straight: bool) -> MeshArrays:
    """Return a mesh of one tetrahedron, to compile forms on."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    middle = corners[EDGES].mean(axis=1)
    points = corners if straight else np.vstack([corners, middle])
    cells = np.arange(len(points), dtype=np.int64)[None, :]
    return MeshArrays(points, cells, {"fixed": np.array([[0, 1, 2]])}, np.array([0]), 0.0)
