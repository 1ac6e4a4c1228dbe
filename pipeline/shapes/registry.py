"""The shapes that there are: one line each. What is not here is refused."""

from pipeline.shapes.bodies.box import Box
from pipeline.shapes.bodies.cad import FromCad
from pipeline.shapes.bodies.cylinder import Cylinder
from pipeline.shapes.bodies.ellipsoid import Ellipsoid
from pipeline.shapes.bodies.image import FromImage
from pipeline.shapes.bodies.surface import FromSurface
from pipeline.shapes.body import Body
from pipeline.shapes.probe import Probe
from pipeline.shapes.probes.blade import Blade
from pipeline.shapes.probes.cone import Cone
from pipeline.shapes.probes.disc import Disc
from pipeline.shapes.probes.ellipse import Ellipse
from pipeline.shapes.probes.sphere import Sphere
from pipeline.shapes.probes.wedge import Wedge

BODIES: dict[str, type[Body]] = {
    "box": Box,
    "cylinder": Cylinder,
    "ellipsoid": Ellipsoid,
    "cad": FromCad,
    "surface": FromSurface,
    "image": FromImage,
}
PROBES: dict[str, type[Probe]] = {
    "disc": Disc,
    "blade": Blade,
    "ellipse": Ellipse,
    "sphere": Sphere,
    "cone": Cone,
    "wedge": Wedge,
}
# Shapes of the format that this version does not compute: named as such, not as typing errors.
LATER: dict[str, tuple[str, ...]] = {"body": (), "probe": ()}
