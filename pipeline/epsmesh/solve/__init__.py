"""Elasticity: operators, solvers, reaction force, checks. Knows nothing of study files."""

from contextlib import suppress

with suppress(ModuleNotFoundError):  # without it, the errors below are all that can be imported
    from epsmesh import mpi  # noqa: F401 (before the modules of this package, which bind to it)


class CompilerError(Exception):
    """No working C compiler was found; raised on every rank."""


class SolveError(Exception):
    """A linear or nonlinear solve failed, or its solution failed a check."""
