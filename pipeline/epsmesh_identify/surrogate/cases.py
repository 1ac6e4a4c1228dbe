"""Cases of a surrogate: the study of a block of points and depths, and the logarithms of its forces."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.plan.plan import make_plan
from epsmesh.states import OK
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.problems import Problem, StudyError
from epsmesh.study.sweep import Study
from epsmesh_identify.sections.parameters import DEPTH, Parameter
from epsmesh_identify.surrogate.depths import Depths
from epsmesh_identify.surrogate.derived import FORCE, IN_SPACE, ON_MERIDIAN, Output, derive, has_mesh, in_order, path_of
from epsmesh_identify.surrogate.moduli import Bounds, Reference, ranges_of, reference_of
from epsmesh_identify.surrogate.ranges import Range, trend_of
from epsmesh_identify.surrogate.sparse import Block, points_of

if TYPE_CHECKING:
    import xarray as xr
    from mpi4py import MPI

Solve = Callable[[Study], "xr.Dataset"]
"""What returns the dataset of a study: it runs it, or reads it from a store."""


class SurrogateError(Exception):
    """A surrogate cannot be made: a case that it needs has no force."""


@dataclass(frozen=True)
class Domain:
    """What a surrogate spans: a scene, ranges of its parameters, and depths from the ``shallowest`` to the ``deepest``.

    Depths (m) begin near 0 without a shallowest. Meshes have an ``accuracy``; None for that of the scene's own mesh.
    Forces are divided by the depth to the power of ``exponent``; ``is_proportional`` tells that nothing else is left of
    the depth.
    """

    scene: Study
    ranges: tuple[Range, ...]
    reference: Reference
    deepest: float
    accuracy: float | None = None
    shallowest: float | None = None
    output: Output = FORCE
    exponent: float = 1.0
    is_proportional: bool = False
    is_on_meridian: bool = False

    def study(self, values: Sequence[FloatArray], depths: FloatArray) -> Study:
        """Return the study of the product of values of all ranges, ratios among them, and depths (m).

        Raises:
            StudyError: if it cannot be run.
        """
        lists: dict[Parameter, Sequence[float]] = {self.reference.parameter: [self.reference.young]}
        for one, own in zip(self.ranges, values, strict=True):
            lists[one.parameter] = (own * (self.reference.young if one.is_ratio else 1.0)).tolist()
        return derive(self.scene, lists | {DEPTH: depths.tolist()}, self.accuracy, self.output)

    @property
    def middle(self) -> Block:
        """The middle of every range, in [-1, 1]."""
        return tuple(np.zeros(1) for _ in self.ranges)

    @property
    def order(self) -> list[Parameter]:
        """The parameters of its studies, in the order of its ranges; the depth is the last."""
        return [self.reference.parameter, *(one.parameter for one in self.ranges), DEPTH]


def domain_of(
    scene: Study, bounds: Bounds, deepest: float, shallowest: float | None = None, output: Output = FORCE
) -> Domain:
    """Return the domain of a surrogate between bounds of parameters, and down to a depth (m).

    With a ``shallowest`` depth (m), which may be the same, it begins there.

    Raises:
        StudyError: if the study cannot be run, or its forces are not proportional to its moduli.
    """
    reference = reference_of(scene, bounds)
    _check_swept(scene, reference)
    found = Domain(scene, ranges_of(scene, bounds, reference), reference, deepest, shallowest=shallowest, output=output)
    found = found if has_mesh(scene) else replace(found, accuracy=ON_MERIDIAN)
    study = found.study([one.value(np.zeros(1)) for one in found.ranges], np.array([deepest]))
    case = study.case((0,) * len(study.axes))
    if reason := obstacle("scaling", replace(case, outputs=())):  # they are of fields, which are proportional, too
        raise StudyError(scene.file, [Problem("load", None, f"forces must be proportional to young: {reason}")])
    if all(solve.axisymmetric for solve in make_plan(study).solves):
        found = replace(found, is_on_meridian=True)
    elif found.accuracy is not None:
        found = replace(found, accuracy=IN_SPACE)
    if output != FORCE:
        return replace(found, exponent=0.0)
    exponent = (case.probe.force_exponent if case.way.is_found else None) or 1.0
    return replace(found, exponent=exponent, is_proportional=case.moves_in_proportion == ("depth",))


def _check_swept(scene: Study, reference: Reference) -> None:
    """Raise an exception if the modulus of reference is a list: it is known, and its first value is no other."""
    path = path_of(reference.parameter)
    for axis in scene.axes:
        if reference.is_known and axis.path == path:
            allowed = f"is a list of {len(axis)}: one value is needed, or a range of `{reference.name}`"
            raise StudyError(scene.file, [Problem(path, None, allowed)])


def stored_in(store: Path, comm: "MPI.Comm | None" = None) -> Solve:
    """Return what solves studies on the ranks of ``comm`` (all there are), with their cases in a store."""
    from epsmesh import workflow  # noqa: PLC0415 (MPI starts as it is imported)

    return partial(workflow.solve, comm=workflow.world() if comm is None else comm, store=store)


@dataclass
class Cases:
    """Solved cases of a domain, by a function that returns datasets; it keeps the relative error bar of each.

    An output without error bars has a bar of 0.
    """

    domain: Domain
    solve: Solve
    bars: list[float] = field(default_factory=list)

    def logs(self, block: Block, depths: Depths) -> FloatArray:
        """Return ln F (1 - ν²)/(E d^p) at the points of a block (points, depths).

        Raises:
            SurrogateError: if a case has no force.
        """
        domain, depth = self.domain, depths.values
        study = domain.study([one.value(x) for one, x in zip(domain.ranges, block, strict=True)], depth)
        dataset = self.solve(study)
        _check(dataset, study, domain.output)
        name = domain.output.name
        value = in_order(study, domain.order, dataset[name]).reshape(-1, len(depth))
        if (error := f"{name}_error") in dataset:
            bar = in_order(study, domain.order, dataset[error]).reshape(-1, len(depth))
            if np.isnan(bar).any():
                raise SurrogateError(f"{study.file}: a case has no {error}, so that the surrogate would have none")
            self.bars += (bar / value).ravel().tolist()
        else:
            self.bars += [0.0] * value.size
        unit = domain.reference.young if domain.output.is_proportional else 1.0
        return np.asarray(np.log(value / (unit * depths.power(depth))) - trend_of(domain.ranges, points_of(block)))


class Guess(Protocol):
    """What has logarithms of forces at the points of a block, as :meth:`Cases.logs` returns them."""

    def logs(self, block: Block, depths: Depths) -> FloatArray:
        """Return logarithms (points, depths)."""
        ...


@dataclass
class Difference:
    """What is left of forces after a guess that costs nothing; error bars are those of the forces."""

    cases: Cases
    guess: Guess

    @property
    def domain(self) -> Domain:
        """What both are of."""
        return self.cases.domain

    @property
    def bars(self) -> list[float]:
        """Relative error bars of the forces."""
        return self.cases.bars

    def logs(self, block: Block, depths: Depths) -> FloatArray:
        """Return the logarithm of forces over their guesses (points, depths): see :meth:`Cases.logs`."""
        return self.cases.logs(block, depths) - self.guess.logs(block, depths)


def _check(dataset: "xr.Dataset", study: Study, output: Output) -> None:
    """Raise an exception if a case has no output, or one that is not positive."""
    if output.name not in dataset:
        raise SurrogateError(f"{study.file}: these cases have no {output.name}")
    status, value = np.ravel(dataset["status"]), np.ravel(dataset[output.name])
    if (wrong := np.flatnonzero((status != OK) | ~(value > 0))).size:
        case = list(study.cases())[int(wrong[0])]
        why = str(np.ravel(dataset["message"])[wrong[0]]) or f"it is {value[wrong[0]]:.3g}, and must be positive"
        raise SurrogateError(f"{study.file}: {case}: no {output.name}: {why}; a smaller range may avoid this case")
