"""Stages of an insertion: of a blade, the intact body and slits in which it is, at the depths of its steps.

They are cases like any other, without friction: a blade's toughness and friction follow from them without a solve. Of a
needle, each stage is the same state: deep in the tissue that it cuts.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar, cast

from pipeline.shapes.body import Body
from pipeline.shapes.indenter import Indenter
from pipeline.shapes.probe import Probe
from pipeline.shapes.section import Section
from pipeline.study.axis import Axis
from pipeline.units import canonical

if TYPE_CHECKING:
    from pipeline.shapes.probes._round import RoundIndenter
    from pipeline.shapes.probes.blade import Blade

# The front is solved this share of the distance to an interface ahead of it.
SHORT = 0.75
# A depth without effect, in widths of the blade: the force of a blade that slides in a slit does not depend on it.
_ANY = 0.01

Tool = TypeVar("Tool", bound=Probe)
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
    tools = cast("tuple[Blade | RoundIndenter, ...]", sections["probe"])
    ends = interfaces(cast("tuple[Body, ...]", sections["body"]))
    depths = step_depths(tools, ends)
    staged = [stage for tool in tools for stage in _stages(tool, depths, ends)]
    axis = Axis("probe", "stage", (0.0, *depths), "m", piece="insertion", is_stage=True)
    solve = tuple(one.model_copy(update={"exact": False}) for one in sections["solve"])
    return sections | {"probe": tuple(staged), "tool": tools, "solve": solve}, (*axes, axis)


def _stages(tool: "Blade | RoundIndenter", depths: Sequence[float], ends: Sequence[float]) -> "list[Probe]":
    """Return the first state of a tool, and those at its depths (m).

    Of a needle there is one state besides the intact body, deep in the tissue that it cuts. Depths at which the intact
    body is solved are found on the way.
    """
    if isinstance(tool, Indenter):
        return [cutting(tool)] * (1 + len(depths))
    return [intact(tool), *(in_slit(tool, depth, first_ahead(tool, depth, ends)) for depth in depths)]


def cutting(needle: "RoundIndenter") -> "RoundIndenter":
    """Return the needle deep in tissue that it cuts, over a depth of one radius."""
    return _with(needle, friction=1.0, insertion=None, depth=needle.limit)


def pressed(needle: "RoundIndenter", depth: float) -> "RoundIndenter":
    """Return the needle at a depth (m) on the intact body."""
    return _with(needle, friction=0.0, insertion=None, toughness=None, depth=canonical(depth))


def interfaces(bodies: Sequence[Body]) -> tuple[float, ...]:
    """Return the depths (m) of the interfaces of all bodies, from the surface down."""
    return tuple(sorted({canonical(body.heights[1] - end) for body in bodies for end in body.interfaces}))


def step_depths(tools: "Sequence[Blade | RoundIndenter]", ends: Sequence[float]) -> tuple[float, ...]:
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


def first_ahead(blade: "Blade", depth: float, ends: Sequence[float]) -> float:
    """Return the distance (m) of the front of the slit that is solved first, for a tip at a depth (m)."""
    found = min(blade.width, 2 * depth)
    for end in ends:
        if depth < end < depth + found / SHORT:
            found = SHORT * (end - depth)
    return canonical(found)


def intact(blade: "Blade") -> "Blade":
    """Return the blade at its last depth on the intact body."""
    return _without_friction(blade)


def in_slit(blade: "Blade", depth: float, ahead: float) -> "Blade":
    """Return the blade with its tip at a depth (m) in a slit, whose front is ``ahead`` (m) of it."""
    return _without_friction(blade, incision=canonical(depth + ahead), ahead=ahead, depth=canonical(_ANY * blade.width))


def _without_friction(blade: "Blade", **changes: float) -> "Blade":
    """Return a blade that slides without friction, and has other values."""
    return _with(blade, contact="frictionless", friction=0.0, toughness=None, insertion=None, **changes)


def _with(tool: Tool, **changes: Any) -> Tool:
    """Return a tool with other values; a copy would keep what is cached."""
    own: dict[str, Any] = {name: getattr(tool, name) for name in type(tool).model_fields}
    return cast("Tool", type(tool).model_construct(tool.model_fields_set | changes.keys(), **(own | changes)))
