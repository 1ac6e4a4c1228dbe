"""The bars of several tools at once: what each has by itself, and what is not known of what they do to each other."""

from collections.abc import Sequence
from math import hypot, sqrt

import numpy as np

from pipeline.realtime.pairs import Influence, Pairs
from pipeline.realtime.place import Array
from pipeline.realtime.several import Pressing, Settled

# Of a half-space's G, what fourth moments of two contacts make of it at most, in units of (m_i + m_j)²/D⁴: of round
# tools, and of blades that point at each other. Blades bend R by so much more than round tools.
_FOURTH, _FOURTH_BLADE, _BLADE = 0.5, 2.0, 2.0


def errors(
    tools: Sequence[Pressing], settled: Settled, own: Sequence[float], pairs: Pairs, between: Influence, of_c: float
) -> Array:
    """Return the relative bars (n,) of forces whose own models tell them to ``own``; c may be off by ``of_c``/room.

    Errors of depths and of the own models go on from tool to tool as they do at worst.
    """
    forces = settled.forces
    rooms = np.sqrt([tool.room for tool in tools])
    doubt = (pairs.error + of_c) / np.multiply.outer(rooms, rooms) + _spread(tools, settled, between)
    np.fill_diagonal(doubt, 0.0)
    pulled, aside = _pulled(tools, settled, pairs.aside / between.apart)
    off = doubt @ forces + _tilted(tools, settled, between) + pulled
    stiffness = np.array([contact.stiffness for contact in settled.contacts])
    missed = np.abs(settled.inverse) @ (np.array(own) * forces + stiffness * off) + aside
    touching = forces > 0
    return np.where(touching, missed / np.where(touching, forces, 1.0), 0.0)


def _spread(tools: Sequence[Pressing], settled: Settled, between: Influence) -> Array:
    """Return what is left out of G (n, n), in 1/m, since contacts have a size.

    That is what second moments make of R, what is not known of them, and the next term of a half-space's.
    """
    means = np.array([contact.mean_square for contact in settled.contacts])
    is_blade = np.array([not tool.tool.is_round for tool in tools])
    other = np.abs(means - np.where(means > 0, settled.moments, 0.0))
    bend = between.near / between.apart**2
    single = np.where(is_blade, _BLADE, 1.0)[:, None] / 4 * (means[:, None] * between.bends + other[:, None] * bend)
    both = np.add.outer(means, means) / between.apart**2
    share = np.where(np.logical_or.outer(is_blade, is_blade), _FOURTH_BLADE, _FOURTH)
    return np.asarray(single + single.T + share * both**2 * between.near)


def _tilted(tools: Sequence[Pressing], settled: Settled, between: Influence) -> Array:
    """Return how far depths (n,), in m for E = 1, are off as the face under each tool leans by the others.

    The complementary energy has -2/3·E* a³ of the whole slope's square, of which the tool's own is known.
    """
    steep, forces = np.sqrt((between.slopes**2).sum(axis=-1)), settled.forces
    lean, own = steep @ forces, np.array([sqrt(tool.place.tilt) for tool in tools])
    radii = np.array([contact.radius for contact in settled.contacts])
    share = 4 / 3 * tools[0].place.plane * radii**3
    return np.asarray(share * own * lean + steep.T @ (share * (forces * own + lean)))


def _pulled(tools: Sequence[Pressing], settled: Settled, moved: Array) -> tuple[Array, Array]:
    """Return how far depths are off (m) by forces aside on discs that stick, and by how much (N/Pa) these are.

    A disc that sticks has R. D. Mindlin's stiffness aside (1949).
    """
    ratio, forces = tools[0].place.poisson, settled.forces
    sticks = np.array([tool.tool.sticks for tool in tools])
    stiff = sticks * [4 * contact.radius / ((1 + ratio) * (2 - ratio)) for contact in settled.contacts]
    aside = stiff * (moved @ forces)
    known = np.array([hypot(*contact.aside) for contact in settled.contacts])
    return moved @ (sticks * (known + aside)), aside
