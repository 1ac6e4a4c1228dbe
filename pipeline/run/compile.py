"""Compile every form that solves need, once, before any rank waits for one."""

from collections.abc import Collection

from dolfinx import fem
from mpi4py import MPI

from pipeline import compat
from pipeline.mesh.distribute import distribute
from pipeline.plan.steps import Solve
from pipeline.solve.axisymmetric import compile_axisymmetric
from pipeline.solve.forms import compile_elastic, compiling, one_cell
from pipeline.solve.mixed_forms import mixed_forms
from pipeline.stages import stage


@stage("compiler")
def prepare(comm: MPI.Comm, solves: Collection[Solve]) -> None:
    """Compile what ``solves`` need and the cache does not have; collective."""
    if comm.rank == 0:
        meshed = [solve.case for solve in solves if not solve.axisymmetric]
        with compiling():
            for degree, element in sorted({(case.mesh.degree, case.element) for case in meshed}):
                compile_elastic(degree, straight=degree == 1)
                if element == "mixed":
                    _compile_mixed(degree)
            if len(meshed) < len(solves):
                compile_axisymmetric()
    comm.barrier()


def _compile_mixed(degree: int) -> None:
    """Compile what couples displacement and pressure, of ``degree`` and of one more for the error bar."""
    mesh = distribute(MPI.COMM_SELF, one_cell(straight=False)).mesh
    for level in (degree, degree + 1):
        mixed_forms(fem.Function(compat.vector_space(mesh, level)), compat.scalar_space(mesh, level - 1))
