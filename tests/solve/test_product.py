"""Matrix-free products agree with assembled matrices, and so do solvers that use them."""

import numpy as np
import pytest
from petsc4py import PETSc

from epsmesh.solve.conditions import Conditions
from epsmesh.solve.elements.pressures import Pressures
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import ElasticSpace, Spaces
from tests.solve.test_mixed import make_mesh

LAYERS = {"body": {"layer": [{"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.48}]}}


@pytest.mark.parametrize(
    ("degree", "material", "changes"),
    [
        (2, MaterialLaw.of(3.0, 1.0), {}),
        (3, MaterialLaw.of(3.0, 1.0), {}),
        (4, MaterialLaw.of(0.0, 1.0), {}),
        (2, MaterialLaw.of((3.0, 50.0), (1.0, 20.0)), LAYERS),
    ],
)
def test_it_is_the_product_of_the_matrix(degree, material, changes):
    """On straight cells, and on curved cells with quarter points, of one material and of two."""
    space = ElasticSpace(make_mesh(**changes), degree, Conditions())
    free = np.setdiff1d(np.arange(space.owned), space.prescribed)
    with (
        space.lend(material) as matrix,
        space.lend(material, entries=False) as operator,
    ):
        x, y = matrix.createVecs()
        z = y.duplicate()
        x.array[:] = np.random.default_rng(3).standard_normal(x.getSize())
        held = x.array[space.prescribed].copy()
        operator.mult(x, z)
        assert np.array_equal(z.array[space.prescribed], held)
        x.array[space.prescribed] = 0.0
        matrix.mult(x, y)
        assert np.abs(z.array - y.array)[free].max() < 1e-12 * np.abs(y.array).max()
        single = operator.getPythonContext()
        found = np.empty(x.getSize(), dtype=np.float32)
        single.multiply(x.array.astype(np.float32), found)
        assert np.abs(found - y.array)[free].max() < 2e-5 * np.abs(y.array).max()
        inside = np.setdiff1d(np.arange(single.rows), space.prescribed // 3)
        wanted = [matrix.getValues(range(3 * i, 3 * i + 3), range(3 * i, 3 * i + 3)).reshape(-1) for i in inside]
        blocks = single.diagonal()[inside]
        assert np.abs(blocks - wanted).max() < 1e-5 * np.abs(wanted).max()
        for item in (x, y, z):
            item.destroy()


@pytest.mark.parametrize(("degree", "changes"), [(3, {}), (2, LAYERS)])
def test_pressures_take_part_as_in_matrices(degree, changes):
    """Coupling, its transpose and mass, on straight and on curved cells, continuous and by region."""
    spaces = Spaces(make_mesh(**changes))
    space, random = Pressures(spaces.body, spaces.get(degree, Conditions())), np.random.default_rng(5)
    (coupling, mass), wanted = (space.blocks(entries=entries) for entries in (False, True))
    u, p = (random.standard_normal(size) for size in reversed(coupling.getSize()))
    weight = np.linspace(1.0, 2.0, len(p))
    scaled = mass.getPythonContext().weighted(weight).matrix()
    for found, expected in (
        (product_of(coupling.mult, u, p), product_of(wanted[0].mult, u, p)),
        (product_of(coupling.multTranspose, p, u), product_of(wanted[0].multTranspose, p, u)),
        (product_of(scaled.mult, p, p), weight * product_of(wanted[1].mult, p, p)),
        (mass.getDiagonal().array, wanted[1].getDiagonal().array),
    ):
        assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()
    scaled.destroy()
    space.close()
    spaces.close()


def product_of(multiply, x, like):
    """Return the product of a matrix and an array ``x``, in the layout of the array ``like``."""
    given, result = (PETSc.Vec().createWithArray(values, comm=PETSc.COMM_SELF) for values in (x, np.zeros_like(like)))
    multiply(given, result)
    return result.array
