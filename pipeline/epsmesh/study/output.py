"""``[[output]]``: numbers that a study asks for besides the force, at a point, over a region, or of a function."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from epsmesh.quantities import RESERVED
from epsmesh.shapes.body import Body
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import Section, Words
from epsmesh.sources import function_in, problem_of, with_imported
from epsmesh.study.axis import Axis
from epsmesh.study.insertion_stages import has_insertion
from epsmesh.study.problems import Problems, nearest, tuples
from epsmesh.units import Coordinate, parse_quantity

# What an output is of, with its unit and its meaning.
QUANTITIES = {
    "displacement": ("m", "length of the displacement"),
    "displacement_x": ("m", "displacement along x"),
    "displacement_y": ("m", "displacement along y"),
    "displacement_z": ("m", "displacement along z"),
    "von_mises": ("Pa", "von Mises stress"),
    "max_principal": ("Pa", "largest principal stress"),
    "min_principal": ("Pa", "smallest principal stress"),
    "pressure": ("Pa", "mean pressure, minus a third of the trace of the stress"),
    "max_strain": ("1", "largest principal strain by magnitude"),
}
# All tissue of the body, as a region; and the body's own tissue, which is in no layer and no inclusion.
WHOLE, OWN = "body", "tissue"
_MOST = 50


def _reduction(value: Any) -> Any:
    """Return "max", "mean", or the share of the volume of a quantile."""
    if value in ("max", "mean"):
        return value
    try:
        share = parse_quantity(value, "")
    except ValueError:
        share = -1.0
    if not 0 < share < 1:
        raise PydanticCustomError(
            "not_supported",
            'must be "max", "mean", or a share of the volume such as "95 %", in which the value is at most the output',
        )
    return share


class Output(Section):
    """One number of each case: at a point, over a region, or of a function of the study's author."""

    name: Annotated[
        str,
        Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$"),
        Words(
            "Name of the output: letters, digits and _. It is a variable of the dataset; NAME_error is its error bar.",
            '"tumour_stress"',
        ),
    ]
    of: Annotated[
        Literal[tuple(QUANTITIES)] | None,  # type: ignore[valid-type]
        Words("Quantity, at the point or in the region.", '"von_mises"', default="none: of a function"),
    ] = None
    at: Annotated[
        tuple[Coordinate, Coordinate, Coordinate] | None,
        Words("Point of the undeformed body.", '["0 mm", "0 mm", "-5 mm"]', default="none: of a region or a function"),
    ] = None
    region: Annotated[
        str | None,
        Words(
            'Region: the name of a layer, an inclusion or a region, "tissue" for the body outside them, "body" for '
            "all.",
            '"tumour"',
            default="none: at a point, or of a function",
        ),
    ] = None
    reduce: Annotated[
        float | Literal["max", "mean"] | None,
        BeforeValidator(_reduction),
        Words(
            "Number that stands for the region: max, mean over the volume, or a quantile: the value that a share of "
            "the volume does not exceed.",
            '"95 %"',
            default='"max"',
            takes='"max" | "mean" | share',
        ),
    ] = None
    function: Annotated[
        str | None,
        Words(
            "Function in a Python file beside the study, FILE.py:NAME. It takes the solution and returns a number. "
            "A run executes the file.",
            '"outputs.py:energy_in_tumour"',
            default="none: at a point or of a region",
        ),
    ] = None
    unit: Annotated[
        str | None,
        Words("Unit of a function's number, for the dataset.", '"J"', default="that of the quantity, or 1"),
    ] = None

    @model_validator(mode="after")
    def _of_one_kind(self) -> "Output":
        given = [key for key in ("at", "region", "function") if getattr(self, key) is not None]
        if len(given) != 1:
            raise _refused("must have one of `at`, `region` and `function`")
        if (self.of is None) == (self.function is None):
            raise _refused(f"`{given[0]}` {'excludes' if self.function else 'needs'} `of`")
        if self.reduce is not None and self.region is None:
            raise _refused(f"`{given[0]}` excludes `reduce`, which is of a region")
        if self.unit is not None and self.function is None:
            raise _refused(f"`{given[0]}` excludes `unit`, which is of a function")
        return self

    @property
    def reduction(self) -> float | str:
        """What stands for the region: "max", "mean", or the share of a quantile."""
        return "max" if self.reduce is None else self.reduce

    @property
    def path(self) -> tuple[Path, str]:
        """The file of the function, and its name there."""
        return function_in(self.function or "")

    @property
    def sources(self) -> tuple[Path, ...]:
        """The file of the function, and the modules beside it that it imports, as those import others."""
        file, _ = self.path
        return with_imported(file)

    @property
    def attributes(self) -> dict[str, str]:
        """Unit and long name of the variable in a dataset."""
        if self.of is None:
            return {"units": self.unit or "1", "long_name": f"function {Path(self.path[0]).name}:{self.path[1]}"}
        unit, meaning = QUANTITIES[self.of]
        if self.at is not None:
            return {"units": unit, "long_name": f"{meaning} at ({', '.join(f'{x * 1e3:.6g}' for x in self.at)}) mm"}
        how = self.reduction if isinstance(self.reduction, str) else f"{100 * self.reduction:g} % quantile"
        return {"units": unit, "long_name": f"{meaning}, {how} in {self.region}"}

    @property
    def variables(self) -> dict[str, dict[str, str]]:
        """Variables of the dataset with their attributes: the number, and its error bar."""
        own = self.attributes
        return {self.name: own, f"{self.name}_error": own | {"long_name": f"error bar (95 %) on {self.name}"}}


def _refused(allowed: str) -> PydanticCustomError:
    return PydanticCustomError("not_supported", "{allowed}", {"allowed": allowed})


def read_outputs(raw: Any, folder: Path, problems: Problems) -> tuple[Output, ...]:
    """Return the outputs of ``[[output]]`` tables; files of functions are in ``folder``."""
    if not isinstance(raw, list) or not raw or len(raw) > _MOST:
        problems.error("output", None, f"must be an array of 1 to {_MOST} tables: write [[output]]")
        return ()
    found = []
    for number, table in enumerate(raw, start=1):
        where = f"output[{number}]"
        if not isinstance(table, dict):
            problems.error(where, table, "must be a table: write [[output]]")
            continue
        try:
            one = Output.model_validate({key: tuples(value) for key, value in table.items()})
        except ValidationError as error:
            problems.from_pydantic(where, error, Output, table)
            continue
        if one.function is not None:
            if wrong := problem_of(one.function, folder):
                problems.error(f"{where}.function", one.function, wrong)
                continue
            one = one.model_copy(update={"function": str(folder / one.function)})
        found.append(one)
    for name, count in Counter(one.name for one in found).items():
        if count > 1:
            problems.error("output.name", name, "is the name of several outputs: names must differ")
    return tuple(found)


def check_outputs(
    outputs: Sequence[Output], sections: Mapping[str, Sequence[Section]], axes: Sequence[Axis], problems: Problems
) -> None:
    """Check that regions exist, that names are free, and what outputs do not go together with."""
    taken = RESERVED | {axis.name for axis in axes} | {f"{one.name}_error" for one in outputs}
    for number, one in enumerate(outputs, start=1):
        where = f"output[{number}]"
        if one.name in taken:
            problems.error(f"{where}.name", one.name, "is the name of another variable of the dataset: use another one")
        for body in (each for each in sections["body"] if isinstance(each, Body)):
            names = [WHOLE, *(() if body.is_filled else (OWN,)), *(region.name for region in body.regions)]
            if one.region is not None and one.region not in names:
                problems.error(f"{where}.region", one.region, f"is no region of the body; {nearest(one.region, names)}")
                break
    if outputs and any(isinstance(probe, Probe) and probe.history for probe in sections["probe"]):
        problems.error("output", None, "is not computed over time: omit [probe.history], or [[output]]")
    if outputs and has_insertion(sections["probe"]):
        problems.error("output", None, "is not computed along an insertion: omit [probe.insertion], or [[output]]")
