"""One comparison of a force, or of another number, with its reference."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """A ``value`` and its ``reference``, which must agree within the sum of their relative error bars."""

    scene: str
    path: str  # how the value was computed
    reference: float
    source: str
    value: float
    bar: float
    reference_bar: float = 0.0
    message: str = ""

    @property
    def error(self) -> float:
        """Relative error of the value."""
        return self.value / self.reference - 1 if self.reference else self.value

    @property
    def is_right(self) -> bool:
        """Whether value and reference agree; NaN does not."""
        return abs(self.error) <= self.bar + self.reference_bar
