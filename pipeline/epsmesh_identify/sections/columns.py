"""Columns of files of force curves, as ``[[measurement]]`` names them: their units, and the signs of their values."""

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from epsmesh.shapes.section import Section, Words
from epsmesh.units import parse_quantity
from epsmesh_identify.experiment.header import factor_of


def refused(allowed: str) -> PydanticCustomError:
    """Return the error of a value that is not ``allowed``."""
    return PydanticCustomError("not_supported", "{allowed}", {"allowed": f"must be {allowed}"})


def _column(value: Any) -> str | int:
    """Return the header of a column, or its number."""
    is_number = isinstance(value, int) and not isinstance(value, bool) and value > 0
    if not is_number and not (isinstance(value, str) and value):
        raise refused('the header of a column as text, such as "depth (mm)", or its number from 1')
    found: str | int = value
    return found


Column = Annotated[
    str | int,
    BeforeValidator(_column),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "integer", "minimum": 1}]}),
]


def _unit(kind: str) -> Callable[[str], str]:
    """Return the check of a unit of the same kind as the SI unit ``kind``."""

    def check(text: str) -> str:
        factor_of(text, kind)
        return text

    return check


class Columns(BaseModel):
    """Names or numbers of the columns of a file."""

    model_config = Section.model_config

    depth: Annotated[
        Column | None,
        Words(
            "Column of the depth: its header, or its number from 1.",
            '"indentation / nm"',
            default="found, and reported",
        ),
    ] = None
    force: Annotated[Column | None, Words("Column of the force.", '"load (µN)"', default="found, and reported")] = None
    time: Annotated[Column | None, Words("Column of the time.", '"time [s]"', default="found, and reported")] = None
    piezo: Annotated[
        Column | None,
        Words(
            "Column of the way of the piezo, instead of the depth, which is this way less the deflection.",
            '"Z / nm"',
            default="none",
        ),
    ] = None
    deflection: Annotated[
        Column | None,
        Words("Column of the deflection of a spring, instead of the force.", '"deflection / nm"', default="none"),
    ] = None
    spring: Annotated[
        Annotated[float, Field(gt=0, json_schema_extra={"unit": "N/m"})] | None,
        BeforeValidator(lambda value: None if value is None else parse_quantity(value, "N/m")),
        Words("Stiffness of this spring: the force is stiffness times deflection.", '"0.02 N/m"', default="none"),
    ] = None

    @model_validator(mode="after")
    def _of_one_kind(self) -> "Columns":
        of_spring = {"piezo", "deflection", "spring"} & self.model_fields_set
        if of_spring and len(of_spring) < 3:
            raise PydanticCustomError("not_supported", "must have piezo, deflection and spring together")
        if of_spring and {"depth", "force"} & self.model_fields_set:
            raise PydanticCustomError("not_supported", "must have depth and force, or piezo, deflection and spring")
        return self


LengthUnit = Annotated[str, AfterValidator(_unit("m"))]
ForceUnit = Annotated[str, AfterValidator(_unit("N"))]
TimeUnit = Annotated[str, AfterValidator(_unit("s"))]
_OF_HEADER = "that of the header"


class ColumnUnits(BaseModel):
    """Units of columns whose headers have none."""

    model_config = Section.model_config

    depth: Annotated[LengthUnit | None, Words("Unit of the depth.", '"mm"', default=_OF_HEADER)] = None
    force: Annotated[ForceUnit | None, Words("Unit of the force.", '"mN"', default=_OF_HEADER)] = None
    time: Annotated[TimeUnit | None, Words("Unit of the time.", '"s"', default=_OF_HEADER)] = None
    piezo: Annotated[LengthUnit | None, Words("Unit of the way of the piezo.", '"nm"', default=_OF_HEADER)] = None
    deflection: Annotated[LengthUnit | None, Words("Unit of the deflection.", '"nm"', default=_OF_HEADER)] = None


_FOUND = "that which the curve shows"


class Sign(BaseModel):
    """Signs of recorded values: 1 as they are, -1 if deeper or pressed is negative."""

    model_config = Section.model_config

    depth: Annotated[
        Literal[1, -1] | None, Words("-1 if the recorded depth falls as the tool advances.", "-1", default=_FOUND)
    ] = None
    force: Annotated[
        Literal[1, -1] | None, Words("-1 if the recorded force is negative under pressure.", "-1", default=_FOUND)
    ] = None
