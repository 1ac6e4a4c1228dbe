"""Laws of large displacements: uniform stretch and shear of a cube, against closed forms of the stress."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
from dolfinx import fem
from mpi4py import MPI
from scipy.optimize import brentq

from epsmesh.arrays import FloatArray
from epsmesh.shapes.tissue import MOST_TERMS
from epsmesh.solve.compiled import vector_space
from epsmesh.solve.forms import ElasticForms, HyperelasticForms
from epsmesh.solve.physics import MaterialLaw

# Parameters besides Young's modulus and Poisson's ratio with which each law is verified.
FURTHER: dict[str, dict[str, Any]] = {
    "neo-hookean": {},
    "mooney-rivlin": {"c2": 0.3},
    "yeoh": {"c2": 0.4, "c3": 0.1},
    "ogden": {"share1": 0.5, "alpha1": 2.0, "share2": 0.3, "alpha2": 7.0, "share3": 0.2, "alpha3": -3.0},
    "gent": {"limit": 3.0},
    "holzapfel": {"fibre_x": 0.0, "fibre_y": 0.0, "fibre_z": 1.0, "k1": 1.4, "k2": 2.0, "dispersion": 0.1},
    "veronda-westmann": {"alpha": 1.5},
}
YOUNG, POISSON = 10e3, 0.4
# Tolerance of coordinates on the unit cube.
_ON_FACE = 1e-9


def rounding(law: str) -> float:
    """Return the relative rounding error of stresses: principal stretches, of Ogden's law, are known to 1e-8 only."""
    return 1e-7 if law == "ogden" else 1e-10


@dataclass(frozen=True)
class Stress:
    """Closed forms of the stress of a ``law`` with μ and K (Pa); W is the energy over μ, W₁ = ∂W/∂Ī₁, W₂ = ∂W/∂Ī₂.

    With b̄ᵢ = J^(−2/3) λᵢ², the principal Cauchy stresses are 2μ/J dev((W₁ + Ī₁ W₂) b̄ᵢ − W₂ b̄ᵢ²) + K (J − 1):
    G. A. Holzapfel, Nonlinear Solid Mechanics, Wiley, 2000.
    """

    law: str
    mu: float
    bulk: float
    of: Mapping[str, Any]

    @staticmethod
    def of_law(law: str) -> "Stress":
        """Return the closed forms of a law with the parameters of this module."""
        return Stress(law, YOUNG / (2 * (1 + POISSON)), YOUNG / (3 * (1 - 2 * POISSON)), FURTHER[law])

    def principal(self, stretches: FloatArray) -> FloatArray:
        """Return the principal Cauchy stresses (Pa) for principal stretches."""
        volume, squares = stretches.prod(), stretches**2
        if self.law == "neo-hookean":
            return self.mu / volume * (squares - 1) + (self.bulk - 2 / 3 * self.mu) * (volume - 1)
        b = volume ** (-2 / 3) * squares
        if self.law == "ogden":
            terms = ((self.of[f"share{k}"], self.of[f"alpha{k}"]) for k in range(1, MOST_TERMS + 1))
            shape = 2 * self.mu / volume * sum(share / alpha * b ** (alpha / 2) for share, alpha in terms)
            return shape - shape.mean() + self.bulk * (volume - 1)
        first, second = self.derivatives(b.sum(), b[2])
        shape = 2 * self.mu / volume * ((first + b.sum() * second) * b - second * b**2)
        if self.law == "holzapfel":  # fibres are along the third principal direction
            shape[2] += 2 * self.mu / volume * self.fibres(b.sum(), b[2]) * (1 - 3 * self.of["dispersion"]) * b[2]
        return shape - shape.mean() + self.bulk * (volume - 1)

    def derivatives(self, first: float, fourth: float) -> tuple[float, float]:
        """Return W₁ and W₂ for given Ī₁ and Ī₄, the latter of fibres."""
        of, x = self.of, first - 3
        match self.law:
            case "mooney-rivlin":
                return (1 - of["c2"]) / 2, of["c2"] / 2
            case "yeoh":
                return (1 + 2 * of["c2"] * x + 3 * of["c3"] * x**2) / 2, 0.0
            case "gent":
                return of["limit"] / (of["limit"] - x) / 2, 0.0
            case "veronda-westmann":
                return float(np.exp(of["alpha"] * x)), -0.5
            case "holzapfel":
                return 0.5 + of["dispersion"] * self.fibres(first, fourth), 0.0
        return 0.5, 0.0

    def uniaxial(self, stretch: float) -> tuple[float, float]:
        """Return the lateral stretch under uniaxial stress, and the nominal stress (Pa)."""

        def lateral(b: float) -> float:
            return float(self.principal(np.array([b, b, stretch]))[0])

        b = brentq(lateral, stretch**-0.5, 1.0, xtol=1e-15, rtol=1e-14)  # between J = 1 and no lateral strain
        return b, float(self.principal(np.array([b, b, stretch]))[2]) * b**2

    def shear(self, amount: float) -> float:
        """Return the shear stress (Pa) in simple shear: 2μ (W₁ + W₂) γ, where Ī₁ = Ī₂ = 3 + γ².

        With principal stresses, it is (σ₁ − σ₂)/2 sin 2θ, where λ₁ − 1/λ₁ = γ and tan θ = 1/λ₁ for the first axis.
        """
        if self.law == "ogden":
            stretch = amount / 2 + np.hypot(1, amount / 2)
            stress = self.principal(np.array([stretch, 1.0, 1 / stretch]))
            return float((stress[0] - stress[2]) / (stretch + 1 / stretch))
        first, second = self.derivatives(3 + amount**2, 1 + amount**2)
        along = 0.0
        if self.law == "holzapfel":  # fibres are along z, and become (γ, 0, 1)
            along = self.fibres(3 + amount**2, 1 + amount**2) * (1 - 3 * self.of["dispersion"])
        return 2 * self.mu * (first + second + along) * amount

    def fibres(self, first: float, fourth: float) -> float:
        """Return ∂W/∂E of fibres for given Ī₁ and Ī₄: k₁ ⟨E⟩ exp(k₂ ⟨E⟩²)."""
        kappa = self.of["dispersion"]
        strain = max(kappa * first + (1 - 3 * kappa) * fourth - 1, 0.0)
        return float(self.of["k1"] * strain * np.exp(self.of["k2"] * strain**2))


class Cube:
    """A unit cube of one material in a uniform deformation."""

    def __init__(self, law: str):
        """Compile the forms; collective on one rank."""
        self._space = vector_space(dolfinx.mesh.create_unit_cube(MPI.COMM_SELF, 2, 2, 2), 2)
        self._elastic = ElasticForms(self._space)
        self._forms = HyperelasticForms(self._space, self._elastic, (law,))
        self._elastic.set_law(MaterialLaw.of_moduli(YOUNG, POISSON, law, **FURTHER[law]))

    def energy(self, deformation: FloatArray) -> float:
        """Return the stored energy (J) for the gradient F of a uniform ``deformation``."""
        self._deform(deformation)
        return float(fem.assemble_scalar(self._forms.energy))

    def forces(self, deformation: FloatArray) -> tuple[FloatArray, float]:
        """Return the force (N) on the face at z = 1 for the gradient F of a uniform ``deformation``.

        The second result is the largest nodal force inside the cube (N), which vanishes in uniform stress.
        """
        self._deform(deformation)
        nodal = np.array(fem.assemble_vector(self._forms.residuals[0]).array).reshape(-1, 3)
        points = self._space.tabulate_dof_coordinates()
        inside = ((points > _ON_FACE) & (points < 1 - _ON_FACE)).all(axis=1)
        return nodal[points[:, 2] > 1 - _ON_FACE].sum(axis=0), float(np.abs(nodal[inside]).max())

    def _deform(self, deformation: FloatArray) -> None:
        self._elastic.displacement.interpolate(lambda x: (deformation - np.eye(3)) @ x)
