"""Elasticity: operators, solvers, reaction force, checks. Knows nothing of study files."""


class CompilerError(Exception):
    """No C compiler works here; raised on every rank."""


class SolveError(Exception):
    """A solve that did not give a solution to rely on."""
