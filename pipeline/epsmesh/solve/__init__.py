"""Elasticity: operators, solvers, reaction force, checks. Knows nothing of study files."""

from contextlib import suppress

from epsmesh.errors import CompilerError, SolveError

with suppress(ModuleNotFoundError):  # without it, the errors are all that can be imported
    from epsmesh import mpi  # noqa: F401 (before the modules of this package, which bind to it)

__all__ = ["CompilerError", "SolveError"]
