"""The record of a case: its force, checks, costs and origin."""

import json
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from math import isfinite, nan
from typing import Any

from pydantic import TypeAdapter

from epsmesh.plan.cost import Observation, speed_up
from epsmesh.quantities import STRESSES
from epsmesh.states import FAILURES, OK, PARTIAL
from epsmesh.study.case import Scale

# The prefix of the message of an unexpected failure.
UNFORESEEN = "an error of the program: "

# Quantities with a 95 % bar, NAME_error: relative to them, and in their unit.
RELATIVE = ("force", "energy_release", "contact_area", "contact_radius")
ABSOLUTE = ("force_vector", "stiffness", "load_force", "slip_area", "friction_force", "torque")
BARS = tuple(f"{name}_error" for name in (*RELATIVE, *ABSOLUTE))

# Quantities that are proportional to Young's modulus and to this power of the depth, with their bars in their unit.
_POWERS = {
    "force": 1, "force_reached": 1, "force_vector": 1, "stiffness": 0, "energy": 2, "energy_release": 2,
    "friction_force": 1, "torque": 1,
}  # fmt: skip
_POWERS |= {f"{name}_error": power for name, power in _POWERS.items() if name in ABSOLUTE}

# What the course of a case has by time, each with the power of the depth that it is proportional to: time (s), force
# against the advance, its error from the steps, its components (N), dissipated energy and its error (J); contact area
# (m²), if it is found.
COURSE = {"time": 0, "force": 1, "step_error": 1, "x": 1, "y": 1, "z": 1, "dissipated": 2, "dissipated_error": 2}
COURSE |= {"area": 2}


@dataclass(frozen=True)
class Record:
    """The result of one case; SI units, times in seconds, memory in bytes summed over ranks.

    - ``young`` (Pa) and ``depth`` (m): the :class:`Scale` of the case.
    - ``force_vector`` (N): the force of the tissue on the probe, with error bars ``force_vector_error`` (N, NaN if
      unknown); ``force``: its part against the probe's advance, with the relative 95 % error bar ``force_error``, whose
      computation took ``time_error`` seconds; ``friction_error``: the part of it for friction, which finer meshes keep.
    - ``depth_reached`` (m), ``force_reached`` (N): where load steps ended before the depth, and the force there; such
      a record is "partial".
    - ``stiffness``: of all six rigid motions, with the error bars ``stiffness_error``; empty without `motion = "all"`.
    - ``contact_area`` (m²), ``contact_radius`` (m): of unilateral contact, with relative error bars;
      ``slip_area`` (m²): the part that slides, of contact with friction. ``friction_force`` (N): the
      integral of the size of its tangential traction; ``torque`` (N m): that of the tissue on the probe about its
      advance. Their error bars are in the same units, NaN if unknown.
    - ``largest``: the largest values of cells away from the probe's edge, by their names in the dataset.
    - ``energy_release`` (J/m²): the mean along a slit's front, with its relative 95 % error bar.
    - ``load_force`` (N), with the error bar ``load_force_error`` (N), and ``load_force_vector`` (N): what loads add to
      the force if the probe is held. ``load_energy`` (J): their strain energy. ``sag`` (m): their displacement of a
      probe that is free along its axis.
    - ``influence``: shares of the force by region, and distances (m) within which shares are decided, with error bars,
      by their names in the dataset; empty unless the study asks for them. ``tissue_spread`` in it is the standard
      deviation of ln F by random fields of the moduli.
    - ``course``: what a case in time steps does over time: see ``COURSE``; empty for any other case.
    - ``surface_deviation`` (m): distance of the mesh from the surface in the body's file.
    - ``kind``, ``planned_cells``, ``poisson``: inputs of the cost model (:mod:`epsmesh.plan.cost`).
    - ``group``: the number of ranks that computed the case.
    - ``time_spread``: the range of repeated times relative to their median; ``load``: running and waiting processes
      per core.
    """

    key: str
    status: str  # ok | partial | failed
    message: str = ""
    origin: str = "solved"  # solved | symmetric
    young: float = nan
    depth: float = nan
    force: float = nan
    force_error: float = nan
    friction_error: float = 0.0
    force_vector: tuple[float, float, float] = (nan, nan, nan)
    force_vector_error: tuple[float, float, float] = (nan, nan, nan)
    depth_reached: float = nan
    force_reached: float = nan
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
    slip_area: float = nan
    slip_area_error: float = nan
    friction_force: float = nan
    friction_force_error: float = nan
    torque: float = nan
    torque_error: float = nan
    load_force: float = nan
    load_force_error: float = nan
    load_force_vector: tuple[float, float, float] = (nan, nan, nan)
    load_energy: float = nan
    sag: float = nan
    balance: float = nan
    influence: dict[str, tuple[float, ...]] = field(default_factory=dict)
    course: dict[str, tuple[float, ...]] = field(default_factory=dict)
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
    def has_failed(self) -> bool:
        """Whether the case was computed, without a force at its depth."""
        return self.status in FAILURES

    @property
    def is_ok(self) -> bool:
        """Whether the record has a valid force."""
        return self.status == OK and isfinite(self.force)

    @property
    def proven(self) -> float:
        """The relative error bar that an accuracy limits: of F or, over time, of the largest force with its steps."""
        if not self.course:
            return self.force_error
        return self.force_error + max(self.course["step_error"]) / max(map(abs, self.course["force"]))

    @property
    def max_strain(self) -> float:
        """Largest principal strain, by magnitude, of a cell away from the probe's edge."""
        return self.largest.get("max_strain", nan)

    @property
    def time_total(self) -> float:
        """Seconds that this case takes alone."""
        return self.time_mesh + self.time_assemble + self.time_setup + self.time_solve

    def observation(self) -> Observation | None:
        """Return the times of the case on one rank, None if they are unknown."""
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
        """Return the record of a case that differs only in its ``scale``."""
        young, depth = scale.stress, scale.length
        if (young, depth) == (self.young, self.depth) or not (isfinite(self.force) or self.status == PARTIAL):
            return self
        stiffer, deeper = young / self.young, depth / self.depth
        scaled = {name: _times(getattr(self, name), stiffer * deeper**power) for name, power in _POWERS.items()}
        largest = {name: deeper * value for name, value in self.largest.items()}
        largest |= {name: stiffer * deeper * self.largest[name] for name in STRESSES if name in largest}
        course = {
            name: values if name == "time" else _times(values, stiffer * deeper ** COURSE[name])
            for name, values in self.course.items()
        }
        return replace(self, origin="scaled", young=young, depth=depth, largest=largest, course=course, **scaled)

    def to_json(self) -> str:
        """Return the record as JSON text."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> "Record":
        """Return the record in the text of :meth:`to_json`.

        Raises:
            ValueError: if the text is no record.
        """
        record = _adapter().validate_json(text)
        if missing := {one.name for one in fields(Record)} - json.loads(text).keys():
            raise ValueError(f"missing: {', '.join(sorted(missing))}")
        return record


@cache
def _adapter() -> TypeAdapter[Record]:
    return TypeAdapter(Record)


def _times(value: Any, factor: float) -> Any:
    """Return a number, or all numbers in a tuple of them, times a factor."""
    return tuple(_times(one, factor) for one in value) if isinstance(value, tuple) else factor * value
