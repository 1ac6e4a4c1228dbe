"""Hierarchical estimate at large displacements: residuals in one degree more, and what they tell of a force.

With the residual r of the solution u in degree p + 1, and r' that of v = ∂u/∂d under the tangent K,

    F_p - F_{p+1} = r'·K⁻¹ r,    of second order in the change that degree p + 1 makes.

(r'·K⁻¹ r' · r·K⁻¹ r)^½ is an upper bound of it that cannot vanish by chance, and is used instead. K is replaced by the
operator of linear elasticity. At moderate depths this agrees within a few per cent; at larger ones the tangent of one
degree more is not positive definite at the probe's edge. In mixed elements, r'·K⁻¹ r itself is used, which may have
either sign, and N as in linear elasticity: the root of the squared energy norms that the preconditioner sees.

Under dead loads the force vanishes at the start of the path, in every degree. With r₀ and r₀' there,

    F_p - F_{p+1} = r'·K⁻¹ r - r₀'·K⁻¹ r₀ = r'·K⁻¹ (r - r₀) + (r' - r₀')·K⁻¹ r₀.
"""

from collections.abc import Sequence
from contextlib import ExitStack

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve.compiled import assemble
from epsmesh.solve.elements.base import Elements, Fields, Linearised
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.held_body import equilibrate
from epsmesh.solve.hyperelastic import HyperelasticBody, Preconditioner
from epsmesh.solve.movement import Loads
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.terms import DeadLoads, Term, product

# Residual of the solution in one degree more, relative to the forces at prescribed dofs.
_AGAIN = 1e-3


class FinerResiduals:
    """Residuals of states of a ``body`` of ``elements``, in elements of one degree more; freed with the stack.

    Methods are collective; they are zero at prescribed dofs.
    """

    def __init__(
        self,
        elements: Elements,
        body: HyperelasticBody,
        finer: Elements,
        law: MaterialLaw,
        loads: Loads | None,
        stack: ExitStack,
    ):
        """Set up in the elements ``finer``."""
        self._elements, self._body, self._stack, self._finer = elements, body, stack, finer
        self._forms = finer.large_forms(law)
        finer.set_law(law)
        space, self._unit = finer.displacements, finer.unit(law)
        loaded = [] if loads is None else [DeadLoads(space.applied(loads).forces, space.forms.displacement)]
        self._terms: list[Term] = [*space.terms, *loaded]

    def at(self, state: PETSc.Vec) -> Fields:
        """Return the residual r of a state.

        Raises:
            LargeError: if elements of that degree turn tissue inside out.
        """
        self._show(state)
        return self._assembled(self._forms.residuals, [term.forces() for term in self._terms])

    def of_rate(self, state: PETSc.Vec, rate: PETSc.Vec) -> Fields:
        """Return r', the change of the residual of a state with its ``rate``."""
        self._show(rate)
        self._forms.set_directions()
        self._show(state)
        direction = self._forms.directions[0].x.array[: self._finer.displacements.owned]
        return self._assembled(self._forms.products, [product(term, direction) for term in self._terms])

    def _show(self, state: PETSc.Vec) -> None:
        self._body.show(state)
        self._finer.interpolate(self._elements)

    def _assembled(self, of_forms: Sequence[object], of_terms: Sequence[FloatArray]) -> Fields:
        finer = self._finer
        found = self._stack.enter_context(finer.fields())
        for each, part in zip(of_forms, found, strict=True):
            assemble(each, part)
        for forces in of_terms:
            found[0].array[:] += forces / self._unit
        finer.weigh(found)
        for part in found:
            part.scale(-1.0)
        found[0].array[finer.displacements.prescribed_owned] = 0.0
        if not all(np.isfinite(part.norm()) for part in found):
            raise LargeError("no error bar: elements of one degree more turn tissue inside out")
        return found


def combine(own: float, fields: Fields, share: float, other: Fields) -> Fields:
    """Return own·fields + share·other, which overwrites ``fields``."""
    for part, added in zip(fields, other, strict=True):
        part.axpby(share, own, added)
    return fields


def force_again(
    elements: Elements,
    body: HyperelasticBody,
    state: PETSc.Vec,
    finer: Elements,
    law: MaterialLaw,
    column: Column,
    preconditioner: Preconditioner,
) -> float:
    """Return the force (N) on the modelled part in the elements ``finer``, by Newton's method from a ``state``.

    The ``column`` has the prescribed displacement of these elements per unit of the motion. Collective.

    Raises:
        LargeError: if it does not converge.
    """
    with ExitStack() as stack:
        above = HyperelasticBody(finer, law, preconditioner)
        stack.callback(above.close)
        found, unit, forces = (stack.enter_context(above.state()) for _ in range(3))
        body.show(state)
        finer.interpolate(elements)
        finer.set_law(law)
        found.array[:] = finer.values
        equilibrate(above, found, above.held_of(found), _AGAIN)
        above.forces(found, forces)
        owned = finer.displacements.owned
        unit.array[:owned] = column.prescribed[:owned]
        return float(forces.dot(unit))


class Decrements:
    """The products r_i·K⁻¹·r_j (J) of residuals by a ``linearised`` problem; collective."""

    def __init__(self, linearised: Linearised, residuals: Sequence[Fields]):
        """Solve for all ``residuals``."""
        self.products, self._unseen = linearised.decrements(residuals)

    def between(self, rate: int, change: int) -> tuple[float, float]:
        """Return the decrement (J) that two residuals give, an upper bound if elements have one, and their N (J)."""
        of_both = [rate, change]
        if self._unseen is None:
            return float(np.sqrt(self.products[of_both, of_both].prod())), 0.0
        return float(self.products[rate, change]), float(np.sqrt(self._unseen[of_both].prod()))

    @property
    def is_bound(self) -> bool:
        """Whether decrements are upper bounds, and there is no N."""
        return self._unseen is None
