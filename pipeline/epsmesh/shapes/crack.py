"""The crack that the shaft of a needle holds open, deep in tissue."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Crack:
    """A crack in tissue of a ``toughness`` (J/m²), which a shaft of a ``radius`` (m) holds open.

    It is a plane along the shaft, or a ring around it.
    """

    radius: float
    toughness: float
    is_ring: bool = False
