"""Bodies whose triangles come from a file: how it is read, what is told of it, and what results depend on."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import PrivateAttr, ValidationInfo, field_serializer, field_validator
from pydantic_core import PydanticCustomError

from pipeline.shapes.facetted import Facetted
from pipeline.shapes.files.loaded import Loaded
from pipeline.shapes.section import Words
from pipeline.shapes.support import Below, Fixed
from pipeline.shapes.triangles import SurfaceError, Triangles

# Raise by hand when the same file gives another place, mesh or force: records made before are then not used any more.
_VERSION = 2
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}


class FromFile(Facetted):
    """A body bounded by triangles that a ``file`` holds, or its content is made into.

    A class that derives from it declares ``file`` after the fields that say how it is read, those of ``READ_BY``, and
    keeps these out of what it is known by: the triangles tell.
    """

    READ_BY: ClassVar[frozenset[str]]
    HAS_NAMES: ClassVar[bool] = False  # whether its faces may have names

    if TYPE_CHECKING:
        file: str  # not here, or it were checked before the fields that say how it is read
    fixed: Annotated[
        Fixed,
        Words(
            "Where it is held: everywhere below a height, in the file's own frame.",
            '{below = "-40 mm"}',
            takes="{below = length}",
        ),
    ]

    _loaded: Loaded = PrivateAttr()

    @classmethod
    @abstractmethod
    def load(cls, file: str, given: Mapping[str, Any]) -> Loaded:
        """Return the surface in a file, read as the fields ``given`` say.

        Raises:
            SurfaceError: if it does not bound one piece of tissue.
        """

    @field_validator("file", check_fields=False)
    @classmethod
    def _readable(cls, file: str, info: ValidationInfo) -> str:
        if info.data.keys() >= cls.READ_BY:
            try:
                cls.load(file, info.data)
            except SurfaceError as error:
                # Braces in the message are no placeholders.
                raise PydanticCustomError("surface", "{what}", {"what": str(error)}) from None
        return file

    @field_validator("fixed")
    @classmethod
    def _below_a_height(cls, fixed: Any) -> Any:
        if not isinstance(fixed, Below) and not cls.HAS_NAMES:
            raise PydanticCustomError(
                "not_supported",
                'must be {below = "-40 mm"}, a height in the frame of the file: its faces have no names',
            )
        return fixed

    def model_post_init(self, context: Any, /) -> None:
        """Keep the surface, which is read once for all bodies of one file."""
        self._loaded = self.load(self.file, dict(self))

    @field_serializer("file", check_fields=False)
    def _content(self, file: str) -> str:
        """What results depend on is the content of the file, in metres, not where it lies."""
        return self.content

    @property
    def content(self) -> str:
        """Hash of the content of the file, and of how places on it are found."""
        return f"{_VERSION} {self.triangles.hash}"

    @property
    def triangles(self) -> Triangles:
        """The surface in the file, in m."""
        return self._loaded.triangles

    @property
    def notices(self) -> tuple[str, ...]:
        """What was done to the surface that its author should know."""
        return self._loaded.notices
