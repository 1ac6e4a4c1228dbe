"""A capsule: a thin elastic skin of a body, such as the liver's, or of a region, as a membrane without elements."""

from typing import Annotated, Any, ClassVar

from pydantic import Field

from epsmesh.shapes.part import Around
from epsmesh.shapes.section import Words
from epsmesh.shapes.term import BodyTerm, Place
from epsmesh.units import Length, Pressure, Tension

# Keeps the root of a shear that vanishes differentiable: the square of a strain.
_NO_SHEAR = 1e-28
# Rounding of strains: at rest, a capsule is taut.
_SAME = 1e-12


class Capsule(BodyTerm):
    """A membrane: isotropic, in plane stress, without bending stiffness, and as facets of the body's elements deform.

    Its energy is that of small strains along the surface, or, of ``tension_only``, that of Green's strain
    (Saint Venant and Kirchhoff), relaxed: a membrane without bending stiffness wrinkles where it would be compressed,
    and the least energy over all wrinkles is Y t/2 ⟨e₁⟩² + Y t/(2(1 - ν²)) ⟨e₂ + ν e₁⟩² of the principal strains
    e₁ ≥ e₂, ⟨x⟩ = max(x, 0) (H. Le Dret and A. Raoult, Proc. R. Soc. Edinb. A 125, 1179, 1995; A. C. Pipkin, IMA J.
    Appl. Math. 36, 85, 1986). It is convex in the gradient: its tangent has no negative eigenvalue. Without the
    relaxation, a membrane compressed at large displacements would fold at the size of elements.
    """

    EXCLUDES: ClassVar[dict[str, str]] = {
        "time steps": "a capsule that relaxes is not computed: omit the history",
    }

    # Its own name begins the dimensions of its sweeps.
    name: Annotated[str, Field(exclude=True), Words("Name in dimensions of sweeps.", '"capsule"')] = "capsule"
    young: Annotated[Pressure, Words("Young's modulus of the capsule.", '"1 MPa"')]
    thickness: Annotated[Length, Words("Thickness of the capsule.", '"0.1 mm"')]
    poisson: Annotated[
        float,
        Field(ge=0, le=0.5),
        Words("Poisson's ratio of the capsule. 0.5 is incompressible.", "0.45"),
    ] = 0.5
    tension: Annotated[
        Tension,
        Words(
            "Tension per length, equal in all directions, of the undeformed body's capsule. It acts before the tool "
            "does, and deforms the body.",
            '"3 N/m"',
            default="none",
        ),
    ] = 0.0

    tension_only: Annotated[
        bool,
        Words("Whether it wrinkles where it would be compressed, at any rotation of the surface.", "true"),
    ] = False

    def around(self, region: str) -> "Capsule":
        """Return this capsule on the whole surface of a ``region``."""
        return self.model_copy(update={"on": Around(region)})

    def energy(self, at: Place) -> Any:
        """Return the energy (J) of the membrane, and of its tension."""
        ufl, normal = at.ufl, at.normal
        plane = ufl.Identity(3) - ufl.outer(normal, normal)
        gradient = (at.gradient - ufl.Identity(3)) * plane
        strain, square = plane * ufl.sym(gradient) * plane, gradient.T * gradient / 2
        if self.tension_only:
            return self._relaxed(at, strain + square, plane) * at.ds
        # The tension turns with the surface.
        return (self._taut(at, strain) + at.constant(self.tension) * ufl.tr(square)) * at.ds

    def _taut(self, at: Place, strain: Any) -> Any:
        """Return the energy per area (J/m²) of a strain along the surface, and the work of the tension in it."""
        stiff = self.young * self.thickness / (2 * (1 - self.poisson**2))
        shear, area = at.constant(stiff * (1 - self.poisson)), at.constant(stiff * self.poisson)
        trace = at.ufl.tr(strain)
        return shear * at.ufl.inner(strain, strain) + area * trace**2 + at.constant(self.tension) * trace

    def _relaxed(self, at: Place, strain: Any, plane: Any) -> Any:
        """Return the least energy per area (J/m²) over all wrinkles; with a tension, e is from the unloaded state."""
        ufl, stiff = at.ufl, self.young * self.thickness
        unloaded = self.tension * (1 - self.poisson) / stiff
        middle = ufl.tr(strain) / 2
        shear = strain - middle * plane
        radius = ufl.sqrt(ufl.inner(shear, shear) / 2 + _NO_SHEAR)
        first, second = (middle + at.constant(unloaded) + part for part in (radius, -radius))
        stretched = ufl.conditional(ufl.gt(first, 0), first**2, 0)
        wrinkled = at.constant(stiff / 2) * stretched - at.constant(self.tension * unloaded)
        is_taut = ufl.ge(second + at.constant(self.poisson) * first, -_SAME)
        return ufl.conditional(is_taut, self._taut(at, strain), wrinkled)
