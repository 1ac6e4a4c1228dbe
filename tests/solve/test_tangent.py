"""The matrix-free tangent is the derivative of the residual, for every law and element."""

import numpy as np
import pytest
from dolfinx import fem

from epsmesh.solve.conditions import Conditions
from epsmesh.solve.elements import elements_of
from epsmesh.solve.laws import LAWS
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import Spaces
from tests.sampling import sampled
from tests.solve.test_mixed import make_mesh

SKIN = {"body": {"layer": [{"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.48}]}}
# Moduli are kept in single precision.
ROUNDING = 1e-6


def material_of(*laws: str) -> MaterialLaw:
    """Return a material for each region, of different moduli."""
    of = [
        MaterialLaw.of_moduli((1 + number) * 10e3, 0.45, law, **dict.fromkeys(LAWS[law].parameters, 0.3))
        for number, law in enumerate(laws)
    ]
    return MaterialLaw(tuple(each.parameters[0] for each in of))


def check(laws: tuple[str, ...], element: str, degree: int = 2, **changes: object) -> None:
    """Compare products with those of compiled forms, at a deformed state."""
    elements, law = elements_of(Spaces(make_mesh(**changes)), degree, Conditions(), element), material_of(*laws)
    forms, random = elements.large_forms(law), np.random.default_rng(7)
    elements.set_law(law)
    elements.displacements.forms.displacement.interpolate(
        lambda x: np.array([4 * x[0] * x[2] + 0.1 * x[1], 3 * x[1] * x[2], 2 * x[0] ** 2 + 0.05 * x[2]])
    )
    directions = [random.standard_normal(len(direction.x.array)) for direction in forms.directions]
    size = len(directions[0])
    if element == "mixed":
        of_pressure = elements.pressures.forms.pressure
        of_pressure.x.array[:] = 0.1 * random.standard_normal(len(of_pressure.x.array))
        directions[1][:] = 0.0  # pressures have a unit of their own
    for function, values in zip(forms.directions, directions, strict=True):
        function.x.array[:] = values
    known = [np.array(fem.assemble_vector(product).array) for product in forms.products]
    tangent = elements.tangent(law)
    tangent.update()
    found = np.split(tangent.whole(directions[0]), [size])
    if element == "mixed":
        known[1] *= elements.pressures.unit
    for one, other in zip(found, known, strict=False):
        assert np.abs(one - other).max() < ROUNDING * np.abs(other).max()
    tangent.close()
    elements.close()


@sampled("law", LAWS, by_day=2)
@pytest.mark.parametrize("element", ["displacement", "mixed"])
def test_products_of_every_law(law, element):
    check((law,), element)


def test_products_of_regions_with_laws_of_their_own():
    check(("neo-hookean", "linear"), "displacement", **SKIN)
    check(("linear", "neo-hookean"), "mixed", **SKIN)


@pytest.mark.parametrize("degree", [1, 3])
def test_products_of_other_degrees(degree):
    check(("neo-hookean",), "displacement", degree)


def test_it_is_symmetric():
    """The coupling and its transpose are those of one saddle point."""
    elements, law = elements_of(Spaces(make_mesh()), 2, Conditions(), "mixed"), material_of("neo-hookean")
    elements.displacements.forms.displacement.interpolate(lambda x: 0.1 * x[[1, 2, 0]])
    tangent = elements.tangent(law)
    tangent.update()
    x, y = tangent.matrix.createVecs()
    for vector in (x, y):
        vector.array[:] = np.random.default_rng(len(vector.array)).standard_normal(vector.getLocalSize())
        vector.array[elements.displacements.prescribed_owned] = 0.0
    y.array[:] = y.array[::-1]
    y.array[elements.displacements.prescribed_owned] = 0.0
    one, other = tangent.matrix * x, tangent.matrix * y
    assert y.dot(one) == pytest.approx(x.dot(other), rel=1e-6)
    tangent.close()
    elements.close()
