"""Full solves: one touch of a tool on a study's body, with the error bar of its force."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees, isfinite, nan
from typing import Any

from epsmesh.arrays import FloatArray, np
from epsmesh.plan.cost import CostModel
from epsmesh.plan.plan import Plan, make_plan
from epsmesh.shapes.tissue import KEYS_OF_LAWS
from epsmesh.study.read import parse
from epsmesh_realtime.export.kept import NONE, Kept


@dataclass(frozen=True)
class Tool:
    """A tool of a study: its name, sizes (m; ``angle`` in rad) and, for a blade, the direction of its edge."""

    name: str
    radius: float = 0.0
    angle: float = 0.0
    length: float = 0.0
    width: float = 0.0
    along: tuple[float, float, float] = (1.0, 0.0, 0.0)
    contact: str = "frictionless"
    motion: str = "press"
    axis: tuple[float, float, float] | None = None

    @property
    def sizes(self) -> dict[str, Any]:
        """The arguments of a query for this tool."""
        if self.name == "blade":
            return {"length": self.length, "width": self.width, "along": self.along}
        sizes: dict[str, Any] = {"radius": self.radius, "contact": self.contact}
        return sizes | ({"angle": self.angle} if self.name == "cone" else {})

    @property
    def section(self) -> dict[str, Any]:
        """The keys of a study's section ``probe`` for this tool."""
        found: dict[str, Any] = {"shape": self.name, "contact": self.contact, "motion": self.motion}
        found |= {"axis": list(self.axis)} if self.axis else {}
        if self.name == "blade":
            return found | {"length": _mm(self.length), "width": _mm(self.width), "direction": list(self.along)}
        found["radius"] = _mm(self.radius)
        return found | ({"angle": f"{degrees(self.angle):.12g} deg"} if self.name == "cone" else {})


@dataclass(frozen=True)
class Full:
    """The result of a full solve: F (N) along the axis, its relative error bar, the force on the tool (3,), in N.

    ``radius`` (m) is that of the contact, NaN if it is prescribed. ``stiffness`` (6, 6) is that of all rigid motions,
    if the tool has them.
    """

    force: float
    error: float
    vector: FloatArray
    radius: float = nan
    stiffness: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def numbers(self) -> FloatArray:
        """All of it as one array."""
        return np.array([self.force, self.error, self.radius, *self.vector, *np.ravel(self.stiffness)])

    @staticmethod
    def of(numbers: FloatArray) -> "Full":
        """Return the result with these :attr:`numbers`."""
        force, error, radius, *rest = numbers.tolist()
        stiffness = np.array(rest[3:]).reshape(6, 6) if len(rest) > 3 else np.zeros((0, 0))
        return Full(force, error, np.array(rest[:3]), radius, stiffness)


@dataclass(frozen=True)
class Solver:
    """Full solves on the body of a study with these ``sections``, to a relative ``accuracy``.

    ``law`` are the keys of the law of large displacements, none for linear elasticity. What is solved is ``kept``.
    ``cost`` estimates times.
    """

    sections: Mapping[str, Any]
    file: str
    young: float
    accuracy: float
    law: Mapping[str, Any] = field(default_factory=dict)
    kept: Kept = field(default=NONE, repr=False, compare=False)
    cost: CostModel = field(default_factory=CostModel, repr=False, compare=False)

    def press(self, tool: Tool, at: tuple[float, ...], depth: float, poisson: float | None) -> Full:
        """Return the force of a tool at x and y, or x, y and z (m), at a ``depth`` (m).

        Without ``poisson`` the study's own materials apply, else the tissue at the face has that ratio.

        Raises:
            RuntimeError: if the solve failed.
        """
        (found,) = self.press_all(tool, at, [depth], None if poisson is None else [poisson])
        return found

    def press_all(
        self, tool: Tool, at: tuple[float, ...], depths: Sequence[float], poissons: Sequence[float] | None = None
    ) -> list[Full]:
        """Return the forces for all of ``poissons``, and for each at all ``depths`` (m), on a mesh for the accuracy.

        Raises:
            RuntimeError: if a solve failed.
        """
        work = (self, tool, tuple(at), tuple(depths), poissons and tuple(poissons))
        if (found := self.kept.get(work)) is None:
            fulls = _solved(
                self._plan(tool, at, depths, poissons), f"a full solve of a {tool.name} at {[_mm(x) for x in at]}"
            )
            self.kept.put(work, np.array([full.numbers for full in fulls]))
            return fulls
        return [Full.of(numbers) for numbers in found]

    def cost_of(
        self, tool: Tool, at: tuple[float, ...], depths: Sequence[float], poissons: Sequence[float] | None = None
    ) -> tuple[int, float]:
        """Return about how many solves :meth:`press_all` needs, and how long they take (s)."""
        plan = self._plan(tool, at, depths, poissons)
        return len(plan.solves), sum(self.cost.step(step).seconds for step in plan.meshes)

    def _plan(
        self, tool: Tool, at: tuple[float, ...], depths: Sequence[float], poissons: Sequence[float] | None
    ) -> Plan:
        left_out = ("relaxation",) if self.law else ("relaxation", *KEYS_OF_LAWS)
        own = {name: _without(left_out, value) for name, value in self.sections.items() if name in ("body", "material")}
        if poissons is not None:
            own["material"] = {"young": f"{self.young:.12g} Pa", "poisson": list(poissons), **self.law}
        place: dict[str, Any] = {"at": [_mm(x) for x in at], "depth": [_mm(depth) for depth in depths]}
        mesh = {"accuracy": f"{100 * self.accuracy:.6g} %"}
        raw = own | {"probe": tool.section | place, "mesh": mesh, "solve": {"exact": False}}
        return make_plan(parse(raw, file=self.file))


def _solved(plan: Plan, what: str) -> list[Full]:
    from mpi4py import MPI  # noqa: PLC0415 (`epsmesh plan` asks for times alone)

    from epsmesh.run.execute import compute  # noqa: PLC0415

    records = compute(plan, MPI.COMM_SELF)
    found = [records[key] for key in plan.keys]
    for record in found:
        if not record.is_ok or not isfinite(record.force_error):
            raise RuntimeError(f"{what} failed: {record.message}")
    return [
        Full(
            record.force,
            record.force_error,
            np.array(record.force_vector),
            record.contact_radius,
            np.array(record.stiffness),
        )
        for record in found
    ]


def _without(keys: Sequence[str], section: Any) -> Any:
    """Return a part of a study without these keys: its tissue as it is at once, or at small strain."""
    if isinstance(section, Mapping):
        return {name: _without(keys, value) for name, value in section.items() if name not in keys}
    return [_without(keys, value) for value in section] if isinstance(section, list) else section


def _mm(length: float) -> str:
    return f"{1e3 * length:.12g} mm"
