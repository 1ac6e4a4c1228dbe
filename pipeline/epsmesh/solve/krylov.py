"""Factory of PETSc's linear solvers, their errors, and the choice between factorisation and iteration.

A KSP is a Cholesky or LDLᵀ factorisation by MUMPS, or an iteration. Every KSP and PC has its own options prefix.
"""

import itertools
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

from petsc4py import PETSc

from epsmesh.solve import SolveError

# Number of dofs up to which Cholesky is faster than conjugate gradients, measured: benchmarks/results/solvers.md.
# Degree 4 is that of error bars.
DIRECT_LIMIT = {1: 5_000, 2: 1_500, 3: 1_500, 4: 1_500}

_CG = {"ksp_type": "cg", "ksp_atol": 0.0, "ksp_initial_guess_nonzero": True}
_FACTORS = {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}
_GCR = {"ksp_type": "gcr", "ksp_max_it": 300, "ksp_initial_guess_nonzero": True}
_TANGENT = {"ksp_norm_type": "natural", "ksp_rtol": 1e-4, "ksp_max_it": 400}
_OF_SADDLE = {"ksp_rtol": 1e-4, "ksp_converged_use_initial_residual_norm": "", "ksp_gcr_restart": 60}
# PETSc options by the system solved. Iterations use the vector passed as initial guess, except where noted.
SOLVERS: dict[str, dict[str, Any]] = {
    "factors": _FACTORS,
    "elasticity": _CG | {"ksp_norm_type": "natural", "ksp_max_it": 500},
    # No norm: it would cost one more application of the preconditioner.
    "energy decrements": _CG | {"ksp_norm_type": "none", "ksp_max_it": 60},
    "tangent": _CG | _TANGENT,
    "tangent, mixed": _GCR | _OF_SADDLE,
    "eigenvalues": {"ksp_type": "cg", "ksp_norm_type": "natural", "ksp_rtol": 1e-12, "ksp_max_it": 30},
    "mass": {
        "ksp_type": "chebyshev",
        "ksp_norm_type": "none",
        "ksp_chebyshev_esteig_steps": 10,
        "pc_type": "jacobi",
    },
    # Symmetric: Gauss–Seidel down, backwards up. At most three interpolation entries a row keep coarse levels sparse.
    "degree 1": {
        "pc_type": "hypre",
        "pc_hypre_type": "boomeramg",
        "pc_hypre_boomeramg_coarsen_type": "HMIS",
        "pc_hypre_boomeramg_interp_type": "ext+i",
        "pc_hypre_boomeramg_strong_threshold": 0.5,
        "pc_hypre_boomeramg_P_max": 3,
        "pc_hypre_boomeramg_no_CF": "",
        "pc_hypre_boomeramg_relax_type_down": "SOR/Jacobi",
        "pc_hypre_boomeramg_relax_type_up": "backward-SOR/Jacobi",
    },
}
# Where PETSc has no hypre, as in the wheels: smoothed aggregation of all neighbours, with rigid-body modes. Without
# these a thin stiff layer does not converge (benchmarks/results/solvers.md). Jacobi is the same on any number of ranks.
_WITHOUT_HYPRE = {
    "pc_type": "gamg",
    "pc_gamg_threshold": 0.0,
    "pc_gamg_esteig_ksp_max_it": 20,
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 2,
    "mg_levels_pc_type": "jacobi",
}
# On several ranks a sweep uses old values of other ranks. Where the material jumps this amplifies errors, and the
# preconditioner becomes indefinite. Adding the magnitudes of off-rank entries to the diagonal prevents it
# (A. H. Baker, R. D. Falgout, T. V. Kolev and U. M. Yang, SIAM J. Sci. Comput. 33, 2864, 2011).
_ON_RANKS = {
    "pc_hypre_boomeramg_relax_type_down": "l1-Gauss-Seidel",
    "pc_hypre_boomeramg_relax_type_up": "backward-l1-Gauss-Seidel",
}

# Percentages by which MUMPS enlarges its predicted work space, one after the other until it is enough: the fill-in of
# an indefinite matrix exceeds the prediction. INFOG(1) tells that it was too small.
WORK_SPACE = (20, 100, 400, 1600)
_ENLARGE, _RESULT, _TOO_SMALL = 14, 1, (-8, -9)

_prefixes = itertools.count()
INDEFINITE = PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC
# Residual, in units of the right side, of a linear solve that is good enough for a step of Newton's method.
_NEARLY = 0.1


@contextmanager
def explained() -> Iterator[None]:
    """Translate errors of PETSc and of the multigrid cycle into errors for the reader of a record.

    Raises:
        SolveError: instead of them.
    """
    try:
        yield
    except PETSc.Error as error:
        raise SolveError(explain(error)) from error
    except ArithmeticError as error:
        raise SolveError(str(error)) from error


def explain(error: PETSc.Error) -> str:
    """Return the meaning of a PETSc error, for the reader of a record."""
    return {
        55: "out of memory",
        76: "the factorisation failed (out of memory, or the operator is singular)",
    }.get(error.ierr, f"PETSc error {error.ierr}")


def has_converged(ksp: PETSc.KSP) -> bool:
    """Return whether the last solve converged.

    At the largest number of iterations PETSc's GCR reports KSP_CONVERGED_ITS, whatever the residual is. That reason is
    one of success of solvers without a test alone, such as a factorisation.
    """
    reason = ksp.getConvergedReason()
    is_ended = ksp.getType() == PETSc.KSP.Type.GCR and reason == PETSc.KSP.ConvergedReason.CONVERGED_ITS
    return bool(reason > 0 and not is_ended)


def is_nearly_converged(ksp: PETSc.KSP) -> bool:
    """Return whether GCR ended at its largest number of iterations with a residual that is good for a Newton step."""
    is_ended = ksp.getType() == PETSc.KSP.Type.GCR and not has_converged(ksp)
    return bool(is_ended and ksp.getResidualNorm() <= _NEARLY * ksp.getRhs().norm())


def check_converged(ksp: PETSc.KSP) -> int:
    """Return the iterations of the last solve.

    Raises:
        SolveError: if it did not converge.
    """
    if not has_converged(ksp):
        reason = ksp.getConvergedReason()
        names = {v: k for k, v in vars(PETSc.KSP.ConvergedReason).items() if isinstance(v, int)}
        name = names.get(reason, str(reason)).lower() if reason <= 0 else "diverged_max_it"
        raise SolveError(f"the linear solver did not converge: {name} after {ksp.its} iterations")
    return int(ksp.its)


def is_truncated(ksp: PETSc.KSP, found: PETSc.Vec) -> bool:
    """Return whether conjugate gradients ended at a direction of negative curvature, with a step ``found`` before.

    Such a step reduces the energy (R. S. Dembo and T. Steihaug, Math. Program. 26, 190, 1983).
    """
    is_indefinite = ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_MAT
    return bool(is_indefinite and found.norm() > 0)


def configure(solver: PETSc.KSP | PETSc.PC | PETSc.SNES, options: Mapping[str, Any], *, set_up: bool = False) -> None:
    """Set PETSc ``options`` of a solver under a prefix of its own, and remove them again; collective.

    With ``set_up`` it is set up between: the levels of a multigrid read their options only when they are made.
    """
    held, prefix = PETSc.Options(), f"epsmesh{next(_prefixes)}_"
    try:
        solver.setOptionsPrefix(prefix)
        for name, value in options.items():
            held[prefix + name] = value
        solver.setFromOptions()
        if set_up:
            solver.setUp()
    finally:
        for name in options:
            held.delValue(prefix + name)


def solver_of(kind: str, matrix: PETSc.Mat, stack: ExitStack, preconditioner: Any = None, **options: Any) -> PETSc.KSP:
    """Return a KSP of a ``kind`` in ``SOLVERS``, not set up, freed with the ``stack``; collective.

    The ``preconditioner`` is a PC, or a Python context; without one, the options name it. Further PETSc ``options``
    extend those of the kind.
    """
    ksp = keep(stack, PETSc.KSP().create(matrix.comm))
    ksp.setOperators(matrix)
    configure(ksp, SOLVERS[kind] | options)
    if isinstance(preconditioner, PETSc.PC):
        ksp.setPC(preconditioner)
    elif preconditioner is not None:
        ksp.pc.setType("python")
        ksp.pc.setPythonContext(preconditioner)
    return ksp


def factorised(matrix: PETSc.Mat, stack: ExitStack) -> PETSc.KSP:
    """Return an LDLᵀ factorisation, or Cholesky's of an SPD matrix, freed with the ``stack``; collective.

    On several ranks the order of the pivots, and with it the work space, depends on which rank is ready first.

    Raises:
        SolveError: if no work space is enough.
    """
    for space in WORK_SPACE:
        ksp = solver_of("factors", matrix, stack)
        ksp.pc.setFactorSetUpSolverType()
        factors = keep(stack, ksp.pc.getFactorMatrix())
        factors.setMumpsIcntl(_ENLARGE, space)
        ksp.setUp()
        if factors.getMumpsInfog(_RESULT) not in _TOO_SMALL:
            return ksp
        ksp.reset()
    raise SolveError(f"the factorisation needs more than {WORK_SPACE[-1]} % above its predicted work space")


def algebraic(matrix: PETSc.Mat, space: Any, stack: ExitStack) -> PETSc.PC:
    """Return algebraic multigrid for a ``matrix`` on a ``space`` of degree 1, freed with the ``stack``; collective."""
    pc = keep(stack, PETSc.PC().create(matrix.comm))
    pc.setOperators(matrix)
    if has_hypre():
        configure(pc, SOLVERS["degree 1"] | (_ON_RANKS if matrix.comm.size > 1 else {}))
        pc.setUp()
    else:
        if space is not None:
            _set_rigid_body_modes(matrix, space)
        configure(pc, _WITHOUT_HYPRE, set_up=True)
    return pc


def has_hypre() -> bool:
    """Return whether PETSc was built with hypre."""
    return bool(PETSc.Sys.hasExternalPackage("hypre"))


def _set_rigid_body_modes(matrix: PETSc.Mat, space: Any) -> None:
    """Tell a matrix the motions that its coarse levels must contain; collective."""
    with ExitStack() as made:
        points = keep(made, matrix.createVecLeft())
        rows, width = points.getLocalSize(), matrix.getBlockSize()
        points.array[:] = space.tabulate_dof_coordinates()[: rows // width, :width].ravel()
        points.setBlockSize(width)
        matrix.setNearNullSpace(keep(made, PETSc.NullSpace().createRigidBody(points)))


def keep(stack: ExitStack, item: Any) -> Any:
    """Let ``stack`` destroy a PETSc object, and return the object."""
    stack.callback(item.destroy)
    return item


def is_direct(method: str, dofs: int, limit: int) -> bool:
    """Return whether to factorise: a factorisation is faster up to a ``limit`` of unknowns."""
    return method == "direct" or (method == "auto" and dofs <= limit)
