"""Reading of ``[sensitivity]``: ranges of parameters, and the outputs whose spread over them is to be explained.

Forces do not depend on this section: it neither sweeps nor changes cases.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from epsmesh.quantities import LARGEST
from epsmesh.study.output import Output
from epsmesh.study.problems import Problems, nearest, tuples
from epsmesh_identify.sections.identification import Sought, given_one, known_one
from epsmesh_identify.sections.measurement import Sensitivity
from epsmesh_identify.sections.parameters import Parameter

# Results of one scene that are one positive number for each case.
_RESULTS = ("force", "contact_area", "contact_radius", "slip_area", "friction_force", "torque", "energy_release")
OUTPUTS = (*_RESULTS, *LARGEST)


@dataclass(frozen=True)
class Spread:
    """Parameters with their ranges, and names of outputs."""

    varied: tuple[Sought, ...] = ()
    outputs: tuple[str, ...] = ()


def read_sensitivity(raw: Any, known: Mapping[str, Parameter], own: Sequence[Output], problems: Problems) -> Spread:
    """Return the parameters of ``[sensitivity]``, of those that are ``known`` by name, and its outputs.

    ``own`` are the study's: how one of a function depends on the moduli, of which one is a factor, is not known.
    """
    if not isinstance(raw, dict):
        problems.error("sensitivity", raw, "must be a table: write [sensitivity]")
        return Spread()
    keys = {key: value for key, value in raw.items() if key in Sensitivity.model_fields and key != "name"}
    try:
        section = Sensitivity.model_validate({key: tuples(value) for key, value in keys.items()})
    except ValidationError as error:
        problems.from_pydantic("sensitivity", error, Sensitivity, keys)
        return Spread()
    for name in section.outputs:
        if any(one.function for one in own if one.name == name):
            problems.error("sensitivity.outputs", name, "is a function: use an output at a point, or of a region")
        elif name not in (outputs := (*OUTPUTS, *(one.name for one in own if one.of))):
            allowed = f"is no result of a case that is one number; {nearest(name, outputs)}"
            problems.error("sensitivity.outputs", name, allowed)
    varied = []
    for key in (key for key in raw if key not in keys):
        parameter = known_one(f"sensitivity.{key}", raw[key], key, known, problems)
        if parameter and (one := given_one("sensitivity", parameter, raw[key], problems)):
            varied.append(one)
    if not varied and not problems.errors:
        allowed = 'must have a parameter with its range, such as young = ["5 kPa", "20 kPa"]'
        problems.error("sensitivity", None, allowed)
    return Spread(tuple(varied), section.outputs)
