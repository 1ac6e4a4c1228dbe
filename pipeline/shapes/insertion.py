"""``[probe.insertion]``: a tool that is pushed in until tissue is pierced, and then cuts."""

from typing import Annotated

from pydantic import BaseModel, Field

from pipeline.shapes.section import Section, Words
from pipeline.units import Length, Toughness


class Insertion(BaseModel):
    """The last depth of an insertion, and its steps."""

    model_config = Section.model_config

    to: Annotated[Length, Words("Largest depth of the tool's tip below the undeformed surface.", '"15 mm"')]
    steps: Annotated[
        int, Field(ge=2, le=1000), Words("Number of depths, in equal steps, at which the force is computed.", "30")
    ] = 30
    withdraw: Annotated[
        bool, Words("Withdrawal of the tool after the last depth, through the same depths.", "true")
    ] = False


class Inserted(BaseModel):
    """A tool that can be inserted."""

    toughness: Annotated[
        Toughness | None,
        Words(
            "Toughness of the tissue: energy per area of a cut. An insertion needs it. Layers may have their own.",
            '"200 J/m^2"',
            default="none: tissue is not cut",
        ),
    ] = None
    insertion: Annotated[
        Insertion | None,
        Words(
            "Insertion through the surface, as a table: [probe.insertion].",
            '{to = "15 mm", steps = 30}',
            default="none: the tissue stays whole",
        ),
    ] = None

    @property
    def is_inserted(self) -> bool:
        """Whether it is inserted, or in a state of an insertion in which it cuts."""
        return self.insertion is not None or self.toughness is not None


def last_depth(insertion: object) -> object:
    """Return the last depth of a table, as its text; None if there is none."""
    return insertion.get("to") if isinstance(insertion, dict) else None
