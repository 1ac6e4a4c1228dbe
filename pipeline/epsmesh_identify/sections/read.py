"""Reading of the sections of this package: what a study with them need not say, and what they say."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from epsmesh.extensions import Filled, Reading
from epsmesh.shapes.body import Body
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import Section
from epsmesh.study.output import Output
from epsmesh.study.problems import Problems
from epsmesh.study.schema import Material
from epsmesh_identify.sections.identification import Identification, check_shared, read_identify, read_measurements
from epsmesh_identify.sections.measured import OF_ONE_FORCE, completed, with_borrowed
from epsmesh_identify.sections.measurement import Measurement
from epsmesh_identify.sections.own_lengths import own_errors
from epsmesh_identify.sections.parameters import DEPTH, Parameter, parameters_of
from epsmesh_identify.sections.scenes import scene_at
from epsmesh_identify.sections.sensitivity import Spread, read_sensitivity


def fill(study: Filled) -> Filled:
    """Return a study with what its measurements have of their own, and values of what is sought."""
    if not {"measurement", "identify"} & study.given.keys():
        return replace(study, of_one_force=OF_ONE_FORCE)
    return completed(with_borrowed(study))


def read(study: Reading) -> Mapping[str, Any]:
    """Return the measurements, what is to be found from them, and parameters that vary, with their outputs."""
    measurements, found = _read_experiment(study)
    return {"measurement": measurements, "identify": found, "sensitivity": _read_spread(study, study.outputs())}


def _read_experiment(study: Reading) -> tuple[tuple[Measurement, ...], Identification]:
    """Return the measurements of a study, and what is to be found from them."""
    raw, problems = study.given, study.problems
    measurements = read_measurements(raw["measurement"], problems) if "measurement" in raw else ()
    if problems.errors or not (measurements or "identify" in raw):
        return measurements, Identification()
    found = read_identify(raw.get("identify", {}), measurements, _parameters(study.sections), problems)
    for number, measurement in enumerate(measurements, start=1):
        where, known = f"measurement[{number}]", _parameters(study.sections)
        if measurement.probe or measurement.body:
            scene = scene_at(raw, measurement, where, study.file, problems)
            if scene is None:
                continue
            known = _parameters(scene.sections)
            check_shared(found, measurement, known, problems)
        found = own_errors(found, measurement, where, known, problems)
    return measurements, found


def _read_spread(study: Reading, outputs: Sequence[Output]) -> Spread:
    """Return the parameters that are varied, and the outputs to explain."""
    if study.problems.errors or "sensitivity" not in study.given:
        return Spread()
    _check_constant(study.sections, study.problems)
    known = {name: one for name, one in _parameters(study.sections).items() if one.place}
    asked = study.given["sensitivity"]
    return read_sensitivity(asked, known | {DEPTH.name: DEPTH}, outputs, study.problems)


def _check_constant(sections: Mapping[str, tuple[Section, ...]], problems: Problems) -> None:
    """Report moduli that vary from place to place: a modulus is then no number to be varied."""
    for body, material in product(sections["body"], sections["material"]):
        assert isinstance(body, Body) and isinstance(material, Material)
        if any(tissue.varying is not None for tissue in (material, *body.regions)):
            allowed = "is a field, and sensitivity is computed for one modulus in each region: give a value"
            problems.error("material.young", None, allowed)
            return


def _parameters(sections: Mapping[str, tuple[Section, ...]]) -> dict[str, Parameter]:
    """Return the parameters of the first scene, by name."""
    body, material, probe = (sections[name][0] for name in ("body", "material", "probe"))
    assert isinstance(body, Body) and isinstance(material, Material) and isinstance(probe, Probe)
    return parameters_of(body, material, probe)
