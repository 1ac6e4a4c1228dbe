"""What of the force depends on where: its derivatives by the moduli at a place.

In equilibrium the potential energy Π is stationary, and F = dΠ/dd. With ψ the stored energy per volume, which is
proportional to Young's modulus E, ∂F/∂E(x) is the change of ψ/E at x with the depth: P : ∇(du/dd) / E. What the contact
area gains or loses does no work, so the change of u is that with the nodes in contact as they are. For linear tissue
and a known footprint du/dd = u/d: ∂F/∂E(x) is the strain energy there, F d = 2U. In elements, all of it holds to
rounding for their own F, which is Π's derivative, too. The derivative by Poisson's ratio is of the same form, since ψ
is linear in λ and μ.

The influence (1/m³) is ∂ln F/∂ln E per volume. Its integral over the body is 1, or less where terms besides the law's
decide the rest. Near a singular edge it grows without limit as elements shrink: it is given by its mean over each cell.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from dolfinx import fem

from epsmesh.arrays import FloatArray
from epsmesh.shapes.tissue import lame
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.elements.base import Elements, Rate
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.physics import MaterialLaw, SplitLaw
from epsmesh.solve.points.state import Influence

# Steps of Poisson's ratio, downwards, for the derivatives of the moduli.
_STEP = 1e-6


def cell_influence(
    elements: Elements,
    law: MaterialLaw,
    columns: Sequence[Column],
    rate: Rate,
    force: float | None = None,
) -> Influence:
    """Return the influence on the owned cells; collective.

    ``force`` (N) is that on the whole body, by default that of the fields.

    Raises:
        SolveError: if the rate is not found.
    """
    forms, body = elements.large_forms(law), elements.body
    rate.show()
    forms.set_directions()
    elements.show(columns, rate.amounts)
    elements.set_law(law)
    owned, works = body.owned_cells, list[FloatArray]()
    # E ∂ψ/∂E, and ∂ψ/∂ν: the compliance is proportional to 1/E. Fibres are stiff in proportion to E, whatever ν is.
    for (lame_lambda, lame_mu, compliance), fibres in (
        (_moduli(elements, law), {}),
        (_by_poisson(elements, law) * [[1.0], [1.0], [-1.0]], {"k1": 0.0}),
    ):
        forms.set_moduli(lame_lambda, lame_mu, elements.unit(law) ** 2 * compliance, **fibres)
        works.append(np.asarray(fem.assemble_vector(forms.work_rates).array)[:owned].copy())
    elements.set_law(law)
    volumes = np.asarray(fem.assemble_vector(forms.volumes).array)[:owned]
    if force is None:
        force = 2.0 ** len(body.mirrored) * float(global_sum(body.comm, np.array([works[0].sum()]))[0])
    return Influence(*(np.asarray(work / (volumes * force)) for work in works))


def _moduli(elements: Elements, law: MaterialLaw) -> FloatArray:
    """Return λ and μ of the displacement (Pa), and 1/λ₁ of the pressure (1/Pa), by region."""
    elastic, unit = elements.elastic(law), elements.unit(law)
    compliance = SplitLaw.of(law).compliance if elements.element == "mixed" else (0.0,) * len(law.parameters)
    return np.array([elastic.lame_lambda, elastic.lame_mu, compliance]) * [[unit], [unit], [1 / unit]]


def _by_poisson(elements: Elements, law: MaterialLaw) -> FloatArray:
    """Return the derivatives of the moduli by Poisson's ratio, at constant E, by region."""

    def below(steps: int) -> FloatArray:
        parameters = []
        for each in law.parameters:
            moduli = lame(2 * each.lame_mu * (1 + each.poisson), each.poisson - steps * _STEP)
            parameters.append(replace(each, lame_lambda=moduli[0], lame_mu=moduli[1], given_poisson=None))
        return _moduli(elements, MaterialLaw(tuple(parameters), law.unit))

    return (3 * below(0) - 4 * below(1) + below(2)) / (2 * _STEP)
