"""What the program was compared with: published experiments, benchmarks of other programs, closed forms.

The table is ``validation.toml``. ``python -m benchmarks.experiments`` solves its scenes again, and makes
``benchmarks/results/experiments.md`` of it.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal

_TABLE = Path(__file__).with_suffix(".toml")


@dataclass(frozen=True)
class Scene:
    """In what scenes are like one another: tool, law and contact, named as in a study, ν, and three ratios.

    The tool "plate" covers the whole face, and is none of a study. ``depth`` is over the radius of contact. ``size`` is
    the radius of contact over thickness or radius of the body, whichever is smaller; 0 is a half-space. ``strain`` is
    depth over height under a plate, else a fifth of ``depth``.
    """

    tool: str
    law: str
    contact: Literal["bonded", "frictionless", "friction"]
    poisson: float
    depth: float
    size: float
    strain: float


@dataclass(frozen=True)
class Comparison:
    """One number of the program beside that of a source; ``compared`` says what it is, with its unit.

    Bars are of 95 %. ``mesh_bar`` is the part of ``ours_bar`` that is of mesh and solver. ``calibrated`` says which
    parameter was measured, and on what; ``given`` has it, its bar, and forces between which depths are compared (SI).
    """

    name: str
    kind: Literal["experiment", "benchmark", "theory"]
    source: str
    scene: Scene
    compared: str
    ours: float
    ours_bar: float
    mesh_bar: float
    reference: float
    reference_bar: float
    given: Mapping[str, float] = field(default_factory=dict)
    calibrated: str = ""
    note: str = ""

    @property
    def difference(self) -> float:
        """Ours less the reference, over the reference."""
        return self.ours / self.reference - 1

    @property
    def agrees(self) -> bool:
        """Whether the numbers differ by at most the sum of their bars."""
        return abs(self.ours - self.reference) <= self.ours_bar + self.reference_bar


@dataclass(frozen=True)
class Unchecked:
    """A published experiment that was not compared, and why."""

    name: str
    source: str
    reason: str


@cache
def comparisons() -> tuple[Comparison, ...]:
    """Return all comparisons: of other programs, of measurements, of theory."""
    table = _read()
    return tuple(_comparison(dict(row), table["sources"]) for row in table["comparison"])


@cache
def unchecked() -> tuple[Unchecked, ...]:
    """Return the experiments that were not compared."""
    return tuple(Unchecked(**row) for row in _read()["unchecked"])


def _comparison(row: dict[str, Any], sources: Mapping[str, str]) -> Comparison:
    ours, ours_bar, mesh_bar = row.pop("ours")
    reference, reference_bar = row.pop("reference")
    row |= {"source": sources[row["source"]], "scene": Scene(**row["scene"])}
    return Comparison(
        **row, ours=ours, ours_bar=ours_bar, mesh_bar=mesh_bar, reference=reference, reference_bar=reference_bar
    )


def _read() -> dict[str, Any]:
    return tomllib.loads(_TABLE.read_text(encoding="utf-8"))
