"""Stages of an insertion: the first state of its tool, and those at the depths of its steps."""

from collections.abc import Sequence
from typing import cast

from epsmesh.shapes.body import Body
from epsmesh.shapes.insertion import Inserted
from epsmesh.shapes.section import Section
from epsmesh.study.axis import Axis
from epsmesh.units import canonical

Sections = dict[str, tuple[Section, ...]]


def has_insertion(probes: Sequence[Section]) -> bool:
    """Return whether tools are inserted: all of them, or none."""
    return any(getattr(probe, "insertion", None) is not None for probe in probes)


def with_steps(sections: Sections, axes: tuple[Axis, ...]) -> tuple[Sections, tuple[Axis, ...]]:
    """Return sections and axes in which each tool has the stages of its insertion; ``tool`` keeps it as it is given.

    There is no F_exact of a path. All tools have the same depths, so that one dimension holds them.
    """
    if not has_insertion(sections["probe"]):
        return sections, axes
    tools = cast("tuple[Inserted, ...]", sections["probe"])
    ends = interfaces(cast("tuple[Body, ...]", sections["body"]))
    depths = step_depths(tools, ends)
    staged = [stage for tool in tools for stage in tool.stages(depths, ends)]
    axis = Axis("probe", "step", (0.0, *depths), "m", piece="insertion", is_stage=True)
    solve = tuple(one.model_copy(update={"exact": False}) for one in sections["solve"])
    return sections | {"probe": tuple(staged), "tool": tools, "solve": solve}, (*axes, axis)


def interfaces(bodies: Sequence[Body]) -> tuple[float, ...]:
    """Return the depths (m) of the interfaces of all bodies, from the surface down."""
    return tuple(sorted({canonical(body.heights[1] - end) for body in bodies for end in body.interfaces}))


def punctures(tools: Sequence[Inserted], bodies: Sequence[Body]) -> int:
    """Return the number of layers, from the surface down, that end with the last one that a tool may pierce."""
    return max(number for tool in tools for body in bodies for number in pierced(tool, body))


def pierced(tool: Inserted, body: Body) -> list[int]:
    """Return the numbers of the layers that a tool may indent before it cuts: the first, and each that is tougher.

    Tougher than the layer above, and within reach. A needle may indent any layer, since a stiffer one takes more, too.
    """
    assert tool.insertion is not None
    own = [getattr(layer, "toughness", None) or tool.toughness for layer in getattr(body, "layer", ())]
    tough = [one or 0.0 for one in (*own, tool.toughness)]
    reach = [end for end in interfaces([body]) if end < tool.insertion.to]
    layers, every = range(2, len(reach) + 2), tool.CUTS == "crack"
    return [1, *(number for number in layers if every or tough[number - 1] > tough[number - 2])]


def step_depths(tools: Sequence[Inserted], ends: Sequence[float]) -> tuple[float, ...]:
    """Return the depths (m) of the steps: equal ones, but half a width or more away from the interfaces at ``ends``."""
    insertion, room = tools[0].insertion, max(tool.insertion_clearance for tool in tools)
    assert insertion is not None
    found = (clear(insertion.to * number / insertion.steps, ends, room) for number in range(1, insertion.steps + 1))
    return tuple(sorted({depth for depth in found if depth == clear(depth, ends, room)}))


def clear(depth: float, ends: Sequence[float], room: float) -> float:
    """Return the depth (m) nearest to ``depth`` that is ``room`` (m) or more away from the first interface near it."""
    for end in ends:
        if abs(canonical(depth - end)) < canonical(room):
            return canonical(end + (room if depth >= end else -room))
    return canonical(depth)
