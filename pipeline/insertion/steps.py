"""Steps of an insertion: forces and energies at one depth."""

from dataclasses import dataclass

# "ended": the path ended before this depth.
INDENTATION, CUTTING, WITHDRAWAL, ENDED = "indentation", "cutting", "withdrawal", "ended"
PHASES = (INDENTATION, CUTTING, WITHDRAWAL, ENDED)


@dataclass(frozen=True)
class Step:
    """One depth (m) of a path: forces (N) with the error bar of their sum, energies (J) since the first touch."""

    phase: str
    depth: float
    elastic: float
    cutting: float = 0.0
    friction: float = 0.0
    error: float = 0.0
    stored: float = 0.0
    fracture: float = 0.0
    rubbed: float = 0.0
    work: float = 0.0
    crack_depth: float = 0.0

    @property
    def force(self) -> float:
        """Force (N) of the tissue against the advance."""
        return self.elastic + self.cutting + self.friction

    @property
    def balance(self) -> float:
        """Work less stored energy, work of fracture and friction, relative to the work."""
        return (self.work - self.stored - self.fracture - self.rubbed) / self.work
