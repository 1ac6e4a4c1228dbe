"""Pairs of features that a study must not have together, each with the reason: of mechanics, or what was not built."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from types import SimpleNamespace
from typing import Any, cast

from epsmesh.shapes.body import Body
from epsmesh.shapes.capsule import Capsule
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.registry import TERMS
from epsmesh.shapes.section import Section
from epsmesh.shapes.term import BodyTerm
from epsmesh.study.capabilities.features import FEATURES, MOST_OF_GREEN, PLACE, Scene
from epsmesh.study.grasp import FOUND_TOGETHER, NOT_CLOSED
from epsmesh.study.problems import Problems
from epsmesh.study.schema import Material


@dataclass(frozen=True)
class Refusal:
    """Two features that exclude each other. The message has the key of the first."""

    first: str
    second: str
    reason: str


_COARSE = 'use outside = "coarse" here'
_ONE_MATERIAL = f"the far field is known only for one material: {_COARSE}"
_PRESSES = f"the far field is known only for a tool that presses: {_COARSE}"
_HOLDS = 'a tool that slides along the tissue has no lateral stiffness: use contact = "bonded"'
_STATIC = "omit [probe.history] and relaxation"
_IN_STEPS = "with this law or relaxation the force over time is computed in time steps"
STEPS_IN_SPACE = (
    f"{_IN_STEPS}, which meshes for an accuracy cover only where the scene is solved in two dimensions: give sizes, or "
    "use a round tool on the axis of a round body"
)
_NO_LOADS = "omit [load], and pressure in hollow regions"
_WITH_TERMS = (
    "with springs or other terms in [load], a capsule, a support that lets go, a loose layer, two jaws, or a tool that "
    "deforms"
)
_NO_TERMS = "omit them"
_TERMS: dict[str, type[BodyTerm]] = {**TERMS, "capsule": Capsule}
_LINEAR = "needs linear elasticity: omit it with a law of large displacements"
_OF_LAW = "with a law of large displacements"
# Where derivatives of F by the modulus at a place are not those of an energy, or not computed.
_NO_DERIVATIVES = {
    "friction": "with friction, F is no derivative of an energy: omit it, or friction",
    "loads that move the surface": f"the loads decide where the depth begins: {_NO_LOADS}, or omit it",
    "tension of the capsule": "the tension decides where the depth begins: omit it, or the tension",
    "half ball": 'tissue beyond the cut decides a part of F: omit it, or use outside = "coarse"',
    "slit": "the force of a blade in a slit has a part at the slit's front: omit it",
    "insertion": "along an insertion, F has parts of fracture and friction: omit it",
    "history": "is not computed over time: omit [probe.history], or it",
    "given force": "is computed at given depths: give a depth, or omit it",
}

_GRASPED = f"{NOT_CLOSED}: omit it, or `together`"
_LOOSE = "is not computed where a layer is loose"
_LIFTS = "is not computed where tissue may lift off its support: omit it, or [body.support]"

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
    Refusal("half ball", "region", _ONE_MATERIAL),
    Refusal("half ball", "varying stiffness", _ONE_MATERIAL),
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
    Refusal("column", "region", f"a column cannot be cut out of a body with regions of triangles: {_COARSE}"),
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
    Refusal("degree 1", "region", "is too low for regions of any shape, since elements are straight: use 2 or 3"),
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
        'only tissue that is bonded to the blade is carried along by a slice: use contact = "bonded"',
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
    Refusal("slit", "region", "slits in a body with regions of triangles are not computed: use an inclusion"),
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
    Refusal(
        "slit",
        "varying stiffness",
        "the energy that the slit's front releases is computed for a constant modulus: give layers or inclusions",
    ),
    # A given force, whose depth is found.
    Refusal("given force", "loads", f"loads press on the tool at depth 0 already: {_NO_LOADS}, or give a depth"),
    Refusal("given force", "history", "a history has depths of its own: omit [probe.history], or give a depth"),
    Refusal("given force", "slit", "the opening of a slit presses on the blade at depth 0 already: give a depth"),
    Refusal("given force", "slice", "the travel of a slice presses on the blade at depth 0 already: give a depth"),
    Refusal("given force", "insertion", "an insertion has depths of its own: omit [probe.insertion], or `force`"),
    # A tool that is inserted.
    Refusal("slit", "insertion", "a blade that is inserted makes its own slit: omit `incision`"),
    Refusal("slice", "insertion", "a blade that is inserted moves along its axis: omit it"),
    Refusal("history", "insertion", "an insertion has no time: omit one of the two"),
    Refusal("rounded edge", "inserted blade", "the blade of an insertion has sharp edges: omit it"),
    Refusal(
        "insertion", "no flat top", "needs the flat top of a box or a cylinder, and a blade that goes straight down"
    ),
    Refusal("inserted blade", "large displacements", f"{_LINEAR}: a blade's cut is that of small strains"),
    Refusal("inserted needle", "linear law", "needs a law of large displacements: strains are above 1"),
    Refusal("inserted needle", "fibres", "its crack is computed in isotropic tissue: use another law"),
    Refusal("ring crack", "layers", 'ends in one material: use crack_shape = "plane", or omit the layers'),
    Refusal("ring crack", "column", 'is computed in the whole body: use crack_shape = "plane", or omit epsilon'),
    Refusal(
        "inserted needle",
        "fine and coarse parts",
        'is computed on the meridian, on meshes of its own: cut the body at epsilon, outside = "free", or omit epsilon',
    ),
    Refusal(
        "inserted needle",
        "fixed column",
        'would hold the tissue that the shaft pushes aside: use outside = "free"',
    ),
    Refusal("inserted needle", "range of depths", "its depths have meshes of their own: omit it"),
    Refusal("inserted needle", "model in three dimensions", "is computed on the meridian: omit model"),
    Refusal("inserted needle", "no round scene", "needs a cylinder, and the needle on its axis"),
    Refusal("insertion", "inclusion", "needs a body of layers: cuts through inclusions are not computed"),
    Refusal("insertion", "region", "needs a body of layers: cuts through regions are not computed"),
    Refusal("insertion", "varying stiffness", "cuts are computed in tissue of a constant modulus: give layers"),
    Refusal("insertion", "loads", f"cuts in tissue under loads are not computed: {_NO_LOADS}"),
    # Where F is decided, and what a random field of the modulus does to it: its derivatives by the modulus at a place.
    *(Refusal(name, other, reason) for name in ("influence", "spread") for other, reason in _NO_DERIVATIVES.items()),
    # Loads.
    Refusal(
        "truncated body",
        "loads",
        'loads act on the whole body, so no part of it may be cut away: use outside = "coarse"',
    ),
    # The shape without load.
    Refusal("unloaded shape", "linear law", "does not change F at small displacements: omit it, or give another law"),
    Refusal("unloaded shape", "terms", f"is not computed {_WITH_TERMS}: {_NO_TERMS}"),
    Refusal("unloaded shape", "time steps", f"{_IN_STEPS}, which start from the given shape: {_STATIC}"),
    # Relaxation, and histories of the depth.
    Refusal(
        "static relaxing tissue",
        "relaxation",
        "is required with relaxation, since F depends on how long ago the tool moved: write [probe.history], with "
        'ramp = "1 s" and hold = "10 s", or omit relaxation',
    ),
    Refusal(
        "history",
        "slit",
        f"the opening of the slit has no history, and the energy release rate depends on the front's speed: {_STATIC}",
    ),
    Refusal("time steps", "six motions", f'{_IN_STEPS}, of one movement: use motion = "press"'),
    Refusal("time steps in three dimensions", "accuracy", STEPS_IN_SPACE),
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
        f'must be "bonded" {_OF_LAW}, or give the tool a rounded edge, such as edge = "0.2 mm": at a sharp one the '
        "direction of the contact force has no limit",
    ),
    Refusal(
        "frictionless contact",
        "large displacements",
        f'must be "bonded" {_OF_LAW}, or "unilateral" with a rounded edge, such as edge = "0.2 mm": a sharp edge that '
        "slides has no direction of force",
    ),
    Refusal("six motions", "large displacements", f'must be "press" {_OF_LAW}: there is no single stiffness'),
    Refusal("slit", "large displacements", _LINEAR),
    Refusal("slice", "large displacements", f"must be 0 mm {_OF_LAW}: the blade only presses"),
    Refusal(
        "linear outside",
        "fibres",
        f"fibres resist tension at any strain, and the linear law beyond epsilon is isotropic: {_COARSE}",
    ),
    # Terms of the energy: the force is found as at large displacements, and is no multiple of the depth.
    Refusal("six motions", "terms", f'must be "press" {_WITH_TERMS}: there is no single stiffness'),
    Refusal("slit", "terms", f"a slit {_WITH_TERMS} is not computed: {_NO_TERMS}"),
    Refusal("slice", "terms", f"must be 0 mm {_WITH_TERMS}: the blade only presses"),
    Refusal("insertion", "terms", f"cuts in tissue {_WITH_TERMS} are not computed: {_NO_TERMS}"),
    Refusal(
        "half ball",
        "terms",
        f"the far field has neither those of [load], nor a capsule, nor a support that lets go: {_COARSE}",
    ),
    Refusal("truncated body", "terms", f"they act on the whole body, so no part of it may be cut away: {_COARSE}"),
    Refusal("degree 1", "terms", f"is too low {_WITH_TERMS}: use 2 or 3"),
    Refusal(
        "capsule that bears compression",
        "large displacements",
        f"must be true {_OF_LAW}: a membrane that is compressed wrinkles",
    ),
    Refusal(
        "friction that slides",
        "capsule that wrinkles under the tool",
        'does not settle on a capsule that wrinkles under it: omit it, or use friction = "stick"',
    ),
    # A support that lets go: its contact is found with that of the tool.
    Refusal(
        "prescribed footprint on a support that lets go",
        "support that lets go",
        'must be "unilateral" on a support that lets go: the contacts of tool and support are found together',
    ),
    Refusal(
        "support with a path of friction",
        "tension of the capsule",
        'must be 0, or "stick" on a plane, with a capsule that is stretched before: how tissue slides while it '
        "contracts is not computed",
    ),
    Refusal(
        "support with a path of friction",
        "hollow support",
        "must be 0 in a hollow support: the body begins to touch it at edges, where friction does not settle",
    ),
    Refusal(
        "tool beside the middle of a curved support",
        "curved support",
        "is beside the middle of a curved support, on which the body would roll: press down at [0, 0] of the top, or "
        'use shape = "plane"',
    ),
    Refusal(
        "capsule on the surface",
        "support that lets go",
        "ends where a support begins, and tissue that lifts off would lie bare: omit it, or [body.support]",
    ),
    Refusal(
        "support of an organ",
        "accuracy",
        "has contact where meshes of an accuracy do not refine it, at the lowest points of the organ: give sizes",
    ),
    Refusal("support that lets go", "time steps", f"{_IN_STEPS}, in which tissue lifts off no support: {_STATIC}"),
    *(Refusal(name, "support that lets go", _LIFTS) for name in ("influence", "spread")),
    # A loose layer: its contact with the tissue below is found with that of the tool.
    Refusal(
        "prescribed footprint on a loose layer",
        "loose layer",
        'must be "unilateral" on a loose layer: its contact and that of the tool are found together',
    ),
    Refusal(
        "loose layer that rubs",
        "large displacements",
        f'must be 0 or "stick" {_OF_LAW}',
    ),
    Refusal(
        "scanned region that slides",
        "large displacements",
        f'must be "stick" {_OF_LAW}: nodes in contact do not settle on the rough surface of a scan',
    ),
    Refusal("loose layer", "support that lets go", "is not computed on a support that lets go: give body.fixed"),
    Refusal("level loose layer", "no flat top", "is not computed below a tool that presses from the side: omit it"),
    Refusal("loose layer", "pull", "is not computed with jaws that are pulled: omit `pull`"),
    Refusal(
        "loose region",
        "accuracy",
        "has edges of contact anywhere on it, which meshes of an accuracy do not refine: give sizes",
    ),
    Refusal("loose layer in a grasp", "accuracy", "has no recipe between two jaws: give sizes"),
    Refusal("loose layer", "capsule on the surface", "would be held by the capsule around it: omit one of the two"),
    *(
        Refusal("loose layer that rubs", preloaded, f'must be 0 or "stick" with {what}')
        for preloaded, what in (("loads", "loads"), ("tension of the capsule", "a capsule that is stretched before"))
    ),
    Refusal("loose layer", "time steps", f"is static, and {_IN_STEPS}: {_STATIC}"),
    *(Refusal(name, "loose layer", f"{_LOOSE}: omit it, or the layer's contact") for name in ("influence", "spread")),
    # A tool that deforms: it is a part of the mesh, above the surface that it may touch.
    Refusal(
        "tool of a shape that does not deform",
        "tool that deforms",
        'is rigid: tools that deform are a "sphere", a "cone", a "wedge" with flat ends, and a "disc" with a rounded '
        '`edge` in contact = "unilateral". Omit `young`, `poisson` and `height`',
    ),
    Refusal(
        "tool that deforms",
        "large displacements",
        f"is not computed {_OF_LAW}: its nodes would leave those of the tissue, above which they are. Omit it, for a "
        "rigid tool",
    ),
    Refusal(
        "tool that deforms beside a plane",
        "tool that deforms",
        "needs a plane face of a box or a cylinder, and a tool that presses at right angles to it, as the nodes of a "
        "tool that deforms are above those of the tissue: omit `young` for a rigid tool",
    ),
    Refusal("tool that deforms", "grasp", "is not computed with two jaws: omit it, or `together`"),
    Refusal("tool that deforms", "accuracy", "is meshed with given sizes alone: give sizes, or omit it"),
    Refusal("tool that deforms", "region", "is meshed on boxes and cylinders alone: use an inclusion, or omit it"),
    Refusal("tool that deforms", "time steps", f"is static, and {_IN_STEPS}: {_STATIC}"),
    *(
        Refusal(name, "tool that deforms", "is not computed below a tool that deforms: omit it, or probe.young")
        for name in ("influence", "spread")
    ),
    # Two jaws: the contact of the second one is found with that of the tool.
    Refusal("prescribed footprint of a grasp", "grasp", FOUND_TOGETHER),
    Refusal(
        "jaw with a sharp edge",
        "large displacements",
        f'must have a rounded edge {_OF_LAW}, such as edge = "0.2 mm": at a sharp one the direction of the contact '
        "force has no limit",
    ),
    Refusal(
        "pull",
        "pull of one tool",
        "moves both jaws of a grasp: add a second [[probe]] table with `together`, or omit it",
    ),
    Refusal("pull", "pull without friction", 'needs jaws that hold the tissue: give friction, or "stick", or omit it'),
    Refusal(
        "pull",
        "pull of a body that is not held",
        'would move the whole body without force: give body.fixed, such as "sides"',
    ),
    Refusal("pull", "accuracy", "has bars of its steps, which finer meshes keep: give sizes"),
    *(
        Refusal(
            "pull",
            inclined,
            "is across the axis, to which the surface is inclined: jaws would move in or out of the tissue, and gaps "
            "of a linear law stay. Use a law of large displacements, or an axis at right angles to the surface",
        )
        for inclined in ("inclined touch of a linear law", "inclined touch of a second jaw")
    ),
    Refusal("support that lets go", "grasp", "is not computed with two jaws: give body.fixed, or omit `together`"),
    Refusal("loads", "grasp", f"would move the body before both jaws touch it: {_NO_LOADS}, or omit `together`"),
    Refusal(
        "region of a drawn body",
        "grasp",
        "is meshed from triangles, on which drawn bodies have no second jaw: use an inclusion, or omit `together`",
    ),
    Refusal("capsule on the surface", "grasp", _GRASPED),
    Refusal("tension of the capsule", "grasp", _GRASPED),
    Refusal("range of depths", "grasp", "its depths have meshes of their own in a grasp: omit it"),
    Refusal("time steps", "grasp", f"{_IN_STEPS}, in which two jaws do not close: {_STATIC}"),
    *(Refusal(name, "grasp", _GRASPED) for name in ("influence", "spread")),
    *(Refusal(name, other, reason) for name, kind in _TERMS.items() for other, reason in kind.EXCLUDES.items()),
    Refusal("half ball", "large displacements", f'must be "coarse", "linear", "free" or "fixed" {_OF_LAW}'),
)

_PARTS = ("body", "material", "probe", "mesh", "load", "solve")


def refused(name: str, scene: Scene) -> str:
    """Return why a scene must not have a feature, which is the first of its pairs, as well; "" if it may."""
    pairs = (refusal for refusal in REFUSALS if refusal.first == name)
    return next((refusal.reason for refusal in pairs if FEATURES[refusal.second].holds(scene)), "")


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
                    problems.error(*first.told(scene), refusal.reason)


def _scenes(
    parts: Sequence[str], sections: Mapping[str, Sequence[Section]], placed: Sequence[tuple[Body, Probe]]
) -> Iterator[Scene]:
    """Yield the combinations of these sections; of bodies and probes, those that fit together."""
    is_placed = {*PLACE} <= {*parts}
    names = [name for name in _PARTS if name in parts and not (is_placed and name in PLACE)]
    others: list[Sequence[Any]] = [sections[name] for name in names]
    for pair, *rest in product(placed if is_placed else ((),), *others):
        scene = SimpleNamespace(**dict(zip(PLACE, pair, strict=False)), **dict(zip(names, rest, strict=True)))
        yield cast(Scene, scene)
