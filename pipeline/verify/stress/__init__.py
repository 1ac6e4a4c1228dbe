"""Numerical stability as a matrix that a person can read: extreme values of every input, each against a reference.

``run(comm)`` yields a :class:`Result` for each cell; ``python -m pipeline.verify.stress`` prints them. A cell passes if
its force agrees with the reference within the two error bars, or if it is refused where no answer can be expected. What
must never happen is a wrong number with a good status.
"""

from pipeline.verify.stress.cell import Cell, Result, judge
from pipeline.verify.stress.report import line, summary, table, to_json
from pipeline.verify.stress.rows import cells
from pipeline.verify.stress.runner import run

__all__ = ["Cell", "Result", "cells", "judge", "line", "run", "summary", "table", "to_json"]
