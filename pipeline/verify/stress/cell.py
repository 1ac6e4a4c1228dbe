"""One cell of the matrix, what came of it, and the verdict on it."""

from dataclasses import dataclass, field
from math import isfinite, nan
from typing import Any, Literal

from pipeline.run.record import UNFORESEEN, Record

Against = Literal["truth", "base"]
Expect = Literal["right", "refused", "either"]

# What should not change must not change by more than this.
INVARIANT = 1e-8
# An error bar above this is no answer: the case should have been refused.
IDLE = 1.0


@dataclass(frozen=True)
class Cell:
    """One study of one case, and what is expected of it.

    ``against`` is "truth", the same scene with an accuracy asked for, or "base", the row's cell of that ``group``
    which has no error to hide behind: F / ``scale`` is to be the same to 1e-8. ``expect`` is "right", "refused", or
    "either" where giving up is as good as the right answer. ``ranks`` is how many are started for it, 0 for none.
    """

    row: str
    value: str
    study: dict[str, Any]
    against: Against = "truth"
    expect: Expect = "right"
    scale: float = 1.0
    accuracy: str = "0.1 %"
    group: str = ""
    ranks: int = 0
    quick: bool = False


@dataclass(frozen=True)
class Result:
    """What came of a cell; ``error`` and ``bar``, the case's plus the reference's, are relative to the reference."""

    row: str
    value: str
    status: Literal["pass", "refused", "skipped", "FAIL"]
    error: float = nan
    bar: float = nan
    iterations: int = 0
    dofs: int = 0
    seconds: float = 0.0
    message: str = ""
    wrong: bool = field(default=False)  # a wrong number with a good status: the failure that counts

    @property
    def is_good(self) -> bool:
        """Whether nothing is amiss."""
        return self.status != "FAIL"


def judge(cell: Cell, record: Record, reference: Record | None, seconds: float = 0.0) -> Result:
    """Return the verdict on ``record``; ``reference`` is None if none was needed.

    Forces of ``reference`` are for a ``scale`` of 1.
    """
    found = Result(
        cell.row,
        cell.value,
        "FAIL",
        iterations=record.iterations,
        dofs=record.dofs,
        seconds=seconds,
        message=record.message,
    )
    if record.message.startswith(UNFORESEEN):
        return found
    if record.status != "ok":
        return _changed(found, status="refused" if cell.expect != "right" and record.message else "FAIL")
    if cell.expect == "refused":
        return _changed(found, wrong=True, message="computed, though it should be refused")
    if not isfinite(record.force):
        return _changed(found, wrong=True, message=f"a force of {record.force} N")
    if not (isfinite(record.force_error) and record.force_error >= 0):
        words = f"error bar of {record.force_error:.3g} {record.message}".strip()
        return _changed(found, wrong=record.force_error < 0, message=words)
    idle = f"idle error bar of {record.force_error:.0%}" if record.force_error > IDLE else ""
    if reference is None or not (isfinite(reference.force) and reference.force):
        words = f"no reference: {reference.message if reference else 'not computed'}"
        return _changed(found, message=f"{idle} {words}".strip())
    if cell.against == "truth" and record.origin == reference.origin == "axisymmetric":
        return _changed(found, message="case and reference were computed in the same way: nothing is compared")
    ratio = record.force / cell.scale / reference.force
    bar = INVARIANT if cell.against == "base" else min(1.0, abs(ratio)) * record.force_error + reference.force_error
    found = _changed(found, error=ratio - 1, bar=bar)
    if not abs(ratio - 1) <= bar:
        return _changed(found, wrong=True, message=f"WRONG by {abs(ratio - 1) / bar:.3g} bars {record.message}".strip())
    if idle:
        return _changed(found, wrong=abs(ratio - 1) > 1, message=idle)
    return _changed(found, status="pass")


def refused(cell: Cell, message: str) -> Result:
    """Return the verdict on a study that was refused before anything was computed."""
    status: Literal["refused", "FAIL"] = "refused" if cell.expect != "right" and message else "FAIL"
    return Result(cell.row, cell.value, status, message=message)


def _changed(result: Result, **changes: Any) -> Result:
    return Result(**{**result.__dict__, **changes})
