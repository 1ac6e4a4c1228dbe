"""Bodies with triangles from a file: how the file is read, notices about it, and the identity of results."""

from abc import abstractmethod
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import PrivateAttr, ValidationInfo, field_serializer, field_validator
from pydantic_core import PydanticCustomError

from epsmesh.shapes.complex import TISSUE, Complex
from epsmesh.shapes.facetted import Facetted
from epsmesh.shapes.files.loaded import Loaded
from epsmesh.shapes.section import Words
from epsmesh.shapes.support import NONE, Below, Fixed
from epsmesh.shapes.triangles import SurfaceError, Triangles

# Increase by hand when the same file gives another place, mesh or force: older records are then not used.
_VERSION = 2
NO_NAMES = (
    'must be a height in the frame of the file, {below = "-40 mm"}: its faces have no names; "none" with [body.support]'
)
_FEW = 32  # cached surfaces between regions


class FromFile(Facetted):
    """A body bounded by the triangles of a ``file``, or by triangles made from its content.

    A subclass declares ``file`` after the fields that control reading, those of ``READ_BY``. It leaves these out of the
    body's identity, which follows from the triangles.
    """

    READ_BY: ClassVar[frozenset[str]]
    HAS_NAMES: ClassVar[bool] = False  # whether its faces may have names

    if TYPE_CHECKING:
        file: str  # not declared here, or it would be validated before the fields that control reading
    fixed: Annotated[
        Fixed,
        Words(
            "Support of the body: all tissue below a height, in the coordinates of the file. "
            'Displacements are zero there. "none": the body rests on [body.support].',
            '{below = "-40 mm"}',
            takes='{below = length} | "none"',
        ),
    ]

    _loaded: Loaded = PrivateAttr()

    @classmethod
    @abstractmethod
    def read(cls, file: str, given: Mapping[str, Any]) -> Loaded:
        """Return the surface in a file, read as the fields ``given`` say.

        Raises:
            SurfaceError: if it does not bound one piece of tissue.
        """

    @field_validator("file", check_fields=False)
    @classmethod
    def _readable(cls, file: str, info: ValidationInfo) -> str:
        if info.data.keys() >= cls.READ_BY:
            try:
                cls.read(file, info.data)
            except SurfaceError as error:
                # Braces in the message are not placeholders.
                raise PydanticCustomError("surface", "{what}", {"what": str(error)}) from None
        return file

    @field_validator("fixed")
    @classmethod
    def _below_a_height(cls, fixed: Any) -> Any:
        if not isinstance(fixed, Below) and not cls.HAS_NAMES and fixed != NONE:
            raise PydanticCustomError("not_supported", NO_NAMES)
        return fixed

    def model_post_init(self, context: Any, /) -> None:
        """Load the surface, which is read once for all bodies of one file."""
        self._loaded = self.read(self.file, dict(self))

    @field_serializer("file", check_fields=False)
    def _content(self, file: str) -> str:
        """Results depend on the content of the file, in metres, not on its path."""
        return self.content

    @property
    def content(self) -> str:
        """Hash of the content of the file, and of the version of the search for places on it."""
        return f"{_VERSION} {self.triangles.hash}"

    @property
    def triangles(self) -> Triangles:
        """The surface in the file, in m."""
        return self._loaded.triangles

    @property
    def partition(self) -> Complex | None:
        """The surface, and those between its regions, if they meet."""
        partition = self._loaded.partition
        labelled = [n for n, piece in enumerate(self.regions, start=1) if getattr(piece, "label", None) is not None]
        return None if partition is None else _renumbered(partition, (TISSUE, *labelled))

    @property
    def notices(self) -> tuple[str, ...]:
        """Notices about changes to the surface, and to those of its regions, that the author should know."""
        return *self._loaded.notices, *super().notices


@lru_cache(_FEW)
def _renumbered(partition: Complex, numbers: tuple[int, ...]) -> Complex:
    return partition.renumbered(numbers)
