"""A modulus that varies from place to place: an image, a formula, or a function of the study's author."""

import hashlib
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from pydantic import Field, PrivateAttr, model_validator
from pydantic_core import PydanticCustomError

from epsmesh.arrays import FloatArray
from epsmesh.shapes.files.loaded import UNITS, LengthUnit
from epsmesh.shapes.formula import Formula, FormulaError
from epsmesh.shapes.frame import Vector
from epsmesh.shapes.section import Section, Words, in_mm
from epsmesh.shapes.triangles import SurfaceError
from epsmesh.sources import content_of, function_in
from epsmesh.units import Travel, canonical, unit_factor

# Increase by hand when the same field gives other values.
_VERSION = 1
# What a field is relative to where no place tells it (Pa).
_ANY = 1e3
_KINDS = ("file", "formula", "function")
_OF_FILE = ("unit", "length_unit", "reach")


class Values(Protocol):
    """A field of values (Pa) on a body."""

    def at(self, points: FloatArray) -> FloatArray:
        """Return the values (Pa) at ``points`` (n, 3), m; NaN where there is none."""


class Varying(Section):
    """Young's modulus as a field: give one of file, formula and function."""

    file: Annotated[
        str | None,
        Words(
            "Image of the modulus (NIfTI, NRRD), in the frame of the body: its path from the folder of the study. "
            "Values are linear between the centres of voxels.",
            '"stiffness.nii.gz"',
            default="none: a formula or a function",
        ),
    ] = None
    unit: Annotated[
        str | None, Words("Unit of the values in the image.", '"kPa"', default="none: required with `file`")
    ] = None
    length_unit: Annotated[
        LengthUnit | None, Words("Unit of length of the image, if its header has none.", '"mm"', default="the header's")
    ] = None
    reach: Annotated[
        Travel,
        Words(
            "Distance up to which places without a value have that of the nearest voxel with one.",
            '"3 mm"',
            default="0 mm: the image must have a value above 0 everywhere in the tissue",
        ),
    ] = 0.0
    formula: Annotated[
        str | None,
        Words(
            "Formula of the modulus, of the coordinates x, y, z of the body and the distance r from the z axis, with "
            "units. It may have + - * / ^, brackets, exp, log, sqrt, sin, cos, tanh, abs, min and max.",
            '"8 kPa * (1 + 0.3*z/(20 mm))"',
            default="none: an image or a function",
        ),
    ] = None
    function: Annotated[
        str | None,
        Words(
            "Function in a Python file beside the study, FILE.py:NAME. It takes points, an array (n, 3) in m, and "
            "returns their moduli (n) in Pa. A run executes the file.",
            '"stiffness.py:young"',
            default="none: an image or a formula",
        ),
    ] = None
    scale: Annotated[
        float,
        Field(gt=0, le=1e6),
        Words("Factor of the field. F is proportional to it.", "[1.0, 1.2]", default="1"),
    ] = 1.0

    _values: Any = PrivateAttr(None)
    _reference: float = PrivateAttr(_ANY)
    _content: str = PrivateAttr("")

    @model_validator(mode="after")
    def _readable(self) -> "Varying":
        given = [key for key in _KINDS if getattr(self, key) is not None]
        if len(given) != 1:
            raise _refused("must have one of `file`, `formula` and `function`")
        if (key := next((key for key in _OF_FILE if key in self.model_fields_set), "")) and given != ["file"]:
            raise _refused(f"`{key}` is for `file`")
        try:
            {"file": self._read_image, "formula": self._read_formula, "function": self._read_function}[given[0]]()
        except (SurfaceError, FormulaError) as error:
            raise _refused(f"{given[0]} `{getattr(self, given[0])}` {error}") from None
        return self

    def _read_image(self) -> None:
        from epsmesh.shapes.files.value_map import read_value_map  # noqa: PLC0415 (only when a file is read)

        if self.unit is None:
            raise _refused('`file` needs `unit`, that of its values, such as unit = "kPa"')
        try:
            factor = unit_factor(self.unit, "Pa")
        except ValueError as error:
            raise _refused(f"`unit` is not {error}") from None
        found = read_value_map(
            Path(str(self.file)), UNITS[self.length_unit] if self.length_unit else None, factor, self.reach
        )
        self._values, self._reference, self._content = found, found.mean, found.content

    def _read_formula(self) -> None:
        formula = Formula(str(self.formula))
        formula.check()
        self._values, self._content = formula, formula.identity
        if isfinite(value := float(formula.at(np.zeros((1, 3)))[0])) and value > 0:
            self._reference = value

    def _read_function(self) -> None:
        if function_in(str(self.function))[0].is_file():  # else the study is refused
            self._content = " ".join(content_of(str(self.function)))

    @property
    def young(self) -> float:
        """The modulus (Pa) that the field is relative to: the mean of an image, a formula's value at the origin."""
        return canonical(self.scale * self._reference)

    @property
    def identity(self) -> str:
        """What the field relative to :attr:`young` is: a hash of its content."""
        text = f"{_VERSION} {self._content} {self.kind} {canonical(self._reference)!r}"
        return hashlib.sha256(text.encode()).hexdigest()[:24]

    @property
    def kind(self) -> Literal["file", "formula", "function"]:
        """What it is given by."""
        return "file" if self.file is not None else "formula" if self.formula is not None else "function"

    @property
    def detail(self) -> float:
        """The size (m) of voxels; infinite without an image."""
        return float(self._values.spacing.min()) if self.kind == "file" else inf

    @property
    def range(self) -> tuple[float, float]:
        """The least and the largest modulus (Pa) of an image."""
        known = self.scale * self._values.values[np.isfinite(self._values.values)]
        return float(known.min()), float(known.max())

    @property
    def notices(self) -> tuple[str, ...]:
        """Notices about what was read."""
        return tuple(self._values.notices) if self.kind == "file" else ()

    def is_mirrored(self, normal: Vector) -> bool:
        """Return whether it certainly is its own image in a plane with that unit normal; of images, nobody knows."""
        axes = [axis for axis, part in enumerate(normal) if part]
        return self.kind == "formula" and len(axes) == 1 and axes[0] < 2 and self._values.is_mirrored(axes[0])

    @property
    def is_round(self) -> bool:
        """Whether it certainly is a formula of r and z alone."""
        return self.kind == "formula" and bool(self._values.is_round)

    def at(self, points: FloatArray) -> FloatArray:
        """Return the moduli (Pa) at ``points`` (n, 3), m, without the factor ``scale``; NaN where there is none."""
        return np.asarray(self._values.at(points))

    def coarsened(self) -> Values:
        """Return the image with voxels twice as wide."""
        found: Values = self._values.coarsened()
        return found

    def relative(self, values: FloatArray) -> FloatArray:
        """Return moduli (Pa), without the factor ``scale``, relative to :attr:`young` without it."""
        return values / canonical(self._reference)

    def refusal(self, key: str, point: FloatArray, value: float) -> str:
        """Return the message about a ``value`` (Pa) at a ``point`` (3), m, that is not positive."""
        place = ", ".join(in_mm(float(x)) for x in point)
        found = f"is {value:.4g} Pa" if isfinite(value) else "has no value"
        if self.kind != "file":
            return (
                f"{key}: {self.kind} `{getattr(self, self.kind)}` {found} at ({place}): must be above 0 in all tissue"
            )
        away = (
            "outside the image" if not self._values.is_inside(self._values.indices(point[None]))[0] else "in the image"
        )
        return (
            f"{key}: `{self.file}` has no value above 0 at ({place}), {away}, where there is tissue: give a larger "
            'image, or `reach`, such as reach = "3 mm", for the nearest voxel with a value'
        )


def _refused(allowed: str) -> PydanticCustomError:
    return PydanticCustomError("not_supported", "{allowed}", {"allowed": allowed})
