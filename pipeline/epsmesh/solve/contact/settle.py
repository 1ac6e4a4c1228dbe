"""A body that settles on its beds under loads, before the tool touches it. Where beds rub, tissue then sticks."""

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.balance import check_balance
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.contact.deformed import solve_contact
from epsmesh.solve.contact.placed import placed_tool
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution
from epsmesh.solve.newton import EASY, LargeError
from epsmesh.solve.path import Path, PathPoint, follow
from epsmesh.solve.response import whole_force
from epsmesh.stages import stage

# Loads below this share of their size, such as the resultant of a pressure within, press no body on: that is rounding.
_PRESSES = 1e-6
# Residual and gaps of a settled body in elements of one degree more.
_ROUGH = 1e-3


@stage("loads")
def settle(body: DeformedBody, tool: Tool, guess: FloatArray | None = None) -> ContactSolution:
    """Bring a ``body`` with loads to equilibrium on the beds of a ``tool``, which is away; collective.

    ``guess`` is the state found in elements of one degree less: the equilibrium is then as rough as error bars allow.

    Raises:
        LargeError: if there is no equilibrium.
        SolveError: if forces do not balance.
    """
    body.state = np.zeros_like(body.state) if guess is None else guess
    hyperelastic, size = body.hyperelastic, body.size_on_terms
    extent = float(np.linalg.norm(np.ptp(body.places, axis=0)))
    moved = size / (min(body.law.lame_mu) * extent)
    pressed = max((float(body.on_terms @ np.array(bed.normal)) for bed in tool.beds), default=0.0)
    if not body.elements.displacements.terms and pressed <= _PRESSES * size:
        does = "lift it off" if pressed < -_PRESSES * size else "do not press it on"
        raise LargeError(f"the body does not settle on its support: the loads {does}, and nothing else holds it")
    placed = placed_tool(body, tool, moved, away=extent)
    touched, limit = list[ContactSolution](), 0.0 if guess is None else _ROUGH
    path = Path(PathPoint(0.0, body.state))

    def solve_at(amount: float) -> tuple[PathPoint, bool]:
        hyperelastic.carry(body.applied, amount)
        body.state = path.continued(amount) if guess is None else guess
        active = touched[-1].active if touched else placed.complete(placed.start())
        try:
            touched.append(solve_contact(body, placed, active, limit=limit, scale=amount * size))
        except LargeError:
            raise
        except SolveError as error:
            raise LargeError(str(error)) from error
        return PathPoint(amount, body.state), touched[-1].iterations <= EASY

    try:
        follow(path, solve_at, 1.0)
    except LargeError as error:
        raise LargeError(
            f"the body does not settle on its support: it carries {100 * path.reached:.0f} % of the loads ({error}); "
            "loads must press it on, and its support must hold it; friction holds it along the support"
        ) from error
    finally:
        hyperelastic.carry(body.applied)
    body.state = path.last.state
    if limit:
        return touched[-1]
    space, forces = body.elements.displacements, touched[-1].forces.copy()
    for number, bed in enumerate(tool.beds, start=1):
        if bed.is_tissue:  # of the body itself
            forces[body.part(number).nodes] = 0.0
    fixed = global_sum(space.comm, body.residual().reshape(-1, 3)[space.fixed_owned].sum(axis=0))
    left = whole_force(forces.sum(axis=0) + fixed - body.on_terms, body.elements.body.mirrored)
    check_balance(float(np.linalg.norm(left)) / (2.0 ** len(body.elements.body.mirrored) * body.size_on_terms))
    return touched[-1]
