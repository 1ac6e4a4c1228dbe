"""Formulas with units: numbers, lengths and pressures, the coordinates, and a few functions; nothing else is evaluated.

    8 kPa * (1 + 0.3*z/(20 mm))

x, y and z are the coordinates of the body, r is the distance from the z axis. Units are checked through the whole
formula.
"""

import ast
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.units import parse_quantity

COORDINATES = ("x", "y", "z", "r")
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos, "tanh": np.tanh,
    "sqrt": np.sqrt, "abs": np.abs, "min": np.minimum, "max": np.maximum,
}  # fmt: skip
# Of several values of one unit, which the result has.
_OF_ONE_UNIT = ("abs", "min", "max")
_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)
_QUANTITY = re.compile(r"(?<![\w.])(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)[ \t]*([^\W\d_]+|%|°)")
_LONGEST, _DEEPEST = 500, 50
# What a word processor writes for operators.
_SPELLINGS = str.maketrans({"^": "**", "·": "*", "×": "*", "\N{MINUS SIGN}": "-", "\N{NO-BREAK SPACE}": " "})
_NUMBER, _LENGTH, _PRESSURE = (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)
_KINDS = {_NUMBER: "a number", _LENGTH: "a length", _PRESSURE: "a pressure"}


class FormulaError(ValueError):
    """A formula cannot be read, or is no pressure."""


@dataclass(frozen=True)
class _Value:
    """Values in SI units; ``unit`` are the powers of m and of Pa."""

    values: Any
    unit: tuple[float, float]

    @property
    def kind(self) -> str:
        return _KINDS.get(self.unit, f"in m^{self.unit[0]:g} Pa^{self.unit[1]:g}")


@dataclass(frozen=True)
class Formula:
    """A formula of a pressure; equal to another one that is written with the same numbers and names."""

    text: str

    @cached_property
    def _parsed(self) -> tuple[ast.expr, tuple[_Value, ...]]:
        quantities: list[_Value] = []

        def replaced(match: re.Match[str]) -> str:
            quantities.append(_quantity(match[1], match[2]))
            return f"(_{len(quantities) - 1})"

        if len(self.text) > _LONGEST:
            raise FormulaError(f"has {len(self.text)} characters: at most {_LONGEST}")
        plain = _QUANTITY.sub(replaced, self.text.strip().translate(_SPELLINGS))
        try:
            tree = ast.parse(plain, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise FormulaError('is no formula: write it as "8 kPa * (1 + 0.3*z/(20 mm))"') from None
        if _depth(tree) > _DEEPEST:
            raise FormulaError("is nested too deeply")
        return tree, tuple(quantities)

    @property
    def identity(self) -> str:
        """What it is, in a form that spaces and units do not change."""
        tree, quantities = self._parsed
        return f"{ast.dump(tree)} {[(one.values, one.unit) for one in quantities]}"

    def check(self) -> None:
        """Raise the error of a formula that is none, or of no pressure.

        Raises:
            FormulaError: if so, with what is allowed.
        """
        found = self._evaluated(np.zeros((1, 3)))
        if found.unit != _PRESSURE:
            raise FormulaError(f"is {found.kind}: must be a pressure, such as 8 kPa * (1 + z/(20 mm))")

    def at(self, points: FloatArray) -> FloatArray:
        """Return its values (Pa) at ``points`` (n, 3), m."""
        return np.broadcast_to(np.asarray(self._evaluated(points).values, dtype=float), len(points)).copy()

    def is_mirrored(self, axis: int) -> bool:
        """Return whether it certainly is its own image in the plane where a coordinate is zero: 0 for x, 1 for y."""
        return _is_even(self._parsed[0], COORDINATES[axis])

    @property
    def is_round(self) -> bool:
        """Whether it certainly is of r and z alone: x and y occur in x^2 + y^2 only."""
        return _is_round(self._parsed[0])

    def _evaluated(self, points: FloatArray) -> _Value:
        tree, quantities = self._parsed
        x, y, z = points.T
        named = {name: _Value(values, _LENGTH) for name, values in zip("xyz", (x, y, z), strict=True)}
        named["r"] = _Value(np.hypot(x, y), _LENGTH)
        named |= {f"_{number}": value for number, value in enumerate(quantities)}
        with np.errstate(all="ignore"):  # what is no number is refused with its place
            return _value(tree, named)


def _quantity(number: str, unit: str) -> _Value:
    """Return a number with its unit, of a length or a pressure, or a share."""
    for kind, powers in (("m", _LENGTH), ("Pa", _PRESSURE), ("", _NUMBER)):
        try:
            return _Value(parse_quantity(f"{number} {unit}", kind), powers)
        except ValueError:
            continue
    raise FormulaError(f"`{number} {unit}` is no length and no pressure; between a number and a name, write *")


def _value(node: ast.expr, named: dict[str, _Value]) -> _Value:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return _Value(float(number), _NUMBER)
        case ast.Name(id=name) if name in named:
            return named[name]
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=inner):
            found = _value(inner, named)
            return _Value(-found.values if isinstance(sign, ast.USub) else found.values, found.unit)
        case ast.BinOp(op=operator) if isinstance(operator, _OPERATORS):
            return _combined(operator, _value(node.left, named), _value(node.right, named))
        case ast.Call(func=ast.Name(id=name), args=parts, keywords=[]) if name in _FUNCTIONS and parts:
            return _called(name, [_value(part, named) for part in parts])
        case ast.Name(id=name) | ast.Call(func=ast.Name(id=name)) if name not in _FUNCTIONS:
            raise FormulaError(
                f"has the unknown name `{name}`: known are {', '.join(COORDINATES)}, {', '.join(_FUNCTIONS)}; a unit "
                "follows a number, as in 1 mm"
            )
    raise FormulaError("may have numbers, units, + - * / ^, brackets, coordinates and functions only")


def _combined(operator: ast.operator, left: _Value, right: _Value) -> _Value:
    (a, b), (c, d) = left.unit, right.unit
    match operator:
        case ast.Mult():
            return _Value(left.values * right.values, (a + c, b + d))
        case ast.Div():
            return _Value(np.divide(left.values, right.values), (a - c, b - d))
        case ast.Pow():
            if right.unit != _NUMBER or (left.unit != _NUMBER and np.ndim(right.values)):
                raise FormulaError("has an exponent that is no number")
            power = float(right.values) if left.unit != _NUMBER else 0.0
            return _Value(np.power(np.asarray(left.values, dtype=float), right.values), (a * power, b * power))
    if left.unit != right.unit:
        raise FormulaError(f"adds or subtracts {left.kind} and {right.kind}")
    return _Value(left.values + right.values if isinstance(operator, ast.Add) else left.values - right.values, (a, b))


def _called(name: str, parts: list[_Value]) -> _Value:
    needed = 2 if name in ("min", "max") else 1
    if len(parts) != needed:
        raise FormulaError(f"{name} takes {needed} value{'s' * (needed > 1)}")
    first, *others = (part.unit for part in parts)
    if any(other != first for other in others):
        raise FormulaError(f"{name} is of {parts[0].kind} and {parts[1].kind}")
    if name == "sqrt":
        first = first[0] / 2, first[1] / 2
    elif name not in _OF_ONE_UNIT and first != _NUMBER:
        raise FormulaError(f"{name} is of {parts[0].kind}: must be of a number, such as z/(20 mm)")
    return _Value(_FUNCTIONS[name](*(part.values for part in parts)), first)


def _is_even(node: ast.AST, name: str) -> bool:
    """Return whether a coordinate occurs in even powers and in abs alone: what is even otherwise is not recognised."""
    match node:
        case ast.Name(id=found):
            return found != name
        case ast.BinOp(left=ast.Name(), op=ast.Pow(), right=ast.Constant(value=int() | float() as power)):
            return power % 2 == 0 or _is_even(node.left, name)
        case ast.Call(func=ast.Name(id="abs"), args=[ast.Name()]):
            return True
    return all(_is_even(part, name) for part in ast.iter_child_nodes(node))


def _is_round(node: ast.AST) -> bool:
    match node:
        case ast.Name(id="x" | "y"):
            return False
        case ast.BinOp(op=ast.Add(), left=left, right=right) if {_squared(left), _squared(right)} == {"x", "y"}:
            return True
    return all(map(_is_round, ast.iter_child_nodes(node)))


def _squared(node: ast.AST) -> str:
    """Return the name whose square a node is, "" if it is none."""
    match node:
        case ast.BinOp(left=ast.Name(id=name), op=ast.Pow(), right=ast.Constant(value=2 | 2.0)):
            return name
        case ast.BinOp(left=ast.Name(id=name), op=ast.Mult(), right=ast.Name(id=other)) if name == other:
            return name
    return ""


def _depth(tree: ast.AST) -> int:
    return 1 + max((_depth(part) for part in ast.iter_child_nodes(tree)), default=0)
