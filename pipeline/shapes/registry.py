"""The shapes that there are: one line each. What is not here is refused.

A shape is loaded when its class is first asked for: a study loads those that it names.
"""

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Generic, TypeVar

from pipeline.shapes.body import Body
from pipeline.shapes.probe import Probe
from pipeline.shapes.section import Section

Shape_co = TypeVar("Shape_co", bound=Section, covariant=True)


class Shapes(Mapping[str, type[Shape_co]], Generic[Shape_co]):
    """Classes by the names of their shapes; ``places`` says of each in which module of this folder it is."""

    def __init__(self, places: Mapping[str, str]):
        self._places = dict(places)

    def __getitem__(self, name: str) -> type[Shape_co]:
        module, _, shape = self._places[name].rpartition(".")
        found: type[Shape_co] = getattr(import_module(f"pipeline.shapes.{module}"), shape)
        return found

    def __contains__(self, name: object) -> bool:
        return name in self._places

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


BODIES: Shapes[Body] = Shapes(
    {
        "box": "bodies.box.Box",
        "cylinder": "bodies.cylinder.Cylinder",
        "ellipsoid": "bodies.ellipsoid.Ellipsoid",
        "cad": "bodies.cad.FromCad",
        "surface": "bodies.surface.FromSurface",
        "image": "bodies.image.FromImage",
    }
)
PROBES: Shapes[Probe] = Shapes(
    {
        "disc": "probes.disc.Disc",
        "blade": "probes.blade.Blade",
        "ellipse": "probes.ellipse.Ellipse",
        "sphere": "probes.sphere.Sphere",
        "cone": "probes.cone.Cone",
        "wedge": "probes.wedge.Wedge",
    }
)
# Shapes of the format that this version does not compute: named as such, not as typing errors.
LATER: dict[str, tuple[str, ...]] = {"body": (), "probe": ()}
