"""The field between the tip of a blade and the front of its slit, for distances too small for a mesh.

A rigid plate of half thickness h opens a crack. Close to the tip, at a distance a far below all other lengths, the
energy release rate is that of a semi-infinite plate in an infinite body in plane strain (G. I. Barenblatt, Adv. Appl.
Mech. 7, 55, 1962, §V):

    G = E h² / (2π (1 − ν²) a)

The body changes this to G = C / (a (1 + κ a)) with C from the formula, and κ from one solve at a distance a₀. The
stored energy follows by integration over the area of the slit.
"""

from dataclasses import dataclass
from math import log, pi, sqrt


def strength(young: float, poisson: float, half: float) -> float:
    """Return C = a G (J/m) of a plate of ``half`` thickness (m) in an infinite body of these moduli (Pa, 1)."""
    return young / (1 - poisson**2) * half**2 / (2 * pi)


@dataclass(frozen=True)
class NearTip:
    """Energy release rate G = C / (a (1 + κ a)) at distances a: ``strength`` C (J/m) and ``bend`` κ (1/m)."""

    strength: float
    bend: float

    @classmethod
    def through(cls, strength: float, ahead: float, release: float) -> "NearTip":
        """Return the field with the energy ``release`` rate (J/m²) that was solved at a distance ``ahead`` (m)."""
        return cls(strength, (strength / (release * ahead) - 1) / ahead)

    def release(self, ahead: float) -> float:
        """Return G (J/m²) at a distance (m)."""
        return self.strength / (ahead * (1 + self.bend * ahead))

    def ahead(self, toughness: float) -> float:
        """Return the distance (m) at which G is the ``toughness`` (J/m²)."""
        share = 4 * self.bend * self.strength / toughness
        return 2 * self.strength / toughness / (1 + sqrt(max(1 + share, 0.0)))

    def corners(self, near: float, far: float) -> float:
        """Return the energy (J) of the area that both lower corners of a slit gain between two distances (m)."""
        return 4 * self.strength * self._rest(near, far)

    def per_length(self, near: float, far: float) -> float:
        """Return what a slit that ends ``near`` (m) stores more, per length (J/m), than one that ends ``far`` (m).

        It is negative if the first distance is larger.
        """
        return self.strength * (log(far / near) - self.bend * self._rest(near, far))

    def by_bend(self, near: float, far: float) -> float:
        """Return the decrease (J) of ``per_length`` per unit of κ."""
        return self.strength * (far / (1 + self.bend * far) - near / (1 + self.bend * near))

    def _rest(self, near: float, far: float) -> float:
        """Return the integral of 1 / (1 + κ a) (m)."""
        if abs(self.bend) * far < 1e-9:
            return far - near
        return log((1 + self.bend * far) / (1 + self.bend * near)) / self.bend
