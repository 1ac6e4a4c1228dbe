"""What of the force depends on where: its derivative by the modulus at a place.

In equilibrium the potential energy Π is stationary, and F = dΠ/dd. With ψ the stored energy per volume, which is
proportional to Young's modulus E, ∂F/∂E(x) is the change of ψ/E at x with the depth: P : ∇(du/dd) / E. What the contact
area gains or loses does no work, so the change of u is that with the nodes in contact as they are. For linear tissue
and a known footprint du/dd = u/d: ∂F/∂E(x) is the strain energy there, F d = 2U. In elements, all of it holds to
rounding for their own F, which is Π's derivative, too.

The influence (1/m³) is ∂ln F/∂ln E per volume. Its integral over the body is 1, or less where terms besides the law's
decide the rest. Near a singular edge it grows without limit as elements shrink: it is given by its mean over each cell.
"""

from collections.abc import Callable, Sequence

import numpy as np
from dolfinx import fem

from epsmesh.arrays import FloatArray
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.physics import MaterialLaw


def influence_of(
    elements: Elements,
    law: MaterialLaw,
    columns: Sequence[Column],
    amounts: Sequence[float],
    show_rate: Callable[[], None],
    force: float | None = None,
) -> FloatArray:
    """Return the influence (1/m³) on the owned cells; collective.

    ``show_rate`` copies the change of the solution per metre of the tool's advance to the forms' fields. ``force`` (N)
    is that on the whole body, by default that of these fields.
    """
    forms, body = elements.large_forms(law), elements.body
    show_rate()
    forms.set_directions()
    elements.show(columns, list(amounts))
    elements.set_law(law)
    owned = body.owned_cells
    works = elements.unit(law) * np.asarray(fem.assemble_vector(forms.work_rates).array)[:owned]
    volumes = np.asarray(fem.assemble_vector(forms.volumes).array)[:owned]
    if force is None:
        force = 2.0 ** len(body.mirrored) * float(global_sum(body.comm, np.array([works.sum()]))[0])
    return np.asarray(works / (volumes * force))
