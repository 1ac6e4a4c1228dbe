"""Compile all forms of a run's solves in advance, on one rank."""

from collections.abc import Collection
from dataclasses import dataclass

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
from epsmesh.solve.meridian.problem import compile_axisymmetric
from epsmesh.solve.meridian.punch import TRIAL_DEGREE
from epsmesh.stages import stage


@dataclass(frozen=True, order=True)
class _Forms:
    """Identifies the forms of a solve."""

    element: str
    degree: int = 0
    laws: tuple[str, ...] = ("linear",)
    of_regions: bool = False
    of_slit: bool = False
    of_contact: bool = False
    of_steps: bool = False


# The forms of a Green's function, which do not depend on a case's elements.
_REGULAR = _Forms("regular")
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
        needed |= {_REGULAR for solve in solves if solve.case.has_own_far_field}
        if missing := needed - _compiled:
            try:
                with compiling():
                    native.library()
                    for forms in sorted(missing):
                        _compile(forms)
                _compiled.update(missing)
            except CompilerError as error:
                message = str(error)
    if message := comm.bcast(message):
        raise CompilerError(message)


def _forms(solve: Solve) -> _Forms:
    body, mesh = solve.case.body, solve.case.mesh
    if solve.axisymmetric:
        half_plane = body.half_plane()
        kind = "elliptic" if half_plane and half_plane.is_curved else "axisymmetric"
        if solve.case.material.is_large or solve.case.is_stepped:
            degree = DEGREE_OF_STEPS if solve.case.probe.friction else LARGE_DEGREE
            laws = tuple(sorted({str(tissue.law or "linear") for tissue in solve.case.tissues}))
            return _Forms(kind, degree, laws, of_steps=solve.case.is_stepped)
        lowest = DEGREE_OF_STEPS - 1 if solve.case.probe.friction else TRIAL_DEGREE
        return _Forms(kind, lowest if solve.case.probe.is_unilateral else 0)
    has_slit = solve.case.probe.slit is not None
    return _Forms(
        solve.case.formulation,
        mesh.degree,
        of_regions=bool(body.regions) or solve.case.is_linear_beyond,
        of_slit=has_slit,
        of_contact=solve.case.probe.is_unilateral and solve.case.material.is_large,
        of_steps=solve.case.is_stepped,
    )


def _compile(forms: _Forms) -> None:
    element, degree, of_regions = forms.element, forms.degree, forms.of_regions
    if element in ("axisymmetric", "elliptic"):
        curved = element == "elliptic"
        if forms.of_steps or forms.laws != ("linear",):
            compile_axisymmetric(degree, curved=curved, laws=forms.laws, relaxes=forms.of_steps)
            return
        compile_axisymmetric(curved=curved, lowest=degree)
        return
    if forms == _REGULAR:
        compile_regular()
        return
    laws = ("linear",) if element in ("displacement", "mixed") else element.removesuffix("-mixed").split("+")
    element = "mixed" if element.endswith("mixed") else "displacement"
    compile_forms(
        degree,
        element,
        laws,
        straight=degree == 1,
        of_regions=of_regions,
        of_contact=forms.of_contact,
        of_steps=forms.of_steps,
    )
    compile_cell_values(degree, straight=degree == 1)
    if forms.of_slit:
        compile_release(degree, mixed=element == "mixed", of_regions=of_regions)
