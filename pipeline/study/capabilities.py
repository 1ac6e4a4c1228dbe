"""Features that exclude each other, and why: one table, read by the study, the plan, the export and the docs.

A scene has a set of features. ``REFUSALS`` lists pairs that are errors of a study. ``OBSTACLES`` lists, for each
shorter way of computing (a reduction, a real-time model), the features that exclude it. All other pairs are computed.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import inf, isfinite
from types import SimpleNamespace
from typing import Any, Protocol, cast

from pipeline.shapes.body import Body, Layered
from pipeline.shapes.contact import first_touch, is_flat, is_level
from pipeline.shapes.from_file import FromFile
from pipeline.shapes.indenter import Indenter
from pipeline.shapes.probe import STICK, Probe
from pipeline.shapes.section import Section, in_mm
from pipeline.study.loads import Load
from pipeline.study.problems import Problems
from pipeline.study.schema import Material, Mesh
from pipeline.viscoelastic import Terms

# Poisson's ratio beyond which displacement elements of degree 2, which find a body's own far field, lock.
MOST_OF_GREEN = 0.49
# Tolerance within which a frictionless slit must be along x or y.
_ALIGNED = 1e-9


class Scene(Protocol):
    """The sections on which features depend: a case has all of them."""

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
    """A feature: the ``key`` of a study that sets it, whether a scene has it, and how its value is written.

    ``also`` are other sections on which the feature depends.
    """

    key: str
    holds: Callable[[Scene], bool]
    also: tuple[str, ...] = ()
    write: Callable[[Any], Any] = lambda value: value if isinstance(value, str | float) else None

    @property
    def parts(self) -> tuple[str, ...]:
        """The sections of a scene on which the feature depends."""
        return self.key.partition(".")[0], *self.also

    def value(self, scene: Scene) -> Any:
        """Return the value of the key, as a message quotes it; None if no value is worth quoting."""
        section, _, key = self.key.partition(".")
        return self.write(getattr(getattr(scene, section), key, None))


@dataclass(frozen=True)
class Refusal:
    """Two features that exclude each other. The message has the key of the first."""

    first: str
    second: str
    reason: str


_PARTS = ("body", "material", "probe", "mesh", "load")
_PLACE = ("body", "probe")


def _is_ball(scene: Scene) -> bool:
    return scene.mesh.is_closed and scene.mesh.epsilon < scene.body.farthest(scene.probe.frame_on(scene.body))


def _is_column(scene: Scene) -> bool:
    return not scene.mesh.is_closed and isfinite(scene.mesh.column(scene.body.reach(scene.probe.frame_on(scene.body))))


def _touches_beside(scene: Scene) -> bool:
    x, y, _ = first_touch(scene.body, scene.probe, scene.probe.frame_on(scene.body))
    return isinstance(scene.probe, Indenter) and (x, y) != (0.0, 0.0)


def _is_level(scene: Scene) -> bool:
    return is_level(scene.body, scene.probe.frame_on(scene.body))


def _is_oblique(scene: Scene) -> bool:
    along = scene.probe.frame_on(scene.body).along
    return scene.probe.slit is not None and max(map(abs, along)) < 1 - _ALIGNED


def _is_flat(scene: Scene) -> bool:
    return is_flat(scene.body, scene.probe, scene.probe.frame_on(scene.body))


def _has_edge(scene: Scene) -> bool:
    return getattr(scene.probe, "edge", 0.0) != 0


def _relaxations(scene: Scene) -> set[Terms]:
    """Return the different relaxations of a body's regions; of one without its own, the material's."""
    regions = scene.body.regions
    main = regions[0].prony if scene.body.is_filled else scene.material.prony
    return {main, *(region.prony or main for region in regions)}


def _coefficient(friction: float) -> float | str:
    return STICK if friction == inf else friction


def needs_time_steps(scene: Scene) -> bool:
    """Return whether the force over time is no elastic force times a function of time."""
    return scene.probe.history is not None and (scene.material.is_large or len(_relaxations(scene)) > 1)


FEATURES: dict[str, Feature] = {
    "layers": Feature("body.layer", lambda s: isinstance(s.body, Layered) and bool(s.body.layer)),
    "inclusion": Feature("body.inclusion", lambda s: bool(s.body.inclusion)),
    "curved body": Feature("body.shape", lambda s: not isinstance(s.body, Layered)),
    "large displacements": Feature("material.law", lambda s: s.material.is_large),
    "relaxation": Feature("material.relaxation", lambda s: any(_relaxations(s)), ("body",)),
    "static relaxing tissue": Feature(
        "probe.history", lambda s: any(_relaxations(s)) and s.probe.history is None, ("body", "material")
    ),
    "time steps": Feature("probe.history", needs_time_steps, ("body", "material")),
    "fibres": Feature("material.law", lambda s: any(t.has_fibres for t in (s.material, *s.body.regions)), ("body",)),
    "ν < 0.2": Feature("material.poisson", lambda s: s.material.poisson < Material.LEAST_OF_LARGE),
    "ν > 0.49": Feature("material.poisson", lambda s: s.material.poisson > MOST_OF_GREEN),
    "tool that is not flat": Feature("probe.shape", lambda s: isinstance(s.probe, Indenter)),
    "unilateral contact": Feature("probe.contact", lambda s: s.probe.is_unilateral),
    "flat tool that may lift off": Feature(
        "probe.contact", lambda s: s.probe.is_unilateral and not isinstance(s.probe, Indenter)
    ),
    "frictionless contact": Feature("probe.contact", lambda s: s.probe.contact == "frictionless"),
    "rounded edge": Feature("probe.edge", _has_edge, write=in_mm),
    "rounded edge of a prescribed footprint": Feature(
        "probe.contact", lambda s: _has_edge(s) and not s.probe.is_unilateral
    ),
    "friction": Feature("probe.friction", lambda s: s.probe.friction > 0, write=_coefficient),
    "touch beside the axis": Feature("probe.axis", _touches_beside, ("body",), list),
    "history": Feature("probe.history", lambda s: s.probe.history is not None),
    "bent surface": Feature("load", lambda s: s.load.acts and s.probe.is_unilateral, ("probe",)),
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
    "surface or image": Feature("body.shape", lambda s: isinstance(s.body, FromFile) and not s.body.HAS_NAMES),
    "fixed sides": Feature("body.fixed", lambda s: s.body.support.gap(0.0) == 0.0),
    "only sides fixed": Feature("body.fixed", lambda s: not s.body.support.holds_column()),
    "free column": Feature("mesh.outside", lambda s: s.mesh.outside == "free" and isfinite(s.mesh.epsilon)),
    "column": Feature("mesh.outside", _is_column, _PLACE),
    "fixed column": Feature("mesh.outside", lambda s: s.mesh.outside == "fixed" and _is_column(s), _PLACE),
    "half ball": Feature("mesh.outside", _is_ball, _PLACE),
    "Green's function": Feature("mesh.outside", lambda s: s.mesh.outside == "green" and _is_ball(s), _PLACE),
    "linear outside": Feature("mesh.outside", lambda s: s.mesh.outside == "linear" and isfinite(s.mesh.epsilon)),
    "truncated body": Feature("mesh.outside", lambda s: not s.mesh.keeps_all and isfinite(s.mesh.epsilon)),
    "degree 1": Feature("mesh.degree", lambda s: s.mesh.degree == 1, write=int),
    "mixed elements": Feature("mesh.element", lambda s: s.mesh.element == "mixed"),
    "accuracy": Feature("mesh.accuracy", lambda s: s.mesh.accuracy is not None),
    "loads": Feature("load", lambda s: s.load.acts),
}

_COARSE = 'use outside = "coarse" here'
_ONE_MATERIAL = f"the far field is known only for one material: {_COARSE}"
_PRESSES = f"the far field is known only for a tool that presses: {_COARSE}"
_HOLDS = 'a tool that slides along the tissue has no lateral stiffness: use contact = "bonded"'
_STATIC = "omit [probe.history] and relaxation"
_IN_STEPS = "with this law or relaxation the force over time is computed in time steps"
_LINEAR = "needs linear elasticity: omit it with a law of large displacements"
_OF_LAW = "with a law of large displacements"

REFUSALS: tuple[Refusal, ...] = (
    # What the shapes have no keys for: the schema refuses it.
    Refusal("layers", "curved body", "layers need the flat top of a box or a cylinder"),
    Refusal("tool that is not flat", "frictionless contact", "the area in contact is computed, not prescribed"),
    # A half ball that a far field closes.
    Refusal("half ball", "accuracy", "the far field adds an error that accuracy does not cover: omit accuracy"),
    Refusal("degree 1", "half ball", "is too low for a half ball, since elements are straight: use 2 or 3"),
    Refusal(
        "half ball",
        "no flat top",
        f"the far field is known only for a tool that presses straight down on a box or a cylinder: {_COARSE}",
    ),
    Refusal("half ball", "layers", _ONE_MATERIAL),
    Refusal("half ball", "inclusion", _ONE_MATERIAL),
    Refusal("half ball", "slice", _PRESSES),
    Refusal("half ball", "slit", _PRESSES),
    Refusal("half ball", "six motions", _PRESSES),
    Refusal(
        "ν > 0.49",
        "Green's function",
        f'is too near to 0.5 for outside = "green": must be at most {MOST_OF_GREEN}; "halfspace" allows all values',
    ),
    # A column that is kept of the body.
    Refusal(
        "column",
        "surface or image",
        f"a column cannot be cut out of triangles: {_COARSE}",
    ),
    Refusal("fixed column", "open slit", 'would stop the open slit at the side of the column: use ends = "blade"'),
    Refusal(
        "free column",
        "only sides fixed",
        "the column around the tool does not touch the fixed sides, and would float: "
        'use `outside = "coarse"` or "fixed", or fix the bottom',
    ),
    Refusal("open slit", "fixed sides", 'the slit would cut through the sides, which are fixed: use ends = "blade"'),
    # Degrees of elements.
    Refusal(
        "degree 1",
        "unilateral contact",
        "is too low for unilateral contact, since elements are straight: use 2 or 3",
    ),
    Refusal("degree 1", "inclusion", "is too low for inclusions, since elements are straight: use 2 or 3"),
    Refusal("degree 1", "curved or inclined surface", "is too low for a curved surface, or a tilted tool: use 2 or 3"),
    Refusal("degree 1", "slit", "is too low for a slit, whose front needs quarter-point elements: use 2 or 3"),
    Refusal("mixed elements", "degree 1", "there is no stable mixed element of degree 1: use 2 or 3"),
    # Tools and how they touch.
    Refusal(
        "rounded edge",
        "rounded edge of a prescribed footprint",
        'has no meaning where the footprint is prescribed, and ends at a sharp edge: use contact = "unilateral", or '
        "omit edge",
    ),
    Refusal("six motions", "unilateral contact", _HOLDS),
    Refusal("six motions", "frictionless contact", _HOLDS),
    Refusal("six motions", "slit", "a blade in a slit only presses and slides: omit it"),
    Refusal(
        "unilateral contact",
        "slice",
        'unilateral contact has no friction, and so no slice: use contact = "bonded"',
    ),
    Refusal(
        "unilateral contact",
        "slit",
        'tissue does not lift off a blade in a slit: use contact = "bonded" or "frictionless"',
    ),
    Refusal(
        "slice",
        "frictionless contact",
        'a frictionless blade slides without force: use contact = "bonded"',
    ),
    Refusal("friction", "half ball", f"the far field is known only for forces along the tool's axis: {_COARSE}"),
    Refusal("friction", "accuracy", "meshes for an accuracy are chosen without friction: omit one of the two"),
    Refusal("friction", "bent surface", "the path of the tissue under loads is not known: omit [load], or friction"),
    Refusal(
        "friction",
        "history",
        f"friction depends on the path, and F is not the elastic force times a function of time: {_STATIC}",
    ),
    Refusal(
        "friction",
        "touch beside the axis",
        "the tool touches beside its axis, where its surface is inclined: friction is computed about the axis. Turn "
        "the axis to the surface's normal, or omit friction",
    ),
    Refusal("slit", "no flat top", "a slit needs the flat top of a box or a cylinder, and goes straight down"),
    Refusal(
        "oblique slit",
        "frictionless contact",
        "a frictionless slit must be along x or y: turn the body, or use contact = 'bonded'",
    ),
    Refusal(
        "range of depths",
        "accuracy",
        "needs given element sizes: with `accuracy`, each depth has a mesh of its own. Omit one of the two",
    ),
    # Loads.
    Refusal(
        "truncated body",
        "loads",
        'loads act on the whole body, so no part of it may be cut away: use outside = "coarse"',
    ),
    Refusal("large displacements", "loads", 'loads need law = "linear": omit [load]'),
    # Relaxation, and histories of the depth.
    Refusal(
        "static relaxing tissue",
        "relaxation",
        "is required with relaxation, since F depends on how long ago the tool moved: write [probe.history], with "
        'ramp = "1 s" and hold = "10 s", or omit relaxation',
    ),
    Refusal(
        "history",
        "bent surface",
        f"loads bend the surface on which contact is found, and the force is no power of the depth: {_STATIC}",
    ),
    Refusal(
        "history",
        "slit",
        f"the opening of the slit has no history, and the energy release rate depends on the front's speed: {_STATIC}",
    ),
    Refusal(
        "time steps",
        "unilateral contact",
        f'{_IN_STEPS}, and the contact area is not followed over them: use contact = "bonded", or a linear law and the '
        "same relaxation in all regions",
    ),
    Refusal("time steps", "six motions", f'{_IN_STEPS}, of one movement: use motion = "press"'),
    Refusal("time steps", "loads", f"{_IN_STEPS}, and the tissue has crept under the loads before: omit [load]"),
    Refusal("time steps", "accuracy", f"{_IN_STEPS}, which meshes for an accuracy do not cover: give sizes"),
    Refusal("time steps", "half ball", f"{_IN_STEPS}, and the far field has none: {_COARSE}"),
    # Large strains.
    Refusal(
        "ν < 0.2",
        "large displacements",
        f"must be at least {Material.LEAST_OF_LARGE} {_OF_LAW}: below, F depends on the elements at the tool's edge",
    ),
    Refusal(
        "flat tool that may lift off",
        "large displacements",
        f'must be "bonded" {_OF_LAW}: at a sharp edge the direction of the contact force has no limit',
    ),
    Refusal("frictionless contact", "large displacements", f'must be "bonded" {_OF_LAW}'),
    Refusal("six motions", "large displacements", f'must be "press" {_OF_LAW}: there is no single stiffness'),
    Refusal("slit", "large displacements", _LINEAR),
    Refusal("slice", "large displacements", f"must be 0 mm {_OF_LAW}: the blade only presses"),
    Refusal("half ball", "large displacements", f'must be "coarse", "free" or "fixed" {_OF_LAW}'),
)

_PRESSED_ONLY = "real-time models are only for tools that press straight down"
# Of each way that may be shorter, the features with which it is not taken, each with the reason.
OBSTACLES: dict[str, dict[str, str]] = {
    "meridian": {
        "time steps": "time steps are computed in three dimensions",
        "fibres": "fibres have a direction, and are not axisymmetric",
        "linear outside": "the boundary of the linear part is a sphere, and no line of the mesh of the meridian",
        "six motions": "most of the six motions are not axisymmetric",
        "friction": "friction is computed in three dimensions",
        "half ball": "a half ball is coupled to its far field in three dimensions",
        "loads": "loads are computed in three dimensions",
    },
    # Taken if no case of the study is in the way: what is compared is computed alike.
    "meridian, in a comparison": {
        "time steps": "all cases of the comparison are solved in three dimensions",
        "linear outside": "all cases of the comparison are solved in three dimensions",
        "half ball": "all cases of the comparison are solved in three dimensions",
        "friction": "all cases of the comparison are solved in three dimensions",
    },
    "reduced basis": {
        "layers": "a body of several materials has more than one parameter",
        "inclusion": "a body of several materials has more than one parameter",
        "unilateral contact": "the contact area changes with Poisson's ratio",
        "half ball": "the far field changes with Poisson's ratio",
        "large displacements": "the problem is nonlinear",
        "slit": "a slit has results besides F",
        "loads": "loads have results besides F",
        "time steps": "a history in time steps is no static solution",
    },
    "scaling": {
        "loads": "their force is not proportional to modulus and depth",
    },
    "images": {
        "fibres": "the direction of the fibres differs in a mirror image",
        "six motions": "the 6 × 6 stiffness differs in a mirror image",
        "loads": "loads break the symmetry",
    },
    "equivalent places": {
        "fibres": "the direction of the fibres is fixed in the body",
        "inclusion": "the distance to the inclusion differs",
        "loads": "loads act on the whole body",
        "Green's function": "the Green's function of the body depends on the place",
    },
    "proportional depths": {
        "loads": "their force is not proportional to the depth",
        "large displacements": "F is not proportional to the depth",
    },
    "F_exact": {
        "time steps": "F_exact is static, and these forces are no multiples of static ones",
        "friction": "with friction, F_exact would not be more accurate than F on a fine mesh",
        "large displacements": "at large displacements, F_exact would not be more accurate than F on a fine mesh",
    },
    "real-time model": {
        "rounded edge": "probe.edge: real-time models have sharp edges. Omit it",
        "friction": "probe.friction: real-time models have no friction. Omit it and export the frictionless force",
        "loads": "[load]: gravity and tractions have no real-time model",
        "large displacements": "material.law: large displacements have no real-time model",
        "relaxation": "material.relaxation: real-time models are elastic, and have no time. Omit it and export the "
        "instantaneous force",
        "slit": f"probe.incision: {_PRESSED_ONLY}",
        "six motions": f'probe.motion = "all": {_PRESSED_ONLY}',
        "slice": f"probe.slice: {_PRESSED_ONLY}",
    },
}


def features_of(scene: Scene) -> frozenset[str]:
    """Return the names of the features that a scene has."""
    return frozenset(name for name, feature in FEATURES.items() if feature.holds(scene))


def obstacle(way: str, scene: Scene) -> str:
    """Return why a scene excludes a shorter way of computing; "" if it does not."""
    return next((reason for name, reason in OBSTACLES[way].items() if FEATURES[name].holds(scene)), "")


def check_features(
    sections: Mapping[str, Sequence[Section]], placed: Sequence[tuple[Body, Probe]], problems: Problems
) -> None:
    """Report every pair of features that exclude each other; ``placed`` are the bodies and probes that fit together."""

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
    """Yield the combinations of these sections; of bodies and probes, those that fit together."""
    is_placed = {*_PLACE} <= {*parts}
    names = [name for name in _PARTS if name in parts and not (is_placed and name in _PLACE)]
    others: list[Sequence[Any]] = [sections[name] for name in names]
    for pair, *rest in product(placed if is_placed else ((),), *others):
        scene = SimpleNamespace(**dict(zip(_PLACE, pair, strict=False)), **dict(zip(names, rest, strict=True)))
        yield cast(Scene, scene)
