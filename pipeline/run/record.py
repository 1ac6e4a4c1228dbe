"""What is kept of a case: its force, its checks, what it cost, and where it was computed."""

import json
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from math import isfinite, nan
from typing import Any

from pydantic import TypeAdapter

from pipeline.plan.cost import Observation, speed_up
from pipeline.quantities import STRESSES
from pipeline.study.sweep import Scale

# How the message of a case begins that failed for a reason that the program does not know.
UNFORESEEN = "an error of the program: "

# What of a record is proportional to Young's modulus, and to which power of the depth.
_POWERS = {
    "force": 1,
    "force_vector": 1,
    "force_vector_error": 1,
    "stiffness": 0,
    "stiffness_error": 0,
    "energy": 2,
    "energy_release": 2,
}


@dataclass(frozen=True)
class Record:
    """The result of one case; SI units, times in seconds, memory in bytes summed over ranks.

    ``young`` (Pa) and ``depth`` (m) are the :class:`Scale` of the case it was computed for. ``force_vector`` is the
    force of the tissue on the probe; ``force`` its part against the probe's advance, and ``force_error`` the relative
    95 % error bar on that, on which ``time_error`` seconds were spent. ``force_vector_error`` (N) are the bars on the
    vector's components, where they are known; ``stiffness`` is that of all six rigid motions, if it was asked for, and
    ``stiffness_error`` has the bars on its entries. ``contact_area`` (m²) and ``contact_radius`` (m) are those of
    unilateral contact. ``largest`` has the largest values of cells clear of the probe's
    edge, by their names in the dataset.
    ``energy_release`` (J/m²) is the mean along a slit's front, its relative 95 % bar ``energy_release_error``.
    Loads add ``load_force`` (N), of the bar ``load_force_error`` (N), to the force while the probe is held, in all
    ``load_force_vector`` (N); ``load_energy`` (J) is their strain energy, ``sag`` (m) how far they take a probe that is
    free along its axis. ``surface_deviation`` (m) is how far the mesh is from the surface in the body's file.
    ``kind``, ``planned_cells`` and ``poisson`` are what its cost was estimated from (:mod:`pipeline.plan.cost`),
    ``group`` the ranks that computed it. What times are worth tell ``time_spread``, that
    of repeats relative to their median, and ``load``, the processes a core that ran or wanted to.
    """

    key: str
    status: str  # ok | failed
    message: str = ""
    origin: str = "solved"  # solved | symmetric
    young: float = nan
    depth: float = nan
    force: float = nan
    force_error: float = nan
    force_vector: tuple[float, float, float] = (nan, nan, nan)
    force_vector_error: tuple[float, float, float] = (nan, nan, nan)
    stiffness: tuple[tuple[float, ...], ...] = ()
    stiffness_error: tuple[tuple[float, ...], ...] = ()
    energy: float = nan
    energy_release: float = nan
    energy_release_error: float = nan
    largest: dict[str, float] = field(default_factory=dict)
    contact_area: float = nan
    contact_radius: float = nan
    contact_area_error: float = nan
    contact_radius_error: float = nan
    load_force: float = nan
    load_force_error: float = nan
    load_force_vector: tuple[float, float, float] = (nan, nan, nan)
    load_energy: float = nan
    sag: float = nan
    balance: float = nan
    surface_deviation: float = nan
    dofs: int = 0
    cells: int = 0
    iterations: int = 0
    memory: float = nan
    time_mesh: float = nan
    time_assemble: float = nan
    time_setup: float = nan
    time_solve: float = nan
    time_error: float = nan
    time_spread: float = nan
    load: float = nan
    kind: str = ""
    planned_cells: float = nan
    poisson: float = nan
    group: int = 1
    provenance: dict[str, str | int] = field(default_factory=dict)

    @property
    def is_ok(self) -> bool:
        """Whether there is a force to rely on."""
        return self.status == "ok" and isfinite(self.force)

    @property
    def max_strain(self) -> float:
        """Largest principal strain of a cell clear of the probe's edge, by magnitude."""
        return self.largest.get("max_strain", nan)

    @property
    def time_total(self) -> float:
        """Seconds that this case costs alone."""
        return self.time_mesh + self.time_assemble + self.time_setup + self.time_solve

    def observation(self) -> Observation | None:
        """Return what the case took, on one rank, or None if that is not known."""
        if not self.is_ok or not self.kind or self.origin not in ("solved", "symmetric", "axisymmetric"):
            return None
        faster = speed_up(self.group)
        solve = self.time_assemble + self.time_setup + self.time_solve
        if self.kind.startswith("meridian"):
            seconds = {"solve": self.time_mesh + solve}
        else:
            seconds = {"mesh": self.time_mesh, "solve": solve, "bar": self.time_error}
        return Observation(
            self.kind, self.planned_cells, self.poisson, {stage: faster * spent for stage, spent in seconds.items()}
        )

    def scaled(self, scale: Scale) -> "Record":
        """Return the record of a case that differs from this one's in its ``scale`` only."""
        young, depth = scale.stress, scale.length
        if (young, depth) == (self.young, self.depth) or not isfinite(self.force):
            return self
        stiffer, deeper = young / self.young, depth / self.depth
        scaled = {name: _times(getattr(self, name), stiffer * deeper**power) for name, power in _POWERS.items()}
        largest = {name: deeper * value for name, value in self.largest.items()}
        largest |= {name: stiffer * deeper * self.largest[name] for name in STRESSES if name in largest}
        return replace(self, origin="scaled", young=young, depth=depth, largest=largest, **scaled)

    def to_json(self) -> str:
        """Write as JSON text."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> "Record":
        """Read what :meth:`to_json` wrote.

        Raises:
            ValueError: if it is no record.
        """
        record = _adapter().validate_json(text)
        if missing := {one.name for one in fields(Record)} - json.loads(text).keys():
            raise ValueError(f"it lacks {', '.join(sorted(missing))}")
        return record


@cache
def _adapter() -> TypeAdapter[Record]:
    return TypeAdapter(Record)


def _times(value: Any, factor: float) -> Any:
    """Return a number, or all numbers in a tuple of them, times a factor."""
    return tuple(_times(one, factor) for one in value) if isinstance(value, tuple) else factor * value
