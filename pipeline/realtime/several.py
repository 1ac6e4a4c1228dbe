"""Several tools at once on a flat face, E = 1, with their interaction.

    U(F) = Σ U_i(F_i) + Σ_{i<j} F_i F_j (G + m_i w_i + m_j w_j)(x_i, x_j),    d_i = ∂U/∂F_i,    aside on i: ∂U/∂x_i

Each tool follows its own model (``pipeline.realtime.contact``), at its depth minus the displacement by the others. G is
the displacement of one place by a unit force at another (``pipeline.realtime.pairs``). m is the second moment of a
contact on a half-space, which depends on its force only; M is its tensor, and m w = ½ M:∇∇G its effect on a
half-space's G.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np

from pipeline.realtime.pairs import Influence
from pipeline.realtime.place import Array, Contact, Pair, Place, Tool

# At smaller depths (m) there is no contact.
TOUCHING = 1e-12
# Least distance of two contacts' middles, in units of the sum of their radii.
NEAR = 2.0
# Newton steps; after a relative step below _NEXT, one more reaches rounding.
_STEPS, _NEXT = 40, 1e-8
_NOTHING = Contact(0.0, (0.0, 0.0), 0.0, 0.0, 0.0)


class TooLargeError(Exception):
    """The contact of tool ``number`` is too large for its place."""

    def __init__(self, number: int):
        self.number = number


class Pressing(NamedTuple):
    """A tool with its ``depth`` (m), its place, and its largest contact radius (m)."""

    tool: Tool
    place: Place
    depth: float
    most: float
    room: float

    def press(self, depth: float) -> Contact | None:
        """Return the contact at a depth (m), None if it is too large.

        Raises:
            ArithmeticError: if the depth is not finite.
        """
        if not abs(depth) < inf:
            raise ArithmeticError("a depth is not finite")
        return self.tool.press(depth, self.place, self.most) if depth > TOUCHING else _NOTHING

    def moment(self, force: float) -> tuple[float, float]:
        """Return the mean of r² (m²) under a ``force`` (N/Pa) on a half-space, and its exponent in the force."""
        return self.tool.moment(max(force, 0.0), self.place.plane)


@dataclass(frozen=True, eq=False)
class Settled:
    """All ``contacts`` in equilibrium, their own ``depths`` (n,), in m, and their ``moments`` (n,), in m².

    ``asides`` (n, 2), in N/Pa, are the lateral forces; ``inverse`` (n, n) is ∂F/∂F_alone.
    """

    contacts: list[Contact]
    depths: list[float]
    moments: Array
    asides: list[Pair]
    inverse: Array

    @property
    def forces(self) -> Array:
        """All forces (n,), in N/Pa."""
        return np.array([contact.force for contact in self.contacts])

    @property
    def stiffnesses(self) -> Array:
        """dF/dd (n,), N/m/Pa, of each tool at fixed depths of the others."""
        return np.diag(self.inverse) * [contact.stiffness for contact in self.contacts]


def pressed(tools: Sequence[Pressing], depths: Sequence[float]) -> list[Contact]:
    """Return the contact of each tool by itself.

    Raises:
        TooLargeError: if a contact is too large; ArithmeticError: if a depth is not finite, or a table inconsistent.
    """
    found = []
    for number, (tool, depth) in enumerate(zip(tools, depths, strict=True)):
        contact = tool.press(depth)
        if contact is None:
            raise TooLargeError(number)
        found.append(contact)
    return found


def too_near(contacts: Sequence[Contact], apart: Array) -> list[int]:
    """Return the numbers of contacts that are too close to another one; ``apart`` (n, n) are distances in m."""
    radii = np.array([contact.radius for contact in contacts])
    both = np.logical_and.outer(radii > 0, radii > 0)
    return np.flatnonzero((both & (apart < NEAR * np.add.outer(radii, radii))).any(axis=1)).tolist()


def settle(tools: Sequence[Pressing], alone: Sequence[Contact], between: Influence) -> Settled:
    """Return the equilibrium of all tools by Newton's method, from each contact ``alone``.

    Other tools may move the face away from a tool, which then has no force, or up to one above the face.

    Raises:
        TooLargeError: if a contact is too large; ArithmeticError: if the numbers are inconsistent.
    """
    given, forces = np.array([tool.depth for tool in tools]), np.array([contact.force for contact in alone])
    bent, slope_bent = _bent(tools, between)
    is_last, identity = False, np.eye(len(tools))
    for _ in range(_STEPS):
        means, powers = np.array([tool.moment(force) for tool, force in zip(tools, forces.tolist(), strict=True)]).T
        grown = (1 + powers) * means
        felt = bent @ forces
        depths = (given - between.sinks @ forces - grown * felt - bent.T @ (means * forces)).tolist()
        contacts = pressed(tools, depths)
        stiffness = np.array([contact.stiffness for contact in contacts])
        second = between.sinks + grown[:, None] * bent + (grown[:, None] * bent).T
        second += np.diag(powers * grown * felt / np.where(forces > 0, forces, inf))
        slope = identity + stiffness[:, None] * second
        try:
            if is_last:
                asides = _asides(tools, contacts, means, between, slope_bent)
                return Settled(contacts, depths, means, asides, np.linalg.inv(slope))
            step = np.linalg.solve(slope, forces - [contact.force for contact in contacts])
        except np.linalg.LinAlgError:
            break
        forces = forces - step
        is_last = bool(np.abs(step).max() <= _NEXT * np.abs(forces).max())
    raise ArithmeticError("no equilibrium of the tools found")


def _bent(tools: Sequence[Pressing], between: Influence) -> tuple[Array, Array]:
    """Return w_i (n, n), in 1/m³, of a tool i at the place of j, and its gradient (n, n, 2) with respect to x_i."""
    away, near = between.away / between.apart[..., None], between.near / between.apart**2
    tensors = np.array([tool.tool.tensor for tool in tools])
    along = np.einsum("iab,ijb->ija", tensors, away)
    share = (along * away).sum(axis=-1)
    slope = 3 * along + (1.5 - 7.5 * share)[..., None] * away
    return near * (1.5 * share - 0.5), (near / between.apart)[..., None] * slope


def _asides(
    tools: Sequence[Pressing], contacts: Sequence[Contact], means: Array, between: Influence, slope_bent: Array
) -> list[Pair]:
    """Return the lateral forces; for a bonded disc the others' effect is part of its error bar instead."""
    forces = np.array([contact.force for contact in contacts])
    moments = means * forces
    more = forces[:, None] * np.einsum("j,ija->ia", forces, between.slopes)
    more += moments[:, None] * np.einsum("j,ija->ia", forces, slope_bent)
    more -= forces[:, None] * np.einsum("j,jia->ia", moments, slope_bent)
    more[[tool.tool.sticks for tool in tools]] = 0.0
    return [(x + dx, y + dy) for (x, y), (dx, dy) in zip([each.aside for each in contacts], more.tolist(), strict=True)]
