"""What `epsmesh plan` tells of the forces that `epsmesh identify` and `sensitivity` need, and of an export."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from epsmesh.printable import counted
from epsmesh.run.remaining import format_seconds

if TYPE_CHECKING:
    from epsmesh.plan.cost import CostModel
    from epsmesh.study.sweep import Study
    from epsmesh.surrogate.cases import Domain


def forecasts(study: "Study", cost: "CostModel") -> list[dict[str, Any]]:
    """Return about what each table of forces costs, by the command that needs it; none for studies without them.

    Depths of a measured curve are taken to be those of the study's probe, if it has any.

    Raises:
        StudyError: if a scene cannot be run.
        ExperimentError: if the depths are those of files that are no curves.
    """
    if not (study.measurements or study.spread.varied):
        return []
    from epsmesh.surrogate.forecast import forecast

    return [
        {"command": command, "of": name, **vars(forecast(domain, cost, corrected=command == "identify"))}
        for command, name, domain in _domains(study)
    ]


def told(found: dict[str, Any]) -> str:
    """Write a forecast as a line."""
    most = f"{counted(found['most'], 'solve')}, {format_seconds(found['most_seconds'])}"
    text = f"about {most}"
    if found["least"] < found["most"]:
        least = f"{counted(found['least'], 'solve')}, {format_seconds(found['least_seconds'])}"
        text = f"{least}, if the sides of the body are far away; if not, {text}"
    return f"  {found['command']}, forces of {found['of']}: {text}; less what is stored"


def of_export(study: "Study", cost: "CostModel") -> dict[str, Any]:
    """Return about what `epsmesh export` costs, without options; or the reason, ``refused``, why there is no model."""
    from epsmesh_realtime.export.forecast import Export
    from epsmesh_realtime.export.scope import ExportError, scope_of

    try:
        return vars(Export(scope_of(study), cost=cost).forecast())
    except ExportError as reason:
        return {"refused": str(reason).removeprefix(f"{study.file}: ")}


def told_of_export(found: dict[str, Any], ranks: int) -> str:
    """Write it as a line."""
    from epsmesh_realtime.export.forecast import Forecast

    if reason := found.get("refused"):
        return f"  export: no real-time model: {reason}"
    warned = f"; {found['warning']}" if found["warning"] else ""
    return f"  export, as a real-time model: {Forecast(**found).told(ranks)}{warned}"


def _domains(study: "Study") -> "Iterator[tuple[str, str, Domain]]":
    from epsmesh.identify.experiment import deepest_of, of_scene, own_names
    from epsmesh.identify.forward import unknown_domain
    from epsmesh.identify.unknowns import unknowns
    from epsmesh.study.curves import curves_of, sound
    from epsmesh.study.read import scene_of
    from epsmesh.surrogate.sensitivity import spread_domain

    for measurement in study.measurements:
        scene = scene_of(study, measurement)
        if any(problem.key == "probe.depth" for problem in study.lacking):
            deepest = deepest_of(sound(curves_of(study, measurement)))
        else:
            deepest = max(probe.depth for probe in scene.probes)
        sought = of_scene(unknowns(study), own_names(measurement, unknowns(study)))
        yield "identify", measurement.name, unknown_domain(scene, sought, deepest)
    if study.spread.varied:
        yield "sensitivity", "the scene", spread_domain(study)
