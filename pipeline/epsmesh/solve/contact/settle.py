"""A body that settles on its beds under loads, before the tool touches it.

Loads grow in proportion. With friction the settled state depends on that path, which is then followed in steps.
"""

from dataclasses import replace
from math import inf

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.balance import check_balance
from epsmesh.solve.contact.contact_steps import ContactPath, ContactPathPoint, Friction, friction_step
from epsmesh.solve.contact.deformed import solve_contact
from epsmesh.solve.contact.placed import placed_tool
from epsmesh.solve.contact.rest import force_left
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution
from epsmesh.solve.hold import check_hold
from epsmesh.solve.newton import EASY, LargeError
from epsmesh.solve.path import follow
from epsmesh.solve.spaces import ElasticSpace
from epsmesh.stages import stage

# Loads below this share of their size, such as the resultant of a pressure within, press no body on: that is rounding.
_PRESSES = 1e-6
# Residual and gaps of a settled body in elements of one degree more.
_ROUGH = 1e-3


@stage("loads")
def settle(
    body: DeformedBody,
    tool: Tool,
    guess: FloatArray | None = None,
    friction: Friction | None = None,
    steps: int = 1,
) -> ContactSolution:
    """Bring a ``body`` with loads to equilibrium on the beds of a ``tool``, which is away; collective.

    ``guess`` is the state found in elements of one degree less: the equilibrium is then as rough as error bars allow.
    With ``friction``, loads alone grow in so many ``steps`` at least, and other terms are there before.

    Raises:
        LargeError: if there is no equilibrium.
        SolveError: if forces do not balance.
    """
    body.state = np.zeros_like(body.state) if guess is None else guess
    hyperelastic, size = body.hyperelastic, body.size_on_terms
    extent = float(np.linalg.norm(np.ptp(body.places, axis=0)))
    moved = size / (min(body.law.lame_mu) * extent)
    pressed = max((float(body.on_terms @ np.array(bed.normal)) for bed in tool.beds), default=0.0)
    rests = any(any(bed.normal) for bed in tool.beds)  # not a region that lies loose somewhere
    if rests and not body.elements.displacements.terms and pressed <= _PRESSES * size:
        does = "lift it off" if pressed < -_PRESSES * size else "do not press it on"
        raise LargeError(f"the body does not settle on its support: the loads {does}, and nothing else holds it")
    placed = placed_tool(body, tool, moved, away=extent)
    limit, path = 0.0 if guess is None else _ROUGH, ContactPath(ContactPathPoint(0.0, body.state))
    scale = size
    if friction is not None:
        friction = replace(friction, advance=np.zeros(body.fixed.shape), deepest=1.0)
        scale /= np.sqrt(np.count_nonzero(placed.start()))  # as large as the norm of the forces of so many nodes

    def solve_at(amount: float) -> tuple[ContactPathPoint, bool]:
        hyperelastic.carry(body.applied, amount, of_terms=None if friction is None else 1.0)
        last = path.last
        body.state = path.continued(amount) if guess is None else guess
        active = placed.complete(placed.start()) if last.touched is None else last.touched.active
        rubs = None if friction is None else friction_step(body, lambda _: placed, last, amount, friction)
        try:
            touched = solve_contact(body, placed, active, rubs, limit=limit, scale=amount * scale)
        except LargeError:
            raise
        except SolveError as error:
            raise LargeError(str(error)) from error
        return ContactPathPoint(amount, body.state, touched), touched.iterations <= EASY

    try:
        follow(path, solve_at, 1.0, fewest=steps)
    except LargeError as error:
        raise LargeError(
            f"the body does not settle on its support: it carries {100 * path.reached:.0f} % of the loads ({error}); "
            "loads must press it on, and its support must hold it; friction holds it along the support"
        ) from error
    finally:
        hyperelastic.carry(body.applied)
    touched = path.last.touched
    assert touched is not None
    body.state = path.last.state
    if limit:
        return touched
    check_balance(float(np.linalg.norm(force_left(body, tool.beds, touched))) / body.size_on_terms)
    return touched


def without_friction(space: ElasticSpace, tool: Tool, *, is_loaded: bool) -> Tool:
    """Return the ``tool`` whose contact without friction is found beside that with: its mesh error is known.

    It slides, and the body on its support, too, unless nothing but friction holds it there: it then sticks.

    Raises:
        SolveError: if nothing but a coefficient of friction holds it, and no load presses it on before the tool comes.
    """
    try:
        check_hold(space, [(np.array(bed.normal), bed.sticks) for bed in tool.beds if not bed.is_tissue])
    except SolveError:
        if not is_loaded and any(bed.drags and bed.friction < inf for bed in tool.beds):
            raise
        return replace(tool, beds=tuple(bed.holding() for bed in tool.beds))
    return tool
