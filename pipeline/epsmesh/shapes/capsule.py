"""A capsule: a thin elastic skin on a body, such as the liver's, as a membrane without elements of its own."""

from typing import Annotated, Any, ClassVar

from pydantic import Field

from epsmesh.shapes.section import Words
from epsmesh.shapes.term import BodyTerm, Place
from epsmesh.units import Length, Pressure, Tension


class Capsule(BodyTerm):
    """A membrane: isotropic, in plane stress, without bending stiffness, and as the facets of the body deform.

    Its energy is that of small strains along the surface. A membrane without bending stiffness that is compressed has
    no state of equilibrium at large displacements: it would fold at the size of elements.
    """

    EXCLUDES: ClassVar[dict[str, str]] = {
        "time steps": "a capsule that relaxes is not computed: omit the history",
        "large displacements": "at large displacements a compressed membrane wrinkles at the size of elements: "
        "use the linear law, or a layer",
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

    def energy(self, at: Place) -> Any:
        """Return the energy (J) of the membrane, and of its tension."""
        ufl, normal = at.ufl, at.normal
        plane = ufl.Identity(3) - ufl.outer(normal, normal)
        gradient = (at.gradient - ufl.Identity(3)) * plane
        strain = plane * ufl.sym(gradient) * plane
        stiff = self.young * self.thickness / (2 * (1 - self.poisson**2))
        shear, area = at.constant(stiff * (1 - self.poisson)), at.constant(stiff * self.poisson)
        density = shear * ufl.inner(strain, strain) + area * ufl.tr(strain) ** 2
        if self.tension:  # which turns with the surface
            density += at.constant(self.tension) * (ufl.tr(strain) + ufl.inner(gradient, gradient) / 2)
        return density * at.ds
