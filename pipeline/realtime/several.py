"""Several tools at once on a flat face, E = 1: forces that know of each other.

    U(F) = Σ U_i(F_i) + Σ_{i<j} F_i F_j (G + m_i w_i + m_j w_j)(x_i, x_j),    d_i = ∂U/∂F_i,    aside on i: ∂U/∂x_i

Each tool feels its own model (``pipeline.realtime.contact``) at the depth that the others leave it. G is what a force
at one place sinks another (``pipeline.realtime.pairs``); m is the second moment of a contact on a half-space, which
depends on its force alone, and m w = ½ M:∇∇G what that makes of a half-space's G, M the tensor of the moment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np

from pipeline.realtime.pairs import Influence
from pipeline.realtime.place import Array, Contact, Pair, Place, Tool

# A depth (m) below which nothing touches.
TOUCHING = 1e-12
# How far apart the middles of two contacts are at least, in units of both radii.
NEAR = 2.0
# Steps of Newton's method; one of so little, relative to the largest force, leaves its square.
_STEPS, _NEXT = 40, 1e-8
_NOTHING = Contact(0.0, (0.0, 0.0), 0.0, 0.0, 0.0)


class TooLargeError(Exception):
    """The contact of a tool is too large for its place: which one, by its ``number``."""

    def __init__(self, number: int):
        self.number = number


class Pressing(NamedTuple):
    """A tool with the ``depth`` (m) that it has by itself, its place, and the largest radius (m) of its contact."""

    tool: Tool
    place: Place
    depth: float
    most: float
    room: float

    def press(self, depth: float) -> Contact | None:
        """Return the contact at a depth (m), or nothing if it is too large.

        Raises:
            ArithmeticError: if the depth is no number.
        """
        if not abs(depth) < inf:
            raise ArithmeticError("a depth is not finite")
        return self.tool.press(depth, self.place, self.most) if depth > TOUCHING else _NOTHING

    def moment(self, force: float) -> tuple[float, float]:
        """Return the mean of r² (m²) under a ``force`` (N/Pa) on a half-space, and which power of the force it is."""
        return self.tool.moment(max(force, 0.0), self.place.plane)


@dataclass(frozen=True, eq=False)
class Settled:
    """All ``contacts`` at the ``depths`` (n,), in m, that are left to each, and their ``moments`` (n,), in m².

    ``asides`` (n, 2), in N/Pa, are the forces aside; ``inverse`` (n, n) is ∂F/∂F of what each would have alone.
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
        """dF/dd (n,), N/m/Pa, of each tool while the others are held at their depths."""
        return np.diag(self.inverse) * [contact.stiffness for contact in self.contacts]


def pressed(tools: Sequence[Pressing], depths: Sequence[float]) -> list[Contact]:
    """Return what each tool feels by itself.

    Raises:
        TooLargeError: if a contact is; ArithmeticError: if a depth is no number, or a table not that of a body.
    """
    found = []
    for number, (tool, depth) in enumerate(zip(tools, depths, strict=True)):
        contact = tool.press(depth)
        if contact is None:
            raise TooLargeError(number)
        found.append(contact)
    return found


def too_near(contacts: Sequence[Contact], apart: Array) -> list[int]:
    """Return the numbers of contacts that are nearer to another one, ``apart`` (n, n) in m, than a model is for."""
    radii = np.array([contact.radius for contact in contacts])
    both = np.logical_and.outer(radii > 0, radii > 0)
    return np.flatnonzero((both & (apart < NEAR * np.add.outer(radii, radii))).any(axis=1)).tolist()


def settle(tools: Sequence[Pressing], alone: Sequence[Contact], between: Influence) -> Settled:
    """Return what tools feel together, from what each feels ``alone``: Newton's method.

    A tool that the others take the face from has no force; one that they lift the face to has one.

    Raises:
        TooLargeError: if a contact is; ArithmeticError: if the numbers are not those of a body.
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
    raise ArithmeticError("the tools come to no rest")


def _bent(tools: Sequence[Pressing], between: Influence) -> tuple[Array, Array]:
    """Return w_i (n, n), in 1/m³, of a tool i at the place of j, and its slope (n, n, 2) with x_i."""
    away, near = between.away / between.apart[..., None], between.near / between.apart**2
    tensors = np.array([tool.tool.tensor for tool in tools])
    along = np.einsum("iab,ijb->ija", tensors, away)
    share = (along * away).sum(axis=-1)
    slope = 3 * along + (1.5 - 7.5 * share)[..., None] * away
    return near * (1.5 * share - 0.5), (near / between.apart)[..., None] * slope


def _asides(
    tools: Sequence[Pressing], contacts: Sequence[Contact], means: Array, between: Influence, slope_bent: Array
) -> list[Pair]:
    """Return the forces aside; what the others add to that on a disc that sticks is in its bar."""
    forces = np.array([contact.force for contact in contacts])
    moments = means * forces
    more = forces[:, None] * np.einsum("j,ija->ia", forces, between.slopes)
    more += moments[:, None] * np.einsum("j,ija->ia", forces, slope_bent)
    more -= forces[:, None] * np.einsum("j,jia->ia", moments, slope_bent)
    more[[tool.tool.sticks for tool in tools]] = 0.0
    return [(x + dx, y + dy) for (x, y), (dx, dy) in zip([each.aside for each in contacts], more.tolist(), strict=True)]
