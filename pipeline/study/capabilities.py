"""What does not go together, and why: one table of features, read by the study, the plan, the export and the docs.

A scene has a set of features. ``REFUSALS`` holds the pairs that a study is refused for; ``OBSTACLES`` the features for
which a shorter way of computing (a reduction, a real-time model) is not taken. Pairs in neither table are computed.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import isfinite
from types import SimpleNamespace
from typing import Any, Protocol, cast

from pipeline.shapes.body import Body, Layered
from pipeline.shapes.contact import is_flat, is_level
from pipeline.shapes.from_file import FromFile
from pipeline.shapes.indenter import Indenter
from pipeline.shapes.probe import Probe
from pipeline.shapes.section import Section, in_mm
from pipeline.study.loads import Load
from pipeline.study.problems import Problems
from pipeline.study.schema import Material, Mesh

# Poisson's ratio beyond which displacement elements of degree 2, which find a body's own far field, lock.
MOST_OF_GREEN = 0.49
# A slit whose blade tissue slides along lies along x or y to this.
_ALIGNED = 1e-9


class Scene(Protocol):
    """The sections that features are told from: a case has all of them."""

    @property
    def body(self) -> Body: ...  # noqa: D102
    @property
    def material(self) -> Material: ...  # noqa: D102
    @property
    def probe(self) -> Probe: ...  # noqa: D102
    @property
    def mesh(self) -> Mesh: ...  # noqa: D102
    @property
    def load(self) -> Load: ...  # noqa: D102


@dataclass(frozen=True)
class Feature:
    """The ``key`` at which a study says it, whether a scene has it, and how its value is written.

    ``also`` are the parts of a scene that tell, besides the section of the key.
    """

    key: str
    holds: Callable[[Scene], bool]
    also: tuple[str, ...] = ()
    write: Callable[[Any], Any] = lambda value: value if isinstance(value, str | float) else None

    @property
    def parts(self) -> tuple[str, ...]:
        """The parts of a scene that tell whether it has it."""
        return self.key.partition(".")[0], *self.also

    def value(self, scene: Scene) -> Any:
        """Return what a study says at the key, as a message quotes it; None where that would say nothing."""
        section, _, key = self.key.partition(".")
        return self.write(getattr(getattr(scene, section), key, None))


@dataclass(frozen=True)
class Refusal:
    """Two features that do not go together: the reason, and what to write instead, are told at the first one's key."""

    first: str
    second: str
    reason: str


_PARTS = ("body", "material", "probe", "mesh", "load")
_PLACE = ("body", "probe")


def _is_ball(scene: Scene) -> bool:
    return scene.mesh.is_closed and scene.mesh.epsilon < scene.body.farthest(scene.probe.frame_on(scene.body))


def _is_column(scene: Scene) -> bool:
    return not scene.mesh.is_closed and isfinite(scene.mesh.column(scene.body.reach(scene.probe.frame_on(scene.body))))


def _is_level(scene: Scene) -> bool:
    return is_level(scene.body, scene.probe.frame_on(scene.body))


def _is_oblique(scene: Scene) -> bool:
    along = scene.probe.frame_on(scene.body).along
    return scene.probe.slit is not None and max(map(abs, along)) < 1 - _ALIGNED


def _is_flat(scene: Scene) -> bool:
    return is_flat(scene.body, scene.probe, scene.probe.frame_on(scene.body))


FEATURES: dict[str, Feature] = {
    "layers": Feature("body.layer", lambda s: isinstance(s.body, Layered) and bool(s.body.layer)),
    "inclusion": Feature("body.inclusion", lambda s: bool(s.body.inclusion)),
    "curved body": Feature("body.shape", lambda s: not isinstance(s.body, Layered)),
    "large strains": Feature("material.law", lambda s: s.material.is_large),
    "ν < 0.2 or > 0.45": Feature(
        "material.poisson", lambda s: not s.material.OF_LARGE[0] <= s.material.poisson <= s.material.OF_LARGE[1]
    ),
    "ν > 0.49": Feature("material.poisson", lambda s: s.material.poisson > MOST_OF_GREEN),
    "tool that is not flat": Feature("probe.shape", lambda s: isinstance(s.probe, Indenter)),
    "found contact": Feature("probe.contact", lambda s: s.probe.is_unilateral),
    "frictionless contact": Feature("probe.contact", lambda s: s.probe.contact == "frictionless"),
    "slice": Feature("probe.slice", lambda s: getattr(s.probe, "slice", 0.0) != 0, write=in_mm),
    "slit": Feature("probe.incision", lambda s: s.probe.slit is not None, write=in_mm),
    "open slit": Feature("probe.ends", lambda s: bool(s.probe.slit and s.probe.slit.is_open)),
    "oblique slit": Feature("probe.direction", _is_oblique, ("body",), list),
    "six motions": Feature("probe.motion", lambda s: s.probe.motion == "all"),
    "range of depths": Feature(
        "probe.depth_range",
        lambda s: bool(getattr(s.probe, "depth_range", None)),
        write=lambda depths: [in_mm(depth) for depth in depths],
    ),
    "curved or inclined surface": Feature("probe.axis", lambda s: not _is_flat(s), ("body",)),
    "no flat top": Feature("body.shape", lambda s: not (isinstance(s.body, Layered) and _is_level(s)), ("probe",)),
    "body of triangles": Feature("body.shape", lambda s: isinstance(s.body, FromFile) and not s.body.HAS_NAMES),
    "held at its sides": Feature("body.fixed", lambda s: s.body.support.gap(0.0) == 0.0),
    "held at its sides alone": Feature("body.fixed", lambda s: not s.body.support.holds_column()),
    "cut free": Feature("mesh.outside", lambda s: s.mesh.outside == "free" and isfinite(s.mesh.epsilon)),
    "kept column": Feature("mesh.outside", _is_column, _PLACE),
    "fixed column": Feature("mesh.outside", lambda s: s.mesh.outside == "fixed" and _is_column(s), _PLACE),
    "half ball": Feature("mesh.outside", _is_ball, _PLACE),
    "own far field": Feature("mesh.outside", lambda s: s.mesh.outside == "green" and _is_ball(s), _PLACE),
    "part of the body": Feature("mesh.outside", lambda s: s.mesh.outside != "coarse" and isfinite(s.mesh.epsilon)),
    "degree 1": Feature("mesh.degree", lambda s: s.mesh.degree == 1, write=int),
    "mixed elements": Feature("mesh.element", lambda s: s.mesh.element == "mixed"),
    "accuracy": Feature("mesh.accuracy", lambda s: s.mesh.accuracy is not None),
    "loads": Feature("load", lambda s: s.load.acts),
}

_COARSE = 'use outside = "coarse" here'
_ONE_MATERIAL = f"the far field is that of one material, without layers or inclusions: {_COARSE}"
_PRESSES = f"the far field is that of a probe that presses, and neither slides nor turns nor cuts: {_COARSE}"
_HOLDS = 'a probe that tissue slides along holds it in one direction only: use contact = "bonded"'
_LINEAR = "is for linear elasticity, not for a law of large displacements"
_OF_LAW = "with a law of large displacements"

REFUSALS: tuple[Refusal, ...] = (
    # What the shapes have no keys for: the schema refuses it.
    Refusal("layers", "curved body", "layers lie below the flat top of a box or a cylinder"),
    Refusal("tool that is not flat", "frictionless contact", "how much of it touches is found, not prescribed"),
    # A half ball that a far field closes.
    Refusal("half ball", "accuracy", "has an error of its own, which is not that of the mesh: leave accuracy out"),
    Refusal("degree 1", "half ball", "is too low for a half ball, which straight elements cut: use 2 or 3"),
    Refusal(
        "half ball",
        "no flat top",
        f"the far field is that of a probe that presses straight down on the top of a box or a cylinder: {_COARSE}",
    ),
    Refusal("half ball", "layers", _ONE_MATERIAL),
    Refusal("half ball", "inclusion", _ONE_MATERIAL),
    Refusal("half ball", "slice", _PRESSES),
    Refusal("half ball", "slit", _PRESSES),
    Refusal("half ball", "six motions", _PRESSES),
    Refusal(
        "ν > 0.49",
        "own far field",
        f'is too near to 0.5 for outside = "green": at most {MOST_OF_GREEN}; "halfspace" takes all',
    ),
    # A column that is kept of the body.
    Refusal(
        "kept column",
        "body of triangles",
        f"a column is cut out of bodies that are drawn and of CAD files, and not out of triangles: {_COARSE}",
    ),
    Refusal("fixed column", "open slit", 'is what an open slit would run into: use ends = "blade"'),
    Refusal(
        "cut free",
        "held at its sides alone",
        "the column round the probe does not touch the fixed sides and would float: "
        'use `outside = "coarse"` or "fixed", or fix the bottom',
    ),
    Refusal(
        "open slit", "held at its sides", 'the slit would go through the sides, which are held: use ends = "blade"'
    ),
    # Degrees of elements.
    Refusal(
        "degree 1",
        "found contact",
        "is too low where contact is found: its edge falls between straight elements; use 2 or 3",
    ),
    Refusal("degree 1", "inclusion", "is too low for inclusions, which straight elements cut: use 2 or 3"),
    Refusal("degree 1", "curved or inclined surface", "is too low for a curved surface, or a tilted probe: use 2 or 3"),
    Refusal("degree 1", "slit", "is too low for a slit, whose front needs quarter points: use 2 or 3"),
    Refusal("mixed elements", "degree 1", "there is no stable mixed element of degree 1: use 2 or 3"),
    # Tools and how they touch.
    Refusal("six motions", "found contact", _HOLDS),
    Refusal("six motions", "frictionless contact", _HOLDS),
    Refusal("six motions", "slit", "a blade in a slit is pressed and drawn only: leave it out"),
    Refusal(
        "found contact",
        "slice",
        'tissue does not lift off a blade that slides along: use contact = "bonded"',
    ),
    Refusal(
        "found contact",
        "slit",
        'tissue does not lift off a blade in a slit: use contact = "bonded" or "frictionless"',
    ),
    Refusal(
        "slice",
        "frictionless contact",
        'a frictionless blade slides along without force: use contact = "bonded"',
    ),
    Refusal("slit", "no flat top", "a slit goes straight down from the flat top of a box or a cylinder only"),
    Refusal(
        "oblique slit",
        "frictionless contact",
        "tissue slides along a blade in a slit that lies along x or y only: turn the body, or use contact = 'bonded'",
    ),
    Refusal(
        "range of depths",
        "accuracy",
        "is for meshes with sizes of your own: where an accuracy is asked for, each depth has one that is chosen for "
        "it; leave one of the two out",
    ),
    # Loads.
    Refusal(
        "part of the body",
        "loads",
        'loads act on the whole body, and a part of it would carry others: use outside = "coarse"',
    ),
    Refusal("large strains", "loads", 'loads are computed with law = "linear" only: leave [load] out'),
    # Large strains.
    Refusal(
        "ν < 0.2 or > 0.45",
        "large strains",
        f"must be {Material.OF_LARGE[0]} to {Material.OF_LARGE[1]} {_OF_LAW}: below, tissue gives way at the probe's "
        "edge, and elements of displacements alone lock above",
    ),
    Refusal("large strains", "layers", "takes bodies of one material: no layers, no inclusions"),
    Refusal("large strains", "inclusion", "takes bodies of one material: no layers, no inclusions"),
    Refusal("found contact", "large strains", f'must be "bonded" {_OF_LAW}: where a tool touches is not found there'),
    Refusal("frictionless contact", "large strains", f'must be "bonded" {_OF_LAW}'),
    Refusal("six motions", "large strains", f'must be "press" {_OF_LAW}: one stiffness says nothing then'),
    Refusal("slit", "large strains", _LINEAR),
    Refusal("slice", "large strains", f"must be 0 mm {_OF_LAW}: the blade is pressed in only"),
    Refusal("mixed elements", "large strains", f'must be "auto" or "displacement" {_OF_LAW}'),
    Refusal("accuracy", "large strains", f"{_LINEAR}: give sizes"),
    Refusal("half ball", "large strains", f'must be "coarse", "free" or "fixed" {_OF_LAW}'),
)

_PRESSED_ONLY = "a model is of tools that press straight down, and neither slide nor turn nor cut"
# Of each way that may be shorter, the features with which it is not taken, each with the reason.
OBSTACLES: dict[str, dict[str, str]] = {
    "meridian": {
        "large strains": "there are no elements for large strains on the meridian",
        "six motions": "most of the six motions are not the same all round",
        "half ball": "a half ball is closed in three dimensions",
        "loads": "loads are computed in three dimensions",
    },
    # Taken if no case of the study is in the way: what is compared is computed alike.
    "meridian of a comparison": {
        "large strains": "what large strains are compared with is solved in three dimensions, too",
        "half ball": "what a half ball is compared with is solved in three dimensions, too",
    },
    "reduced basis": {
        "layers": "a body of several materials has more parameters than one",
        "inclusion": "a body of several materials has more parameters than one",
        "found contact": "the area of contact changes with Poisson's ratio",
        "half ball": "the far field changes with Poisson's ratio",
        "large strains": "large displacements are not sums of others",
        "slit": "in a slit more is asked for than the work",
        "loads": "loads do work of their own",
    },
    "scaling": {
        "loads": "loads do not grow with the modulus and the depth",
    },
    "images": {
        "six motions": "a stiffness of all motions is no image of another",
        "loads": "loads tell one side from the other",
    },
    "equivalent places": {
        "inclusion": "an inclusion is at another distance",
        "loads": "loads act on all of the body",
        "own far field": "a body's own far field knows the place",
    },
    "proportional depths": {
        "loads": "loads do not grow with the depth",
        "large strains": "large strains are not in proportion to the depth",
    },
    "F_exact": {
        "large strains": "at large displacements, what elements converge to is known to their bars only",
    },
    "real-time model": {
        "loads": "[load]: gravity and tractions have no real-time model yet",
        "large strains": "material.law: large displacements have no real-time model: F is in proportion to nothing",
        "slit": f"probe.incision: {_PRESSED_ONLY}",
        "six motions": f'probe.motion = "all": {_PRESSED_ONLY}',
        "slice": f"probe.slice: {_PRESSED_ONLY}",
    },
}


def features_of(scene: Scene) -> frozenset[str]:
    """Return the names of the features that a scene has."""
    return frozenset(name for name, feature in FEATURES.items() if feature.holds(scene))


def obstacle(way: str, scene: Scene) -> str:
    """Return why a shorter way of computing is not taken for a scene; "" if none of its features is in the way."""
    return next((reason for name, reason in OBSTACLES[way].items() if FEATURES[name].holds(scene)), "")


def check_features(
    sections: Mapping[str, Sequence[Section]], placed: Sequence[tuple[Body, Probe]], problems: Problems
) -> None:
    """Report every pair of features that do not go together; ``placed`` are the bodies and probes that fit together."""

    @cache
    def occurs(name: str) -> bool:
        feature = FEATURES[name]
        return any(map(feature.holds, _scenes(feature.parts, sections, placed)))

    for refusal in REFUSALS:
        if not (occurs(refusal.first) and occurs(refusal.second)):
            continue
        first, second = FEATURES[refusal.first], FEATURES[refusal.second]
        for scene in _scenes((*first.parts, *second.parts), sections, placed):
            if first.holds(scene) and second.holds(scene):
                with problems.about(**vars(scene)):
                    problems.error(first.key, first.value(scene), refusal.reason)


def _scenes(
    parts: Sequence[str], sections: Mapping[str, Sequence[Section]], placed: Sequence[tuple[Body, Probe]]
) -> Iterator[Scene]:
    """Yield what there is of these parts: of bodies with probes, those that fit together."""
    is_placed = {*_PLACE} <= {*parts}
    names = [name for name in _PARTS if name in parts and not (is_placed and name in _PLACE)]
    others: list[Sequence[Any]] = [sections[name] for name in names]
    for pair, *rest in product(placed if is_placed else ((),), *others):
        scene = SimpleNamespace(**dict(zip(_PLACE, pair, strict=False)), **dict(zip(names, rest, strict=True)))
        yield cast(Scene, scene)
