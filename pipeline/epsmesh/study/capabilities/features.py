"""Features of a scene: what a study sets, and what follows from it, each with the key that sets it.

:mod:`.refusals` and :mod:`.obstacles` name features by their keys in ``FEATURES``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf, isfinite
from typing import Any, Protocol

from epsmesh.shapes.body import Body, Drawn, Layered
from epsmesh.shapes.capsule import Capsule
from epsmesh.shapes.contact import is_flat, is_inclined, is_level
from epsmesh.shapes.from_file import FromFile
from epsmesh.shapes.grasp import opposite
from epsmesh.shapes.insertion import Inserted
from epsmesh.shapes.probe import STICK, Probe
from epsmesh.shapes.registry import TERMS
from epsmesh.shapes.section import in_mm
from epsmesh.shapes.support import NONE
from epsmesh.shapes.term import BodyTerm
from epsmesh.shapes.tissue import Tissue
from epsmesh.study.loads import Load
from epsmesh.study.regions import tissues_of
from epsmesh.study.schema import Material, Mesh
from epsmesh.viscoelastic import Terms

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

    ``also`` are other sections on which the feature depends. ``where`` returns key and value of a scene that has it, if
    the key differs from scene to scene.
    """

    key: str
    holds: Callable[[Scene], bool]
    also: tuple[str, ...] = ()
    write: Callable[[Any], Any] = lambda value: value if isinstance(value, str | float) else None
    where: Callable[[Scene], tuple[str, Any] | None] = lambda _: None

    @property
    def parts(self) -> tuple[str, ...]:
        """The sections of a scene on which the feature depends."""
        return self.key.partition(".")[0], *self.also

    def told(self, scene: Scene) -> tuple[str, Any]:
        """Return key and value of a scene that has it, as a message quotes them; None if no value is worth quoting."""
        section, _, name = self.key.partition(".")
        key, value = self.where(scene) or (self.key, getattr(getattr(scene, section, None), name, None))
        return key, self.write(value)


def _of_tissue(name: str, has: Callable[[Tissue], bool], **how: Any) -> Feature:
    """Return the feature that a tissue has by its key ``name``: a scene has it if one of its tissues does."""

    def first(scene: Scene) -> tuple[str, Any] | None:
        tissues = tissues_of(scene.body, scene.material)
        return next(((f"{place}.{name}", getattr(tissue, name)) for place, tissue in tissues if has(tissue)), None)

    return Feature(f"material.{name}", lambda scene: first(scene) is not None, ("body",), where=first, **how)


# Sections that fit together in pairs only: the probe is somewhere on the body.
PLACE = ("body", "probe")


def _is_ball(scene: Scene) -> bool:
    return scene.mesh.is_closed and scene.mesh.epsilon < scene.body.farthest(scene.probe.frame_on(scene.body))


def _is_column(scene: Scene) -> bool:
    return not scene.mesh.is_closed and isfinite(scene.mesh.column(scene.body.reach(scene.probe.frame_on(scene.body))))


def touches_inclined(scene: Scene) -> bool:
    """Return whether a linear law has contact whose normal is not the tool's axis: large laws have their own."""
    if not scene.probe.is_unilateral or _is_large(scene):
        return False
    return is_inclined(scene.body, scene.probe, scene.probe.frame_on(scene.body))


def _jaw_touches_inclined(scene: Scene) -> bool:
    jaw = opposite(scene.body, scene.probe)
    return jaw is not None and not _is_large(scene) and is_inclined(scene.body, jaw, jaw.frame_on(scene.body))


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
    """Return the different relaxations of a body's regions."""
    body, main = scene.body, scene.body.main(scene.material)
    return {main.prony, *(body.completed(region, main).prony for region in body.regions)}


def _is_large(scene: Scene) -> bool:
    return scene.body.main(scene.material).is_large


def _coefficient(friction: float) -> float | str:
    return STICK if friction == inf else friction


def _is_inserted(scene: Scene, cuts: str | None = None) -> bool:
    found = scene.probe if isinstance(scene.probe, Inserted) and scene.probe.insertion else None
    return found is not None and cuts in (None, found.CUTS)


def _may_cut_a_ring(scene: Scene) -> bool:
    return _is_inserted(scene) and getattr(scene.probe, "crack_shape", "plane") != "plane"


def is_loaded(scene: Scene) -> bool:
    """Return whether dead loads act: gravity, tractions, or pressure in hollow regions."""
    return scene.load.acts or bool(scene.body.pressures)


def imaged_load(scene: Scene) -> Load | None:
    """Return the load, of a case, under which the body has its given shape; None if it has it without load."""
    load = scene.load.model_copy(update={"traction": ()}) if scene.body.is_loaded == "gravity" else scene.load
    return load if scene.body.is_loaded != "none" and load.acts else None


def _is_imaged(scene: Scene) -> bool:
    by_gravity, by_all = scene.body.is_loaded == "gravity", scene.body.is_loaded == "all"
    return (by_gravity and any(scene.load.gravity)) or (by_all and is_loaded(scene))


def terms_of(scene: Scene) -> tuple[BodyTerm, ...]:
    """Return the terms of the energy besides the law's: those of [load], and capsules."""
    return (*scene.load.terms, *scene.body.capsules.values())


def has_terms(scene: Scene) -> bool:
    """Return whether anything acts on the body besides its law, the tool and dead loads: terms, a support that lets
    go, a loose layer, a second jaw, or a tool that deforms."""
    touched = scene.body.resting, scene.body.loose, scene.probe.jaw, scene.probe.elastic
    return bool(terms_of(scene)) or any(one is not None for one in touched)


def _of_capsule(key: str = "", has: Callable[[Capsule, Body], bool] = lambda *_: True, **how: Any) -> Feature:
    """Return the feature that a capsule, of the body or a region of it, has by its ``key``."""

    def first(scene: Scene) -> tuple[str, Any] | None:
        found = (place for place, one in scene.body.capsules.items() if has(one, scene.body))
        return next(((f"body.{place}{key}", None) for place in found), None)

    return Feature(f"body.capsule{key}", lambda scene: first(scene) is not None, where=first, **how)


def _moves_surface(scene: Scene) -> bool:
    """Return whether the depth counts from the surface as loads leave it, and not from the undeformed one."""
    return is_loaded(scene) and (scene.probe.is_unilateral or _is_large(scene) or has_terms(scene))


def _contact_of_layer(scene: Scene) -> tuple[str, Any] | None:
    loose = scene.body.loose
    return None if loose is None else (f"body.{loose.place}.contact", "unilateral")


def _friction_of_layer(scene: Scene) -> tuple[str, Any] | None:
    loose = scene.body.loose
    return None if loose is None else (f"body.{loose.place}.friction", loose.friction)


def _has_term(scene: Scene, name: str) -> bool:
    return bool(getattr(scene.load, name))


def _wants_exact(scene: Scene) -> bool:
    solve = getattr(scene, "solve", None)
    return solve is not None and bool(solve.wants_exact(scene.mesh))


def _wants_influence(scene: Scene) -> bool:
    solve = getattr(scene, "solve", None)
    return solve is not None and bool(solve.influence)


def needs_time_steps(scene: Scene) -> bool:
    """Return whether the force over time is no elastic force times a function of time."""
    if scene.probe.history is None:
        return False
    is_followed = scene.probe.friction > 0 or (scene.probe.is_unilateral and is_loaded(scene))
    return _is_large(scene) or len(_relaxations(scene)) > 1 or has_terms(scene) or is_followed


def _is_off_axis(scene: Scene) -> bool:
    return scene.body.half_plane() is None or any(scene.probe.at)


def _is_in_space(scene: Scene) -> bool:
    """Return whether a scene is certainly no axisymmetric one; of others, the plan knows."""
    return _is_off_axis(scene) or not scene.probe.is_round or scene.mesh.model == "3d"


def _is_curved_support(scene: Scene) -> bool:
    return scene.body.resting is not None and not scene.body.resting.is_flat


def _has_path_on_support(scene: Scene) -> bool:
    """Return whether friction with a support that lets go is followed: a bottom sticks to a plane from the start."""
    rest = scene.body.resting
    return rest is not None and rest.friction > 0 and (rest.friction < inf or not rest.fits)


def _is_middle(scene: Scene) -> bool:
    """Return whether the tool presses down along the axis of the body."""
    frame = scene.probe.frame_on(scene.body)
    return frame.is_upright and frame.point[:2] == (0.0, 0.0)


def _of_support(name: str) -> Callable[[Scene], tuple[str, Any] | None]:
    """Return what tells a key of a support that lets go."""

    def told(scene: Scene) -> tuple[str, Any] | None:
        rest = scene.body.resting
        return None if rest is None else (f"body.support.{name}", getattr(rest, name))

    return told


FEATURES: dict[str, Feature] = {
    "layers": Feature("body.layer", lambda s: isinstance(s.body, Layered) and bool(s.body.layer)),
    "inclusion": Feature("body.inclusion", lambda s: bool(s.body.inclusion)),
    "region": Feature("body.region", lambda s: "region" in s.body.pieces),
    "region of a drawn body": Feature("body.region", lambda s: "region" in s.body.pieces and isinstance(s.body, Drawn)),
    "curved body": Feature("body.shape", lambda s: not isinstance(s.body, Layered)),
    "large displacements": Feature("material.law", _is_large, ("body",)),
    "relaxation": Feature("material.relaxation", lambda s: any(_relaxations(s)), ("body",)),
    "static relaxing tissue": Feature(
        "probe.history", lambda s: any(_relaxations(s)) and s.probe.history is None, ("body", "material")
    ),
    "time steps": Feature("probe.history", needs_time_steps, ("body", "material", "load")),
    "time steps in three dimensions": Feature(
        "probe.history", lambda s: needs_time_steps(s) and _is_in_space(s), ("body", "material", "mesh", "load")
    ),
    "fibres": _of_tissue("law", lambda tissue: tissue.has_fibres),
    "varying stiffness": _of_tissue("young", lambda tissue: tissue.varying is not None, write=lambda _: None),
    "stiffness that is not round": _of_tissue(
        "young", lambda tissue: tissue.varying is not None and not tissue.varying.is_round, write=lambda _: None
    ),
    "spread": _of_tissue("spread", lambda tissue: tissue.spread is not None, write=lambda _: None),
    # Of regions, those of layers that fill the body included, the study's check of laws reports it.
    "ν < 0.2": Feature(
        "material.poisson",
        lambda s: not s.body.is_filled and s.material.poisson < Material.LEAST_OF_LARGE,
        ("body",),
    ),
    "ν > 0.49": Feature("material.poisson", lambda s: s.material.poisson > MOST_OF_GREEN),
    "tool that is not flat": Feature("probe.shape", lambda s: not s.probe.is_flat),
    "unilateral contact": Feature("probe.contact", lambda s: s.probe.is_unilateral),
    "flat tool that may lift off": Feature("probe.contact", lambda s: s.probe.is_unilateral and s.probe.is_flat),
    "frictionless contact": Feature("probe.contact", lambda s: s.probe.contact == "frictionless"),
    "rounded edge": Feature("probe.edge", _has_edge, write=in_mm),
    "rounded edge of a prescribed footprint": Feature(
        "probe.contact", lambda s: _has_edge(s) and not s.probe.is_unilateral
    ),
    "friction": Feature("probe.friction", lambda s: s.probe.friction > 0, write=_coefficient),
    "friction that slides": Feature("probe.friction", lambda s: 0 < s.probe.friction < inf, write=_coefficient),
    "inclined touch of a linear law": Feature("probe.axis", touches_inclined, ("body", "material"), list),
    "inclined touch of a second jaw": Feature("probe.axis", _jaw_touches_inclined, ("body", "material"), list),
    "given force": Feature("probe.force", lambda s: s.probe.force is not None, write=lambda force: f"{force:.6g} N"),
    "history": Feature("probe.history", lambda s: s.probe.history is not None),
    "slice": Feature("probe.slice", lambda s: getattr(s.probe, "slice", 0.0) != 0, write=in_mm),
    "slit": Feature("probe.incision", lambda s: s.probe.slit is not None, write=in_mm),
    "open slit": Feature("probe.ends", lambda s: bool(s.probe.slit and s.probe.slit.is_open)),
    "oblique slit": Feature("probe.direction", _is_oblique, ("body",), list),
    "insertion": Feature("probe.insertion", _is_inserted, write=lambda one: in_mm(one.to)),
    "inserted blade": Feature("probe.insertion", lambda s: _is_inserted(s, "slit")),
    "inserted needle": Feature("probe.insertion", lambda s: _is_inserted(s, "crack")),
    "ring crack": Feature("probe.crack_shape", _may_cut_a_ring),
    "needle that cuts": Feature("probe.toughness", lambda s: s.probe.crack is not None),
    "linear law": Feature("material.law", lambda s: not _is_large(s), ("body",)),
    "model in three dimensions": Feature("mesh.model", lambda s: s.mesh.model == "3d"),
    "no round scene": Feature("probe.at", _is_off_axis, PLACE, list),
    "six motions": Feature("probe.motion", lambda s: s.probe.motion == "all"),
    "range of depths": Feature(
        "probe.mesh_depths",
        lambda s: bool(getattr(s.probe, "mesh_depths", None)),
        write=lambda depths: [in_mm(depth) for depth in depths],
    ),
    "curved or inclined surface": Feature("probe.axis", lambda s: not _is_flat(s), ("body",)),
    "no flat top": Feature("body.shape", lambda s: not (isinstance(s.body, Layered) and _is_level(s)), ("probe",)),
    "surface or image": Feature("body.shape", lambda s: isinstance(s.body, FromFile) and not s.body.HAS_NAMES),
    "fixed sides": Feature("body.fixed", lambda s: s.body.hold.gap(0.0) == 0.0),
    "only sides fixed": Feature("body.fixed", lambda s: not s.body.hold.holds_column()),
    "free column": Feature("mesh.outside", lambda s: s.mesh.outside == "free" and isfinite(s.mesh.epsilon)),
    "column": Feature("mesh.outside", _is_column, PLACE),
    "fixed column": Feature("mesh.outside", lambda s: s.mesh.outside == "fixed" and _is_column(s), PLACE),
    "half ball": Feature("mesh.outside", _is_ball, PLACE),
    "Green's function": Feature("mesh.outside", lambda s: s.mesh.outside == "green" and _is_ball(s), PLACE),
    "fine and coarse parts": Feature("mesh.epsilon", lambda s: s.mesh.keeps_all and isfinite(s.mesh.epsilon)),
    "linear outside": Feature("mesh.outside", lambda s: s.mesh.outside == "linear" and isfinite(s.mesh.epsilon)),
    "truncated body": Feature("mesh.outside", lambda s: not s.mesh.keeps_all and isfinite(s.mesh.epsilon)),
    "degree 1": Feature("mesh.degree", lambda s: s.mesh.degree == 1, write=int),
    "mixed elements": Feature("mesh.element", lambda s: s.mesh.element == "mixed"),
    "accuracy": Feature("mesh.accuracy", lambda s: s.mesh.accuracy is not None),
    "loads": Feature("load", is_loaded, ("body",)),
    "loads that move the surface": Feature("load", _moves_surface, ("body", "material", "probe")),
    "unloaded shape": Feature("body.is_loaded", _is_imaged, ("load",)),
    "terms": Feature("load", has_terms, ("body", "probe")),
    "grasp": Feature("probe.together", lambda s: s.probe.jaw is not None),
    # Of a second jaw, its table is checked: study/grasp.py.
    "prescribed footprint of a grasp": Feature(
        "probe.contact", lambda s: s.probe.jaw is not None and not s.probe.is_unilateral
    ),
    "pull": Feature("probe.pull", lambda s: s.probe.pull is not None, write=in_mm),
    "pull of one tool": Feature("probe.pull", lambda s: s.probe.pull is not None and s.probe.jaw is None),
    "pull without friction": Feature("probe.pull", lambda s: s.probe.pull is not None and s.probe.friction == 0),
    "pull of a body that is not held": Feature(
        "probe.pull", lambda s: s.probe.pull is not None and s.body.fixed == NONE and not s.load.terms, ("body", "load")
    ),
    "jaw with a sharp edge": Feature(
        "probe.contact", lambda s: s.probe.jaw is not None and s.probe.jaw.is_flat, write=lambda _: None
    ),
    "support that lets go": Feature("body.support", lambda s: s.body.resting is not None),
    "support with a path of friction": Feature(
        "body.support.friction", _has_path_on_support, where=_of_support("friction"), write=_coefficient
    ),
    "support of an organ": Feature(
        "body.support.on", lambda s: s.body.resting is not None and isinstance(s.body, FromFile), write=lambda _: None
    ),
    "hollow support": Feature("body.support.hollow", lambda s: s.body.resting is not None and s.body.resting.hollow),
    "curved support": Feature("body.support.shape", _is_curved_support, where=_of_support("shape")),
    "tool beside the middle of a curved support": Feature(
        "probe.at", lambda s: _is_curved_support(s) and not _is_middle(s), PLACE, list
    ),
    "prescribed footprint on a support that lets go": Feature(
        "probe.contact", lambda s: s.body.resting is not None and not s.probe.is_unilateral, ("body",)
    ),
    "loose layer": Feature("body.layer", lambda s: s.body.loose is not None, where=_contact_of_layer),
    "loose region": Feature(
        "body.region", lambda s: s.body.loose is not None and not s.body.loose.is_level, where=_contact_of_layer
    ),
    "level loose layer": Feature(
        "body.layer", lambda s: s.body.loose is not None and s.body.loose.is_level, where=_contact_of_layer
    ),
    "loose layer in a grasp": Feature(
        "body.layer",
        lambda s: s.body.loose is not None and s.probe.jaw is not None,
        ("probe",),
        where=_contact_of_layer,
    ),
    "loose layer that rubs": Feature(
        "body.layer", lambda s: s.body.loose is not None and 0 < s.body.loose.friction < inf, where=_friction_of_layer
    ),
    "scanned region that slides": Feature(
        "body.region",
        lambda s: s.body.loose is not None and s.body.loose.place.startswith("region") and s.body.loose.friction == 0,
        where=_friction_of_layer,
    ),
    "tool that deforms": Feature(
        "probe.young", lambda s: s.probe.elastic is not None, write=lambda young: f"{young:.6g} Pa"
    ),
    "tool of a shape that does not deform": Feature(
        "probe.shape", lambda s: s.probe.elastic is not None and s.probe.tip_shape is None
    ),
    "tool that deforms beside a plane": Feature(
        "probe.axis",
        lambda s: s.probe.elastic is not None and not (isinstance(s.body, Layered) and _is_flat(s)),
        ("body",),
        lambda axis: axis and list(axis),
    ),
    "prescribed footprint on a loose layer": Feature(
        "probe.contact", lambda s: s.body.loose is not None and not s.probe.is_unilateral, ("body",)
    ),
    "terms of loads": Feature("load", lambda s: bool(s.load.terms)),
    "capsule": _of_capsule(),
    "capsule on the surface": _of_capsule("", lambda one, body: one in body.skins),
    "capsule that bears compression": _of_capsule(
        ".tension_only", lambda one, _: not one.tension_only, write=lambda _: False
    ),
    "capsule that wrinkles under the tool": _of_capsule(
        ".tension_only", lambda one, body: one.tension_only and one in body.skins, write=lambda _: True
    ),
    "capsule that wrinkles": _of_capsule(".tension_only", lambda one, _: one.tension_only, write=lambda _: True),
    "capsule of a hollow region": _of_capsule("", lambda one, body: one.on in body.cavities),
    "tension of the capsule": _of_capsule("", lambda one, _: one.tension > 0),
    **{name: Feature(f"load.{name}", partial(_has_term, name=name), write=lambda _: None) for name in TERMS},
    # Of a case: the sections of a scene have none.
    "outputs": Feature("output", lambda s: bool(getattr(s, "outputs", ()))),
    "influence": Feature("solve.influence", _wants_influence, write=bool),
    "F_exact": Feature("solve.exact", _wants_exact, ("mesh",)),
}


def features_of(scene: Scene) -> frozenset[str]:
    """Return the names of the features that a scene has."""
    return frozenset(name for name, feature in FEATURES.items() if feature.holds(scene))
