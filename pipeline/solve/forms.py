"""Forms of linear elasticity, compiled once and kept in a cache of the project's own.

K = λ A_λ + μ A_μ with A_λ(u, v) = ∫ div u div v, A_μ(u, v) = ∫ 2 ε(u) : ε(v). λ and μ are constants of the
compiled form, so that no value of them is ever compiled in.
"""

import fcntl
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI

from pipeline import compat
from pipeline.mesh.curve import EDGES
from pipeline.mesh.distribute import distribute
from pipeline.mesh.generate import MeshArrays

# Marks of cells, and the bulge of an edge, in units of its length, that rounding may leave.
_STRAIGHT, _CURVED = 1, 2
_FLAT = 1e-9


@dataclass(frozen=True)
class ElasticForms:
    """Forms on one space; ``lame`` are their constants λ and μ, ``displacement`` the function in ``action``."""

    stiffness: Any
    action: Any
    displacement: Any
    lame: tuple[Any, Any]

    def set_lame(self, lame_lambda: float, lame_mu: float) -> None:
        """Set λ and μ (Pa) for the next assembly."""
        for constant, value in zip(self.lame, (lame_lambda, lame_mu), strict=True):
            constant.value = value


def dx(space: Any) -> Any:
    """Return the measure for forms of elasticity on ``space``, with its quadrature.

    On straight cells 2p - 2 is exact. The map of a quarter-point element varies within the cell, and 2p reads F up to
    0.07 % low there; at p = 2, degree 4 has points at which the map is singular. Few cells of a curved mesh are curved.
    """
    degree, mesh = compat.degree(space), space.mesh
    exact, enough = ({"quadrature_degree": d} for d in (2 * degree - 2, max(6, 2 * degree)))
    curved = _is_curved(mesh)
    if curved is None:
        return ufl.dx(metadata=exact)
    measure = ufl.Measure(
        "dx", domain=mesh, subdomain_data=compat.cell_tags(mesh, np.where(curved, _CURVED, _STRAIGHT))
    )
    return measure(_STRAIGHT, metadata=exact) + measure(_CURVED, metadata=enough)


def _is_curved(mesh: Any) -> npt.NDArray[np.bool_] | None:
    """Tell which local cells have a mid node away from the middle of its edge, None if cells have no mid nodes."""
    nodes = compat.geometry_dofs(mesh)
    if nodes.shape[1] == 4:
        return None
    points = mesh.geometry.x[nodes]
    ends = points[:, EDGES]
    bulge = np.abs(points[:, 4:] - ends.mean(axis=2)).max(axis=(1, 2))
    return np.asarray(bulge > _FLAT * np.abs(ends[:, :, 1] - ends[:, :, 0]).max(axis=(1, 2)))


def strain(u: Any) -> Any:
    """Small strain tensor ε(u)."""
    return ufl.sym(ufl.grad(u))


def elastic_forms(space: Any) -> ElasticForms:
    """Return the forms of elasticity on ``space``; collective."""
    mesh = space.mesh
    u, v, w = ufl.TrialFunction(space), ufl.TestFunction(space), fem.Function(space)
    lame = fem.Constant(mesh, 1.0), fem.Constant(mesh, 1.0)
    measure = dx(space)

    def energy(a: Any, b: Any) -> Any:
        return (lame[0] * ufl.div(a) * ufl.div(b) + 2 * lame[1] * ufl.inner(strain(a), strain(b))) * measure

    cache = str(form_cache())
    return ElasticForms(compat.form(energy(u, v), cache), compat.form(energy(w, v), cache), w, lame)


def mean_strain_form(space: Any, displacement: Any) -> tuple[Any, Any]:
    """Return forms of the integral of the strain, and of the volume, of each cell; collective."""
    tensors = compat.cellwise_tensor_space(space.mesh)
    test = ufl.TestFunction(tensors)
    measure, cache = dx(space), str(form_cache())
    one = ufl.as_tensor(np.ones((3, 3)).tolist())
    integrands = (ufl.inner(strain(displacement), test), ufl.inner(one, test))
    integral, volume = (compat.form(integrand * measure, cache) for integrand in integrands)
    return integral, volume


def form_cache() -> Path:
    """Return the folder of compiled forms: one for each kind of processor, since code is made for the machine."""
    root = os.environ.get("EPSMESH_CACHE") or Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "epsmesh"
    try:
        text = Path("/proc/cpuinfo").read_text()
        features = next(line for line in text.splitlines() if line.startswith(("flags", "Features")))
    except (OSError, StopIteration):
        features = ""
    return Path(root) / "forms" / hashlib.sha256(features.encode()).hexdigest()[:12]


@contextmanager
def compiling() -> Iterator[None]:
    """Hold the cache's lock, which the system releases when its holder dies, however it dies.

    A process killed while compiling leaves a source file without its mark of completion, for which every later run
    would wait in vain; a mark without its source fails every later run. Whoever holds the lock may remove such orphans.
    """
    folder = form_cache()
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for source in folder.glob("*.c"):
            if not source.with_suffix(".c.cached").exists():
                source.unlink()
        for mark in folder.glob("*.c.cached"):
            if not mark.with_suffix("").exists():
                mark.unlink()
        yield


def compile_elastic(degree: int, *, straight: bool) -> None:
    """Compile the forms of displacements of ``degree`` and of those below, and of one degree more for the error bar."""
    mesh = distribute(MPI.COMM_SELF, one_cell(straight=straight)).mesh
    for level in range(1, degree + 2):
        space = compat.vector_space(mesh, level)
        forms = elastic_forms(space)
        if level == degree:
            mean_strain_form(space, forms.displacement)


def one_cell(*, straight: bool) -> MeshArrays:
    """Return a mesh of one tetrahedron, to compile forms on."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    middle = corners[EDGES].mean(axis=1)
    points = corners if straight else np.vstack([corners, middle])
    cells = np.arange(len(points), dtype=np.int64)[None, :]
    return MeshArrays(points, cells, {"fixed": np.array([[0, 1, 2]])}, np.array([0]), 0.0)
