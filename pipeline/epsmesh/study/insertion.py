"""Whether a tool can be inserted as a study says: sound keys, room above the support, layers thicker than a step."""

from collections.abc import Sequence
from math import isfinite

from epsmesh.shapes.body import Body, Layered
from epsmesh.shapes.insertion import Inserted, Insertion
from epsmesh.shapes.probe import STICK, Probe
from epsmesh.shapes.section import in_mm
from epsmesh.study.problems import Problems

# Largest coefficient of friction, whose reaction on the pressure is still a correction.
_MOST_FRICTION = 1.0


def check_insertion(body: Body, probe: Probe, problems: Problems) -> None:
    """Report an insertion for which keys are missing, or for which the body has no room."""
    if not isinstance(probe, Inserted):
        return
    tool, before, insertion = probe, len(problems.errors), probe.insertion
    if insertion is None:
        if tool.toughness is not None:
            problems.error("probe.toughness", f"{tool.toughness:g} J/m^2", "is for an insertion: add [probe.insertion]")
        elif "crack_shape" in tool.model_fields_set:
            problems.error(
                "probe.crack_shape", getattr(tool, "crack_shape", None), "is for an insertion: add [probe.insertion]"
            )
        return
    _check_keys(tool, problems)
    if len(problems.errors) == before and isinstance(body, Layered):
        _check_end(body, tool, insertion, problems)
        _check_layers(body, tool, insertion, problems)


def check_same_path(probes: Sequence[Probe], problems: Problems) -> None:
    """Report tools that are not all inserted, or not to the same depths: one dimension has them."""
    insertions = {getattr(probe, "insertion", None) for probe in probes}
    if len(insertions) > 1:
        problems.error(
            "probe.insertion",
            None,
            "must be one for all tools, since its depths are one dimension of the dataset: no lists in "
            "[probe.insertion], and the same table in every [[probe]]",
        )


def _check_keys(probe: Inserted, problems: Problems) -> None:
    if probe.toughness is None:
        problems.error("probe.toughness", None, 'is required for an insertion, such as toughness = "200 J/m^2"')
    if not probe.is_unilateral:
        problems.error(
            "probe.contact", probe.contact, 'tissue slides along a tool that is inserted: use contact = "unilateral"'
        )
    if not isfinite(probe.friction):
        problems.error("probe.friction", STICK, "a tool that is inserted slides: give a coefficient, such as 0.2")
    elif probe.friction > _MOST_FRICTION:
        problems.error(
            "probe.friction",
            probe.friction,
            f"must be at most {_MOST_FRICTION:g} for a tool that is inserted: beyond, its drag more than doubles the "
            "pressure on its own flanks",
        )


def _check_end(body: Layered, probe: Inserted, insertion: Insertion, problems: Problems) -> None:
    """Report a path through the bottom or the support, and one whose slit leaves the top."""
    low, top = body.heights
    end = min(top - low, *(top - level for level in body.hold.edges()), top - low)
    room, words = probe.insertion_room
    if insertion.to + room > end:
        problems.error(
            "probe.insertion.to",
            in_mm(insertion.to),
            f"leaves less than {in_mm(room)}, {words}, above the bottom or the support: must be at "
            f"most {in_mm(max(end - room, 0.0))}",
        )
    if probe.gap(body, probe.frame_on(body)) < room:
        key, smaller = ("length", "shorter blade") if probe.CUTS == "slit" else ("radius", "thinner needle")
        problems.error(
            f"probe.{key}",
            in_mm(getattr(probe, key)),
            f"leaves less than {in_mm(room)}, {words}, beside the path: use a {smaller}, or a larger body",
        )


def _check_layers(body: Layered, probe: Inserted, insertion: Insertion, problems: Problems) -> None:
    """Report layers that are thinner than a step, or than what a tool needs."""
    _, upper = body.heights
    step = insertion.to / insertion.steps
    room, words = probe.insertion_room
    least = max(step, room)
    for number, (layer, end) in enumerate(zip(body.layer, body.interfaces, strict=False), start=1):
        if upper - end < least:
            what = "a step" if least == step else words
            problems.error(
                f"body.layer[{number}].thickness",
                in_mm(upper - end),
                f"{layer.name} is thinner than {what}, {in_mm(least)}: use more steps, a thinner tool or a thicker "
                "layer",
            )
        upper = end
