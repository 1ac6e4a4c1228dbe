"""Base class of terms: what acts on a body besides its law, gravity and tractions, such as springs under a face.

One file of ``terms/`` has a term: the keys of its tables, its energy, and the features that exclude it. All solvers,
elements and kinds of contact take it from there.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Protocol

from epsmesh.shapes.part import FREE, Part
from epsmesh.shapes.section import OptionalName, Section, Words


class Place(Protocol):
    """What an energy is written in, in UFL: see :class:`epsmesh.solve.terms.Place`; lengths in metres, forces in N.

    ``ufl`` is that module, ``u`` the displacement, ``x`` the undeformed place, ``normal`` the outward unit normal,
    ``gradient`` F, ``ds`` the undeformed part of the boundary on which the term acts, ``dx`` the volume.
    """

    ufl: Any

    @property
    def u(self) -> Any: ...  # noqa: D102
    @property
    def x(self) -> Any: ...  # noqa: D102
    @property
    def normal(self) -> Any: ...  # noqa: D102
    @property
    def gradient(self) -> Any: ...  # noqa: D102
    @property
    def ds(self) -> Any: ...  # noqa: D102
    @property
    def dx(self) -> Any: ...  # noqa: D102

    def constant(self, value: float) -> Any:
        """Return a number, of which other values need no new compilation."""

    def vector(self, value: tuple[float, float, float]) -> Any:
        """Return a vector in the coordinates of the body, which the mesh may have turned."""


class BodyTerm(Section):
    """A table ``[[load.NAME]]`` of a study, on a part of the body's boundary unless its energy is in the volume."""

    name: Annotated[
        OptionalName,
        Words(
            "Name of the table: letters, digits, _ and -. The dimension of a sweep begins with it.",
            '"floor"',
            default="none: nothing of it is swept",
        ),
    ] = ""
    on: Annotated[
        Part,
        Words(
            'Part of the boundary: a face of the body ("top", "sides", "bottom"; not of a CAD file), a hollow region '
            'by its name, a cap around a point of the surface, or "free", all of the boundary without support and '
            "hollow regions.",
            '"bottom"',
        ),
    ] = FREE

    # What it is, for the author of a study.
    ABOUT: ClassVar[str] = ""
    # Whether it may hold a body of which nothing is fixed (body.fixed = "none"); the solver checks that it does.
    HOLDS: ClassVar[bool] = False
    # Features (pipeline/epsmesh/study/capabilities/features.py) that exclude it, each with the reason.
    EXCLUDES: ClassVar[Mapping[str, str]] = {}

    @abstractmethod
    def energy(self, at: Place) -> Any:
        """Return the energy (J) as a form of UFL."""

    def is_mirrored(self, normal: tuple[float, float, float]) -> bool:
        """Tell whether it is its own image in the plane through the origin with that unit normal, as body and part are.

        Only a term that says so is solved on a half or a quarter of the body.
        """
        return False
