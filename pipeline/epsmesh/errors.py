"""Errors of the solvers, for those that load none."""


class CompilerError(Exception):
    """No working C compiler was found; raised on every rank."""


class SolveError(Exception):
    """A linear or nonlinear solve failed, or its solution failed a check."""
