"""One comparison of a force, or of another number, with what it should be."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """``value`` is to agree with ``reference`` to a relative error of ``bar``, the value's, plus ``reference_bar``."""

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
        """Whether the value agrees; what is not a number does not."""
        return abs(self.error) <= self.bar + self.reference_bar
