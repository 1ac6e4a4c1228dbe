"""Parameters of a scene that can be identified: their names, units, bounds, and their places in a study."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import inf, nan

from epsmesh.shapes.body import Body, Layered
from epsmesh.shapes.friction import MOST_FRICTION
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.regions import Embedded
from epsmesh.shapes.section import Section
from epsmesh.shapes.tissue import Fibres, Term, Tissue, name_in_term
from epsmesh.study.schema import Material
from epsmesh.study.swept import Place

# A modulus that F is proportional to may have any value: the softest gel to the stiffest metal (Pa).
_MODULI = (1e-2, 1e12)
_WIDEST = (10.0, 1e11)
# Scales of a field: the bounds of their key.
_SCALES = (1e-12, 1e6)
# Default ranges: factors of the value that the study declares.
_OF_MODULUS, _OF_LENGTH, _OF_TOOL = 30.0, 2.0, 1.1
# Springs of force microscopes to frames of testing machines (N/m).
_STIFFNESSES = (1e-4, 1e12)
_SPRINGS = (1e-3, 1e9)
# Terms of relaxation that can be found, and their times (s).
MOST_RELAXATIONS = 3
_TIMES = (1e-3, 1e5)
# Default ranges of parameters of laws, as tissues have them; of others, the bounds of their keys.
_USUAL: dict[type[Section], dict[str, tuple[float, float]]] = {
    Tissue: {"c2": (0.0, 1.0), "c3": (0.0, 10.0), "limit": (0.1, 100.0), "alpha": (0.25, 30.0)},
    Fibres: {"k1": (0.0, 10.0), "k2": (0.1, 100.0)},
    Term: {"alpha": (1.0, 30.0)},
}


@dataclass(frozen=True)
class Parameter:
    """A parameter of a scene or of a measurement.

    ``least`` and ``most`` are what it may be at all, ``low`` and ``high`` its default range (SI units, ``unit`` "1" for
    plain numbers). ``value`` is what the study declares, NaN if it declares none. ``place`` is its place in the study:
    section, then keys and numbers of tables from 0; empty for those that are no part of a scene. ``is_logarithmic``
    tells those of which only the order of magnitude may be known.
    """

    name: str
    unit: str
    least: float
    most: float
    low: float
    high: float
    value: float = nan
    place: Place = ()
    is_logarithmic: bool = False

    @property
    def is_modulus(self) -> bool:
        """Whether forces are proportional to it and all others together: Young's modulus, or the scale of its field."""
        return self.place[-1:] == ("young",) or self.place[-2:] == ("young", "scale")


# The depth of the tool: no unknown of a force curve, which has all depths.
DEPTH = Parameter("depth", "m", 0.0, inf, 0.0, inf, place=("probe", "depth"), is_logarithmic=True)


def parameters_of(body: Body, material: Material, probe: Probe) -> dict[str, Parameter]:
    """Return every parameter by name that can be identified with a body, its material and a probe."""
    found = [*_of_tissues(body, material), *_of_body(body), *_of_probe(probe), *_of_measurements()]
    return {parameter.name: parameter for parameter in found}


def _of_tissues(body: Body, material: Material) -> Iterator[Parameter]:
    tissues: list[tuple[str, Place, Tissue | Material]] = []
    if not body.is_filled:
        tissues.append(("", ("material",), material))
    for kind, pieces in body.pieces.items():
        tissues += [
            (f"{piece.name}_", ("body", kind, number), piece)
            for number, piece in enumerate(pieces)
            if not (isinstance(piece, Embedded) and piece.is_hollow)
        ]
    for prefix, place, tissue in tissues:
        value, is_alone = tissue.young, len(tissues) == 1
        low, high = _WIDEST if is_alone else (value / _OF_MODULUS, value * _OF_MODULUS)
        if tissue.varying is None:
            yield Parameter(f"{prefix}young", "Pa", *_MODULI, low, high, value, (*place, "young"), is_logarithmic=True)
        else:
            scale, at = tissue.varying.scale, (*place, "young", "scale")
            usual = scale / _OF_MODULUS, scale * _OF_MODULUS
            yield Parameter(f"{prefix}scale", "1", *_SCALES, *usual, scale, at, is_logarithmic=True)
        least = Material.LEAST_OF_LARGE if tissue.completed(material).is_large else 0.0
        yield Parameter(f"{prefix}poisson", "1", least, 0.5, least, 0.5, tissue.poisson, (*place, "poisson"))
        yield from _of_law(prefix, place, tissue)


def _of_law(prefix: str, place: Place, tissue: Tissue) -> Iterator[Parameter]:
    """Yield the numbers of a tissue's own law: keys of it, of a table of it, and of each table of a list."""
    for key, value in tissue.given.items():
        if isinstance(value, Section):
            yield from _numbers(value, (*place, key), lambda name: f"{prefix}{name}")
        elif isinstance(value, tuple):
            for number, term in enumerate(value):
                yield from _numbers(term, (*place, key, number), partial(_of_term, prefix, term.name, number))
        elif value is not None:
            yield _number(Tissue, f"{prefix}{key}", value, (*place, key))


def _of_term(prefix: str, own: str, number: int, key: str) -> str:
    """Return the name of a key of a table of a list, which may have its ``own`` name."""
    return prefix + name_in_term(own, number, key)


def _numbers(section: Section, place: Place, name: Callable[[str], str]) -> Iterator[Parameter]:
    """Yield the numbers that a table gives, by the ``name`` of their keys."""
    for key in type(section).model_fields:
        if isinstance(value := getattr(section, key), float):
            yield _number(type(section), name(key), value, (*place, key))


def _number(section: type[Section], name: str, value: float, place: Place) -> Parameter:
    """Return a number of a law with the bounds of its key."""
    key = str(place[-1])
    least, most = _bounds(section, key)
    low, high = _USUAL.get(section, {}).get(key, (least, most))
    return Parameter(name, "1", least, most, low, high, value, place)


def _bounds(section: type[Section], key: str) -> tuple[float, float]:
    """Return the bounds of a key, infinite if it has none."""
    found = section.model_fields[key].metadata
    least = [getattr(one, name) for one in found for name in ("ge", "gt") if hasattr(one, name)]
    most = [getattr(one, name) for one in found for name in ("le", "lt") if hasattr(one, name)]
    return max(least, default=-inf), min(most, default=inf)


def _of_body(body: Body) -> Iterator[Parameter]:
    height = body.heights[1] - body.heights[0]
    for number, layer in enumerate(body.layer if isinstance(body, Layered) else ()):
        if layer.thickness is not None:
            yield _length(f"{layer.name}_thickness", layer.thickness, ("body", "layer", number, "thickness"), height)
    for number, inclusion in enumerate(body.inclusion):
        if inclusion.radius is not None:
            yield _length(f"{inclusion.name}_radius", inclusion.radius, ("body", "inclusion", number, "radius"), height)
    place: Place = {"box": ("body", "size", 2), "cylinder": ("body", "height")}.get(body.shape, ())
    if place and not body.is_filled:
        yield _length("thickness", height, place, inf)


def _length(name: str, value: float, place: Place, most: float) -> Parameter:
    high = min(value * _OF_LENGTH, most)
    return Parameter(name, "m", 0.0, most, value / _OF_LENGTH, high, value, place, is_logarithmic=True)


def _of_probe(probe: Probe) -> Iterator[Parameter]:
    radius = getattr(probe, "radius", None)
    if isinstance(radius, float):
        yield Parameter("radius", "m", 0.0, inf, radius / _OF_TOOL, radius * _OF_TOOL, radius, ("probe", "radius"))
    if probe.is_unilateral and "friction" in type(probe).model_fields:
        yield Parameter("friction", "1", 0.0, MOST_FRICTION, 0.0, 1.0, probe.friction, ("probe", "friction"))


def _of_measurements() -> Iterator[Parameter]:
    """Yield what is no part of a scene. Infinite ranges are those of the recorded curve."""
    for name, unit in (("contact_point", "m"), ("baseline", "N"), ("tilt", "N/m"), ("drift", "N/s")):
        yield Parameter(name, unit, -inf, inf, -inf, inf)
    yield Parameter("machine_stiffness", "N/m", *_STIFFNESSES, *_SPRINGS, is_logarithmic=True)
    for number in range(1, MOST_RELAXATIONS + 1):
        yield Parameter(f"relaxation_share_{number}", "1", 0.0, 1.0, 0.0, 0.99)
        yield Parameter(f"relaxation_time_{number}", "s", 0.0, inf, *_TIMES, is_logarithmic=True)
