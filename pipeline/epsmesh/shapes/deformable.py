"""Keys of a tool that deforms: an elastic tip on a stiff mount, such as one of rubber, or a gloved finger."""

from typing import Annotated

from pydantic import Field

from epsmesh.shapes.section import Problems, Section, Words, in_mm
from epsmesh.shapes.tissue import Tissue
from epsmesh.units import Length, Pressure

# Its name among the regions of a mesh.
TOOL = "tool"


class Deformable(Section):
    """Elasticity of a tool, and the height of its tip."""

    # Rigid tools have the records that they had before there were these keys: see plan/key.py.
    young: Annotated[
        Pressure | None,
        Field(exclude=True),
        Words("Young's modulus of the tool, which then deforms.", '"1 MPa"', default="none: the tool is rigid"),
    ] = None
    poisson: Annotated[
        float | None,
        Field(exclude=True, ge=0, le=0.5),
        Words("Poisson's ratio of a tool that deforms.", "0.48", default="required with `young`"),
    ] = None
    height: Annotated[
        Length | None,
        Field(exclude=True),
        Words(
            "Height of the part of the tool that deforms, above its lowest point. A stiff mount holds its upper end.",
            '"5 mm"',
            default="the radius of the tool, or half the length of its edge",
        ),
    ] = None

    def check_keys(self, problems: Problems) -> None:
        """Report keys without others that they need."""
        if self.young is not None and self.poisson is None:
            problems.error("probe.poisson", None, "is required of a tool that deforms, with `young`")
        if self.young is None:
            for key, value in (("poisson", self.poisson), ("height", self.height and in_mm(self.height))):
                if value is not None:
                    problems.error(f"probe.{key}", value, "is of a tool that deforms: add `young`, or omit it")

    @property
    def elastic(self) -> Tissue | None:
        """The material of the tool; None of a rigid one."""
        if self.young is None or self.poisson is None:
            return None
        return Tissue.model_construct(name=TOOL, young=self.young, poisson=self.poisson)
