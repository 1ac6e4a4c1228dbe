"""Compile all forms of a run's solves in advance, on one rank."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Protocol

from mpi4py import MPI

from epsmesh.plan.steps import Solve
from epsmesh.solve import CompilerError
from epsmesh.solve.cell_values import compile_cell_values
from epsmesh.solve.compiled import compiling
from epsmesh.solve.crack import compile_release
from epsmesh.solve.forms import compile_forms
from epsmesh.solve.greens_function import compile_regular
from epsmesh.solve.kernels import native
from epsmesh.solve.meridian.large import DEGREE as LARGE_DEGREE
from epsmesh.solve.meridian.large_contact import DEGREE_OF_STEPS
from epsmesh.solve.meridian.problem import DEGREE, compile_axisymmetric, how_for
from epsmesh.solve.meridian.punch import TRIAL_DEGREE
from epsmesh.stages import stage
from epsmesh.study.way import LINEAR, Constraint, Motion


class _Forms(Protocol):
    """A set of forms, equal to another of the same forms."""

    def compile(self) -> None: ...


@dataclass(frozen=True)
class _Body:
    """Forms of a body in three dimensions."""

    degree: int
    element: str
    laws: tuple[str, ...]
    of_regions: bool
    varies: bool
    is_nonlinear: bool
    of_contact: bool
    of_steps: bool
    of_slit: bool
    of_influence: bool

    def compile(self) -> None:
        straight = self.degree == 1
        forms = {name: value for name, value in vars(self).items() if name != "of_slit"}
        compile_forms(**forms, straight=straight)
        compile_cell_values(self.degree, straight=straight)
        if self.of_slit:
            compile_release(self.degree, mixed=self.element == "mixed", of_regions=self.of_regions)


@dataclass(frozen=True)
class _Meridian:
    """Forms of a half plane; those of degrees from the ``lowest`` on, if that is given."""

    curved: bool
    degree: int = DEGREE
    lowest: int = 0
    laws: tuple[str, ...] = LINEAR
    relaxes: bool = False
    varies: bool = False

    def compile(self) -> None:
        compile_axisymmetric(**vars(self))


@dataclass(frozen=True)
class _FarField:
    """Forms of a Green's function, which do not depend on a case's elements."""

    def compile(self) -> None:
        compile_regular()


# The lowest degree of a contact's trials on the meridian.
_LOWEST = {Constraint.FOUND: TRIAL_DEGREE, Constraint.FRICTION: DEGREE_OF_STEPS - 1}
# The forms that this process has compiled.
_compiled: set[_Forms] = set()


@stage("compiler")
def prepare(comm: MPI.Comm, solves: Collection[Solve]) -> None:
    """Compile the forms of ``solves`` that the cache does not have; collective.

    Raises:
        CompilerError: on every rank, if no C compiler works here.
    """
    message = None
    if comm.rank == 0:
        needed = {_forms(solve) for solve in solves}
        needed |= {_FarField() for solve in solves if solve.case.has_own_far_field}
        if missing := needed - _compiled:
            try:
                with compiling():
                    native.library()
                    for forms in sorted(missing, key=repr):
                        forms.compile()
                _compiled.update(missing)
            except CompilerError as error:
                message = str(error)
    if message := comm.bcast(message):
        raise CompilerError(message)


def _forms(solve: Solve) -> _Forms:
    body, case, way = solve.case.body, solve.case, solve.way
    if not solve.axisymmetric:
        return _Body(
            case.mesh.degree,
            way.element,
            way.laws,
            of_regions=bool(body.regions) or case.is_linear_beyond,
            varies=case.varies,
            is_nonlinear=way.is_nonlinear,
            of_contact=way.is_found,
            of_steps=way.in_time,
            of_slit=way.motion is Motion.SLIT,
            of_influence=case.solve.influence,
        )
    half_plane = body.half_plane()
    curved = bool(half_plane and half_plane.is_curved)
    if way.is_large or way.in_time:
        degree = DEGREE_OF_STEPS if way.rubs else LARGE_DEGREE
        return _Meridian(curved, degree, laws=way.laws, relaxes=way.in_time, varies=case.varies)
    degree = how_for(solve.goal).get("degree", DEGREE)
    return _Meridian(curved, degree, lowest=_LOWEST.get(way.constraint, 0), varies=case.varies)
