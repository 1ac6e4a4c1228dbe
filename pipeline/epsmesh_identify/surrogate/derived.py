"""Studies whose cases a surrogate is made of: a scene with lists of values, run and stored as any other study."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Body
from epsmesh.shapes.probe import Probe
from epsmesh.study.problems import Problem, StudyError
from epsmesh.study.read import parse
from epsmesh.study.schema import SECTIONS, Material
from epsmesh.study.sweep import Study
from epsmesh.study.swept import Place, placed, written
from epsmesh.study.toml import to_toml
from epsmesh_identify.sections.parameters import Parameter, parameters_of

# Error bars asked of cases whose study has none: those of the meridian cost little.
ON_MERIDIAN, IN_SPACE = 1e-3, 1e-2


@dataclass(frozen=True)
class Output:
    """A variable of a dataset, one positive number for each case, with its unit."""

    name: str
    unit: str

    @property
    def is_proportional(self) -> bool:
        """Whether it is proportional to all moduli together: forces, stresses and energies are, lengths are not."""
        return any(unit in self.unit for unit in ("N", "Pa", "J"))


FORCE = Output("force", "N")


def parameters(scene: Study) -> dict[str, Parameter]:
    """Return the parameters of a scene by name, with their places in its file."""
    body, material, probe = (scene.sections[name][0] for name in ("body", "material", "probe"))
    assert isinstance(body, Body) and isinstance(material, Material) and isinstance(probe, Probe)
    return {name: one for name, one in parameters_of(body, material, probe).items() if one.place}


def has_mesh(scene: Study) -> bool:
    """Return whether a study has one mesh, and not a comparison of several."""
    mesh = scene.raw.get("mesh")
    return isinstance(mesh, Mapping) and not any(isinstance(value, list) for value in mesh.values())


def derive(
    scene: Study, values: Mapping[Parameter, Sequence[float]], accuracy: float | None, output: Output = FORCE
) -> Study:
    """Return the study whose cases are the product of ``values`` (SI units), with meshes for an ``accuracy`` if given.

    Of the scene's own outputs it has the one that is asked for.

    The elastic force is computed: relaxation is a factor of its own, that of the time.

    Raises:
        StudyError: with every problem of it, such as sweeps of the scene.
    """
    raw = _elastic(scene.raw)
    if asked := [one for one in scene.raw.get("output", ()) if one["name"] == output.name]:
        raw["output"] = asked
    if accuracy is not None:
        raw["mesh"] = {"accuracy": f"{accuracy:g}"}
    if arrays := [name for name in ("body", "material", "probe") if isinstance(raw.get(name), list)]:
        raise StudyError(scene.file, [Problem(name, None, "is an array of tables: one is needed") for name in arrays])
    for parameter, found in values.items():
        raw = placed(raw, [(_sweep(parameter.place), [_written(raw, parameter, value) for value in found])])
    study = parse(raw, file=scene.file, text=to_toml(raw, scene.file))
    own = {path_of(parameter) for parameter in values}
    if swept := [axis for axis in study.axes if axis.path not in own]:
        problems = [Problem(axis.path, None, f"is a list of {len(axis)}: one value is needed") for axis in swept]
        raise StudyError(scene.file, problems)
    return study


def in_order(study: Study, order: Sequence[Parameter], values: Any) -> FloatArray:
    """Return an array of a dataset (xarray) with the dimensions of parameters in their order."""
    names = {axis.path: axis.name for axis in study.axes}
    return np.asarray(values.transpose(*(names[path_of(parameter)] for parameter in order)), dtype=float)


def _elastic(raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return a study without what the elastic force does not depend on."""
    found = {
        name: section for name, section in raw.items() if name in SECTIONS and name not in ("figure", "credibility")
    }
    for section, key in (("probe", "history"), ("material", "relaxation")):
        if isinstance(table := found.get(section), dict):
            found[section] = {name: value for name, value in table.items() if name != key}
    for section in {"material", "body"} & found.keys():  # layers may leave nothing for a [material]
        found[section] = _without_spread(found[section])
    found["solve"] = {**found.get("solve", {}), "exact": False, "timing": False, "influence": False}
    return found


def _without_spread(table: Any) -> Any:
    """Return tissues without their random deviations, which do not change F."""
    if isinstance(table, list):
        return [_without_spread(one) for one in table]
    if isinstance(table, dict):
        return {name: _without_spread(value) for name, value in table.items() if name != "spread"}
    return table


def _sweep(place: Place) -> Place:
    """Return the place of the list: that of a part of a size is the size's."""
    return place[:-1] if isinstance(place[-1], int) else place


def path_of(parameter: Parameter) -> str:
    """Return a parameter's place as the axes of studies have it."""
    section, *rest = _sweep(parameter.place)
    return f"{section}.{written(tuple(rest))}"


def _written(raw: Mapping[str, Any], parameter: Parameter, value: float) -> Any:
    """Return a value as a study has it."""
    text = f"{value:.12g} {parameter.unit}" if parameter.unit != "1" else float(f"{value:.12g}")
    if not isinstance(number := parameter.place[-1], int):
        return text
    whole: Any = raw
    for step in parameter.place[:-1]:
        whole = whole[step]
    return [*whole[:number], text, *whole[number + 1 :]]
