"""Elasticity: operators, solvers, reaction force, checks. Knows nothing of study files."""


class CompilerError(Exception):
    """No working C compiler was found; raised on every rank."""


class SolveError(Exception):
    """A linear or nonlinear solve failed, or its solution failed a check."""
