"""``[[measurement]]`` and ``[identify]``: measured force curves, and what is to be found from them.

Forces do not depend on these sections: they neither sweep nor change cases.
"""

from math import inf
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from epsmesh.shapes.section import Section, Words
from epsmesh.units import parse_quantity
from epsmesh_identify.experiment.reading import UNITS, Reading, Segment, Window
from epsmesh_identify.sections.columns import Columns, ColumnUnits, Sign, refused

Stiffness = float | tuple[float, float] | Literal["unknown"]
Hidden = Literal["layer", "base", "strain"]

_RIGID = "rigid"


def _window(value: Any) -> Window | None:
    """Return a range of depth or of time; None for "auto"."""
    allowed = '"auto", or a range of depth or time as recorded, such as ["0 mm", "0.5 mm"] or ["0 s", "12 s"]'
    if value == "auto":
        return None
    if not (isinstance(value, tuple) and len(value) == 2):
        raise refused(allowed)
    for unit in ("m", "s"):
        try:
            low, high = (parse_quantity(end, unit) for end in value)
        except PydanticCustomError:
            continue
        if low >= high:
            raise refused(f"{allowed}; its first end is not below its second")
        return Window(low, high, "m" if unit == "m" else "s")
    raise refused(allowed)


def _stiffness(value: Any) -> Stiffness:
    """Return a stiffness (N/m), infinite if it is rigid; or its lowest and highest value; or "unknown"."""
    allowed = '"rigid", a stiffness such as "60 N/mm", a range such as ["50 N/mm", "64 N/mm"], or "unknown"'
    if value in (_RIGID, "unknown"):
        return inf if value == _RIGID else "unknown"
    try:
        if isinstance(value, tuple) and len(value) == 2:
            low, high = (parse_quantity(end, "N/m") for end in value)
            if not 0 < low < high:
                raise refused(f"{allowed}; a range rises, and is above 0")
            return low, high
        stiffness = parse_quantity(value, "N/m")
    except PydanticCustomError as error:
        raise error if error.type == "not_supported" else refused(f"{allowed}: {error.message()}") from None
    if stiffness <= 0:
        raise refused(f"{allowed}; it is above 0")
    return stiffness


_TABLE = WithJsonSchema({"type": "object"})


class Measurement(Section):
    """One measured force curve, or a folder of them, and the scene it was measured on."""

    name: Annotated[
        str,
        Field(exclude=True, min_length=1),
        Words(
            "Name of the measurement, in messages, figures and the dataset.",
            '"punch 2 mm"',
            default="that of the file, without its ending",
        ),
    ] = ""
    file: Annotated[
        str,
        Field(min_length=1),
        Words(
            "File with the curve: CSV, TSV or other text in columns. Its path is relative to the study's folder. A "
            "pattern such as curves/*.csv is many specimens: a dimension of the results.",
            '"curves/punch2.csv"',
        ),
    ]
    columns: Annotated[
        Columns | None,
        Words("Columns of the file.", '{depth = "depth (mm)", force = "force (N)"}', default="found, and reported"),
    ] = None
    units: Annotated[
        ColumnUnits | None,
        Words("Units of columns, where headers have none.", '{depth = "mm", force = "N"}', default="those of headers"),
    ] = None
    segment: Annotated[
        Segment,
        Words("Part of the curve. Relaxation needs approach+hold, and a column of time.", '"approach+hold"'),
    ] = "approach"
    cycle: Annotated[int, Field(ge=1), Words("Number of the cycle, of a file that has several.", "1")] = 1
    window: Annotated[
        Window | None,
        BeforeValidator(_window),
        WithJsonSchema({"anyOf": [{"const": "auto"}, {"type": "array", "items": {"type": "string"}}]}),
        Words(
            "Range of depth as recorded, or of time since the first row, that is used. Include the approach through "
            "air: it has the baseline. auto: the whole segment, without air far longer than the contact.",
            '["0 mm", "0.5 mm"]',
            default='"auto"',
            takes='"auto" | 2 lengths | 2 times',
        ),
    ] = None
    sign: Annotated[
        Sign | None,
        Words("Signs of depth and force, 1 or -1.", "{depth = -1, force = 1}", default="found, and reported"),
    ] = None
    depth_is: Annotated[
        Literal["machine", "tool"],
        Words(
            "What the depth is: the way of the machine, of which `machine_stiffness` takes its share, or of the tool.",
            '"tool"',
        ),
    ] = "machine"
    machine_stiffness: Annotated[
        Stiffness,
        BeforeValidator(_stiffness),
        WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}),
        Words(
            "Stiffness of machine, load cell and holder together: rigid, a value, a range, or unknown. A range and "
            'unknown are found with the rest: "machine_stiffness" of [identify].',
            '["50 N/mm", "64 N/mm"]',
            default='"rigid"',
            takes='"rigid" | stiffness > 0 | 2 stiffnesses | "unknown"',
        ),
    ] = inf
    baseline: Annotated[
        Literal["tilted", "level"],
        Words(
            "The force without contact: linear in the depth, or constant. Its tilt is an unknown if the curve has a "
            "part before contact, known to ± 6 % of the mean slope in contact beforehand.",
            '"level"',
        ),
    ] = "tilted"
    probe: Annotated[
        dict[str, Any] | None,
        _TABLE,
        Words(
            "Keys of [probe] that differ for this measurement. Of [[probe]] tables, `name` chooses one.",
            '{radius = "2 mm"}',
            default="the study's",
        ),
    ] = None
    body: Annotated[
        dict[str, Any] | None,
        _TABLE,
        Words(
            "Keys of [body] that differ for this measurement. Of [[body]] tables, `name` chooses one.",
            '{size = ["40 mm", "40 mm", "8 mm"]}',
            default="the study's",
        ),
    ] = None

    errors: Annotated[
        dict[str, str] | None,
        _TABLE,
        Words(
            "Errors (95 %) of lengths of this measurement's own tool and body, such as radius, thickness or "
            "skin_thickness: they widen all bars. A length that all measurements have alike is a key of [identify].",
            '{radius = "2 %", thickness = "0.2 mm"}',
            default="none: lengths are exact",
        ),
    ] = None

    @model_validator(mode="after")
    def _of_one_way(self) -> "Measurement":
        if self.depth_is == "tool" and self.machine_stiffness != inf:
            raise PydanticCustomError(
                "not_supported", 'depth_is = "tool" excludes `machine_stiffness`: the tool\'s way has no machine in it'
            )
        return self

    @property
    def machine_compliance(self) -> float | None:
        """What the machine yields (m/N): 0 if it is rigid; None if it is to be found."""
        return 1 / self.machine_stiffness if isinstance(self.machine_stiffness, float) else None

    @property
    def may_tilt(self) -> bool:
        """Whether the force without contact may be linear in the depth."""
        return self.baseline == "tilted"

    @property
    def reading(self) -> Reading:
        """How its file is read."""
        columns = self.columns.model_dump(exclude_none=True, include=set(UNITS)) if self.columns else {}
        return Reading(
            columns=columns,
            units=self.units.model_dump(exclude_none=True) if self.units else {},
            spring=self.columns.spring if self.columns else None,
            segment=self.segment,
            cycle=self.cycle,
            window=self.window,
            depth_sign=self.sign.depth if self.sign else None,
            force_sign=self.sign.force if self.sign else None,
        )


class Identify(Section):
    """Keys of ``[identify]`` besides the unknowns."""

    unknown: Annotated[
        tuple[Annotated[str, Field(min_length=1)], ...],
        Words(
            "Names of unknowns with a default range. Others are keys of this section: a range, such as "
            'young = ["1 kPa", "1 MPa"], or a value with an error, such as skin_thickness = {value = "2 mm", error = '
            '"5 %"}. Contact point and baseline are always unknown.',
            '["young", "poisson", "drift"]',
            default="Young's moduli, contact_point and baseline",
        ),
    ] = ()
    may_hide: Annotated[
        tuple[Hidden, ...],
        Words(
            "What the body may have that is not declared: a layer, a stiff base, stiffening with strain. The second "
            "error bar includes it. []: the body is as declared.",
            '["layer", "strain"]',
        ),
    ] = ("layer", "base", "strain")


class Sensitivity(Section):
    """Keys of ``[sensitivity]`` besides the parameters."""

    outputs: Annotated[
        tuple[Annotated[str, Field(min_length=1)], ...],
        Words(
            "Variables of the dataset whose spread is explained. All other keys of this section are parameters, as in "
            '[identify]: a range, such as young = ["5 kPa", "20 kPa"], or a value with an error, such as '
            'skin_thickness = {value = "2 mm", error = "5 %"}.',
            '["force", "contact_area"]',
        ),
    ] = ("force",)
