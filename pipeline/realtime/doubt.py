"""Error bars of several tools at once: those of each tool by itself, and those of their interaction."""

from collections.abc import Sequence
from math import hypot, sqrt

import numpy as np

from pipeline.realtime.pairs import Influence, Pairs
from pipeline.realtime.place import Array
from pipeline.realtime.several import Pressing, Settled

# Largest effect of two contacts' fourth moments on a half-space's G, in units of (m_i + m_j)²/D⁴: for round tools,
# and for blades that point at each other. Factor for blades on the second derivatives of R.
_FOURTH, _FOURTH_BLADE, _BLADE = 0.5, 2.0, 2.0


def errors(
    tools: Sequence[Pressing], settled: Settled, own: Sequence[float], pairs: Pairs, between: Influence, of_c: float
) -> Array:
    """Return the relative error bars (n,) of forces; ``own`` are those of each tool's model, ``of_c``/room those of c.

    Errors of depths and of the tools' models propagate between tools in the worst case.
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
    """Return the terms neglected in G (n, n), in 1/m, for the finite size of contacts.

    They are the second moments on R, the error of these moments, and the next order on a half-space.
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
    """Return the errors of depths (n,), in m for E = 1, by the tilt of the face under each tool by the others.

    The complementary energy has -2/3·E* a³ times the squared slope; the model includes only the tool's own slope.
    """
    steep, forces = np.sqrt((between.slopes**2).sum(axis=-1)), settled.forces
    lean, own = steep @ forces, np.array([sqrt(tool.place.tilt) for tool in tools])
    radii = np.array([contact.radius for contact in settled.contacts])
    share = 4 / 3 * tools[0].place.plane * radii**3
    return np.asarray(share * own * lean + steep.T @ (share * (forces * own + lean)))


def _pulled(tools: Sequence[Pressing], settled: Settled, moved: Array) -> tuple[Array, Array]:
    """Return the errors of depths (m) by lateral forces on bonded discs, and the errors of these forces (N/Pa).

    A bonded disc has R. D. Mindlin's lateral stiffness (1949).
    """
    ratio, forces = tools[0].place.poisson, settled.forces
    sticks = np.array([tool.tool.sticks for tool in tools])
    stiff = sticks * [4 * contact.radius / ((1 + ratio) * (2 - ratio)) for contact in settled.contacts]
    aside = stiff * (moved @ forces)
    known = np.array([hypot(*contact.aside) for contact in settled.contacts])
    return moved @ (sticks * (known + aside)), aside
