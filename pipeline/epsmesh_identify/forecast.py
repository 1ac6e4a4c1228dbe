"""What `epsmesh plan` tells of the forces that `epsmesh identify` and a sensitivity need."""

from collections.abc import Iterator
from typing import Any

from epsmesh.extensions import Forecast
from epsmesh.plan.cost import CostModel
from epsmesh.printable import counted
from epsmesh.run.remaining import format_seconds
from epsmesh.study.sweep import Study
from epsmesh_identify.estimation.experiment import deepest_of, of_scene, own_names
from epsmesh_identify.estimation.forward import unknown_domain
from epsmesh_identify.estimation.unknowns import unknowns
from epsmesh_identify.sections.curves import curves_of, sound
from epsmesh_identify.sections.kept import measurements_of, spread_of
from epsmesh_identify.sections.scenes import scene_of
from epsmesh_identify.surrogate.cases import Domain
from epsmesh_identify.surrogate.forecast import forecast
from epsmesh_identify.surrogate.sensitivity import spread_domain


def forecasts(study: Study, cost: CostModel) -> Iterator[Forecast]:
    """Yield about what each table of forces costs, by the command that needs it.

    Depths of a measured curve are taken to be those of the study's probe, if it has any.

    Raises:
        StudyError: if a scene cannot be run.
        ExperimentError: if the depths are those of files that are no curves.
    """
    for command, name, domain in _domains(study):
        cost_of_table = forecast(domain, cost, corrected=command == "identify")
        found = {"command": command, "of": name, **vars(cost_of_table)}
        yield Forecast(found, _line(found))


def _line(found: dict[str, Any]) -> str:
    """Write a forecast as a line."""
    most = f"{counted(found['most'], 'solve')}, {format_seconds(found['most_seconds'])}"
    text = f"about {most}"
    if found["least"] < found["most"]:
        least = f"{counted(found['least'], 'solve')}, {format_seconds(found['least_seconds'])}"
        text = f"{least}, if the sides of the body are far away; if not, {text}"
    return f"  {found['command']}, forces of {found['of']}: {text}; less what is stored"


def _domains(study: Study) -> Iterator[tuple[str, str, Domain]]:
    for measurement in measurements_of(study):
        scene = scene_of(study, measurement)
        if any(problem.key == "probe.depth" for problem in study.lacking):
            deepest = deepest_of(sound(curves_of(study, measurement)))
        else:
            deepest = max(probe.depth for probe in scene.probes)
        sought = of_scene(unknowns(study), own_names(measurement, unknowns(study)))
        yield "identify", measurement.name, unknown_domain(scene, sought, deepest)
    if spread_of(study).varied:
        yield "sensitivity", "the scene", spread_domain(study)
