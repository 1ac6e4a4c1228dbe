"""The force of a measurement's scene as a function of depth and unknowns: which model it is computed with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.study.sweep import Study
from epsmesh_identify.estimation.parts import Unknown, Values
from epsmesh_identify.surrogate.build import surrogate
from epsmesh_identify.surrogate.cases import Domain, Solve, SurrogateError, domain_of, stored_in
from epsmesh_identify.surrogate.derived import parameters
from epsmesh_identify.surrogate.near import Correction, correction, needs_correction, smaller
from epsmesh_identify.surrogate.ranges import Range
from epsmesh_identify.surrogate.table import Table

__all__ = ["forward_of", "stored_in"]


@dataclass(frozen=True)
class SceneForce:
    """The force of a scene over the ranges of the unknowns, by a table, and more exactly near a fit."""

    domain: Domain
    solve: Solve
    table: Table
    near: Correction | None = None
    _made: dict[tuple[Range, ...], Correction | None] = field(default_factory=dict, compare=False, repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """What the force depends on."""
        return self.table.names

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the force (N) at depths (m), see :meth:`Table.force`."""
        force = self.table.force(depth, values)
        if self.near is None:
            return force
        return np.asarray(force * self.near.factor(depth, self.table.reduced(values, values)))

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the relative error of the force: near the fit, that of the correction; see :meth:`Table.error`."""
        near, table = self.near, self.table
        if near is not None and near.spans(table.reduced(values, values)):
            table = replace(table, interpolation=near.interpolation, mesh=near.mesh)
        return table.error(depth, values)

    def ranges(self, low: Values, high: Values) -> tuple[Range, ...]:
        """Return the ranges over which the force is to be corrected for a fit with bars from ``low`` to ``high``.

        There are none if the table is exact enough.
        """
        return smaller(self.table, low, high) if needs_correction(self.domain, self.table) else ()

    def corrected(self, ranges: tuple[Range, ...]) -> "SceneForce":
        """Return the force with a correction over such ranges, without one if it needs cases that have no force.

        Collective where cases are solved; what was made before is known.
        """
        if ranges not in self._made:
            try:
                self._made[ranges] = correction(self.domain, self.solve, self.table, ranges) if ranges else None
            except SurrogateError:
                self._made[ranges] = None
        return replace(self, near=self._made[ranges])


@dataclass(frozen=True)
class OwnForce:
    """The force of a scene some of whose unknowns are of this scene alone: ``own`` has their names by those of keys."""

    scene: SceneForce
    own: Mapping[str, str]

    @property
    def names(self) -> tuple[str, ...]:
        """What the force depends on."""
        return tuple(self.own.get(name, name) for name in self.scene.names)

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the force (N) at depths (m)."""
        return self.scene.force(depth, self._named(values))

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the relative error of the force."""
        return self.scene.error(depth, self._named(values))

    def ranges(self, low: Values, high: Values) -> tuple[Range, ...]:
        """Return the ranges over which the force is to be corrected: see :meth:`SceneForce.ranges`."""
        return self.scene.ranges(self._named(low), self._named(high))

    def corrected(self, ranges: tuple[Range, ...]) -> "OwnForce":
        """Return the force with a correction over such ranges: see :meth:`SceneForce.corrected`."""
        return replace(self, scene=self.scene.corrected(ranges))

    def _named(self, values: Values) -> Values:
        return {**values, **{name: values[own] for name, own in self.own.items()}}


def forward_of(scene: Study, unknowns: Sequence[Unknown], deepest: float, solve: Solve) -> SceneForce:
    """Return the force of a scene down to a depth (m), over the ranges of those unknowns that are keys of its study.

    Raises:
        StudyError: if the study cannot be run, or is not one scene.
        SurrogateError: if a case that it needs has no force.
    """
    domain = unknown_domain(scene, unknowns, deepest)
    return SceneForce(domain, solve, surrogate(domain, solve))


def unknown_domain(scene: Study, unknowns: Sequence[Unknown], deepest: float) -> Domain:
    """Return the domain of the surrogate of a scene: see :func:`forward_of`."""
    of_scene = parameters(scene)
    bounds = {unknown.name: (unknown.low, unknown.high) for unknown in unknowns if unknown.name in of_scene}
    return domain_of(scene, bounds, deepest)
