"""A case: one scene with one mesh setting, and what its sections together imply."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import wraps
from math import inf
from typing import Any, Concatenate, ParamSpec, TypeVar

from epsmesh.shapes.body import Body
from epsmesh.shapes.contact import curvature_below, is_level
from epsmesh.shapes.deformable import TOOL
from epsmesh.shapes.frame import Frame, Vector
from epsmesh.shapes.grasp import opposite
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.term import BodyTerm
from epsmesh.shapes.tissue import Tissue
from epsmesh.study.axis import Axis
from epsmesh.study.capabilities.features import (
    features_of,
    has_terms,
    imaged_load,
    is_loaded,
    needs_time_steps,
    terms_of,
    touches_inclined,
)
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.closure import FarRegion
from epsmesh.study.loads import Load
from epsmesh.study.output import Output
from epsmesh.study.place import CLEAR, is_clear, place_error
from epsmesh.study.schema import Material, Mesh, Solving
from epsmesh.study.way import LINEAR, Constraint, Dimension, Motion, Way
from epsmesh.viscoelastic import Terms

Rest = ParamSpec("Rest")
Value = TypeVar("Value")

# Thickness over reach up to which a body without support below the probe is a plate (benchmarks/results/coverage.md).
_PLATE = 0.1
# What may be beyond ε besides coarse, free or fixed tissue.
BEYOND = ("linear", "halfspace", "green")
# Depth, in units of the footprint's half width, up to which quarter-point elements do not fold at large displacements.
_SHALLOW = 0.1


def of_scene(find: "Callable[Concatenate[Case, Rest], Value]") -> "Callable[Concatenate[Case, Rest], Value]":
    """Let the cases of one scene share what ``find`` returns for one of them and further, hashable arguments.

    The result must not depend on the mesh, the solver or the index of the case.
    """

    name = find.__qualname__

    @wraps(find)
    def found(case: "Case", *rest: Rest.args, **named: Rest.kwargs) -> Value:
        known, key = case.shared, (name, *rest, *named.items()) if rest or named else name
        if key not in known:
            known[key] = find(case, *rest, **named)
        result: Value = known[key]
        return result

    return found


@dataclass(frozen=True)
class Scale:
    """What results are proportional to: F to stress (Pa) × length (m), energies to that × length, strains to length."""

    stress: float
    length: float


@dataclass(frozen=True, slots=True)
class Case:
    """One scene with one mesh setting: yields one force.

    ``far_region`` is set where the body's far field is found on a mesh that many places share; None if on its own.
    ``shared`` has what is known of the scene (:func:`of_scene`): all meshes of a study's scene have one; a case that
    was changed begins anew.
    """

    index: tuple[int, ...]
    axes: tuple[Axis, ...]
    body: Body
    material: Material
    probe: Probe
    mesh: Mesh
    solve: Solving
    load: Load = field(default_factory=Load)
    far_region: FarRegion | None = None
    outputs: tuple[Output, ...] = ()
    shared: dict[Hashable, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def terms(self) -> tuple[BodyTerm, ...]:
        """What else has an energy: terms of [load], and capsules."""
        return terms_of(self)

    @property
    @of_scene
    def imaged(self) -> Load | None:
        """The load under which the body has its given shape; None if it has it without load."""
        return imaged_load(self)

    @property
    def labels(self) -> tuple[tuple[str, float | int | str], ...]:
        """Names and values of what is swept."""
        return tuple((axis.name, axis.labels[i]) for axis, i in zip(self.axes, self.index, strict=True))

    @property
    def words(self) -> dict[str, str]:
        """Names of what is swept, and values as people read them."""
        return {axis.name: axis.write(axis.labels[i]) for axis, i in zip(self.axes, self.index, strict=True)}

    @property
    @of_scene
    def frame(self) -> Frame:
        """Where the probe meets the body."""
        return self.probe.frame_on(self.body)

    @property
    @of_scene
    def expected(self) -> Probe:
        """The probe; if contact is found, as it is expected to end on a surface that is curved below it."""
        return self._expected(self.probe)

    @property
    @of_scene
    def jaw(self) -> Probe | None:
        """The second jaw, at its place; None without one."""
        return opposite(self.body, self.probe)

    @property
    @of_scene
    def expected_jaw(self) -> Probe | None:
        """The second jaw as its contact is expected to end, as that of the probe; None without one."""
        return None if self.jaw is None else self._expected(self.jaw)

    def _expected(self, tool: Probe) -> Probe:
        bump = 0.0 if tool.is_flat else curvature_below(self.body, tool, tool.frame_on(self.body))
        return tool.on_bump(bump) if bump else tool

    @property
    def features(self) -> frozenset[str]:
        """What it has of the features that :mod:`epsmesh.study.capabilities` names."""
        return features_of(self)

    @property
    @of_scene
    def no_contact(self) -> str:
        """Why there is no contact at this place of a path that may leave the body; "" if there is."""
        if not any(axis.off == "no contact" for axis in self.axes):
            return ""
        error = place_error(self.body, self.probe)
        return "" if error is None else CLEAR if is_clear(self.body, self.probe) else f"the tool does not fit: {error}"

    @property
    @of_scene
    def travel(self) -> Vector:
        """Prescribed displacement (m) of the footprint."""
        return self.probe.travel(self.frame)

    @property
    def movements(self) -> int:
        """How many solutions there are: press, slide, opening of a slit, far field, or all six motions; and loads."""
        slides = self.travel != tuple(self.probe.depth * a for a in self.frame.axis)
        motion, is_bonded = self.way.motion, self.way.constraint is Constraint.BONDED
        further = slides + (motion is Motion.FAR or (motion is Motion.SLIT and is_bonded))
        return (6 if motion is Motion.SIX else 1 + further) + self.load.acts

    @property
    @of_scene
    def tissues(self) -> tuple[Tissue, ...]:
        """What the regions of the body are made of, in the order of their numbers in meshes.

        Where layers fill the body, no cell has number 0; it is then as the first layer. The last one is that of a tool
        that deforms.
        """
        tool = self.probe.elastic
        return self.material, *self.body.regions, *(() if tool is None else (tool,))

    @property
    @of_scene
    def varies(self) -> bool:
        """Whether the stiffness varies within a region."""
        return any(tissue.varying is not None for tissue in self.tissues)

    @property
    def region_names(self) -> tuple[str, ...]:
        """Names of the regions of the mesh, in the order of their numbers: those of tissues, then of linear parts."""
        names = (*self.body.region_names, *(() if self.probe.elastic is None else (TOOL,)))
        return (*names, *(f"{name}, linear" for name in names)) if self.is_linear_beyond else names

    @property
    @of_scene
    def relaxations(self) -> tuple[Terms, ...]:
        """Terms of the relaxation of the regions of the body, in the order of their numbers."""
        return tuple(tissue.prony for tissue in self.tissues)

    @property
    @of_scene
    def densities(self) -> tuple[float | None, ...]:
        """Densities (kg/m³) of the regions of the body, in the order of their numbers; None where there is none."""
        return tuple(tissue.density for tissue in self.tissues)

    @property
    @of_scene
    def poisson(self) -> float:
        """The largest Poisson's ratio of all regions."""
        return max(tissue.poisson for tissue in self.tissues)

    @property
    def proportional_to(self) -> tuple[str, ...]:
        """The keys that F is proportional to, those of one section, or of all materials, changing together."""
        if obstacle("scaling", self):
            return ()
        first = ("young of all materials together",) if self.body.regions else self.material.PROPORTIONAL_TO
        return *first, *self.moves_in_proportion

    @property
    def moves_in_proportion(self) -> tuple[str, ...]:
        """The keys of the probe that F is proportional to: none where displacements are large."""
        return self.probe.proportional_to if self.way.is_proportional else ()

    @property
    @of_scene
    def scale(self) -> Scale:
        """The units in which its results do not depend on what they are proportional to."""
        if self.is_bent:
            return Scale(1.0, 1.0)
        return Scale(self.material.young, self.probe.scale if self.moves_in_proportion else 1.0)

    @property
    def is_bent(self) -> bool:
        """Whether loads bend the surface on which contact is found, or terms act: F is then proportional to nothing."""
        return self.way.has_terms or (self.way.is_loaded and self.way.is_found)

    @property
    def is_plain(self) -> bool:
        """Whether the probe's edge rules the error of F: what is pressed is even, and no plate."""
        return self.is_even and not self.is_plate

    @property
    @of_scene
    def is_even(self) -> bool:
        """Whether a body of one constant material is pressed straight down on a plane face."""
        is_one = not (self.varies or self.body.pieces or self.probe.elastic)
        return is_one and self.probe.slit is None and is_level(self.body, self.frame)

    @property
    @of_scene
    def is_plate(self) -> bool:
        """Whether the body has no support below the probe, and is so thin that it bends."""
        thickness = self.body.thickness(self.frame)
        return not self.body.hold.holds_column() and thickness < _PLATE * self.reach

    @property
    @of_scene
    def farthest(self) -> float:
        """Distance (m) from the point of contact to the farthest point of the body."""
        return self.body.farthest(self.frame)

    @property
    @of_scene
    def reach(self) -> float:
        """Largest distance (m) of the body from the probe's axis."""
        return self.body.reach(self.frame)

    @property
    def is_full(self) -> bool:
        """Whether the mesh is fine everywhere: ε is "full", or reaches past the whole body."""
        return self.mesh.epsilon == inf or self.mesh.epsilon >= self.farthest

    @property
    @of_scene
    def has_quarter_points(self) -> bool:
        """Whether elements at a singular edge of the probe have quarter points.

        Deep in tissue they would fold. Of slopes like r^-½, the squares in Green's strain of a capsule have no finite
        energy.
        """
        tools = (self.probe,) if self.jaw is None else (self.probe, self.jaw)
        if not any(tool.has_singular_edge for tool in tools):
            return True
        if any(capsule.tension_only for capsule in self.body.skins):
            return False
        return not self.way.is_large or self.probe.depth <= _SHALLOW * self.probe.half_width

    @property
    def column(self) -> float:
        """Radius (m) of the piece of the body that is kept round the probe's axis or, if closed, the contact.

        Infinite if all of it is kept.
        """
        return self.mesh.column(self.reach)

    @property
    def is_truncated(self) -> bool:
        """Whether only a column of the body is kept."""
        return self.column < inf

    @property
    def is_linear_beyond(self) -> bool:
        """Whether tissue beyond ε is linear elastic, and not that within."""
        return self.mesh.outside == "linear" and not self.is_full

    @property
    def is_closed(self) -> bool:
        """Whether only a half ball of the body is kept, which a far field closes."""
        return self.mesh.is_closed and not self.is_full

    @property
    def has_own_far_field(self) -> bool:
        """Whether what closes it is the Green's function of its body, and not that of a half-space."""
        return self.is_closed and self.mesh.outside == "green"

    @property
    def way(self) -> Way:
        """How it is solved; the plan may choose the half plane of a round scene."""
        # Asked several times for each case of a large study: of the mesh it depends on these alone.
        mesh = self.mesh
        key = mesh.element, mesh.degree, mesh.outside in BEYOND and not self.is_full and mesh.outside
        found: Way | None = self.shared.get(key)
        if found is None:
            found = self.shared[key] = self._find_way()
        return found

    def _find_way(self) -> Way:
        probe, laws, is_large = self.probe, LINEAR, self.material.is_large
        if is_large:
            beyond = LINEAR if self.is_linear_beyond else ()
            laws = tuple(sorted({*(str(tissue.law) for tissue in self.tissues), *beyond}))
        found = Constraint.FRICTION if probe.friction > 0 else Constraint.FOUND
        return Way(
            self.mesh.element_for(self.poisson, is_large=is_large),
            laws,
            {"bonded": Constraint.BONDED, "frictionless": Constraint.SLIDING}.get(probe.contact, found),
            needs_time_steps(self),
            Dimension.SECTION if probe.crack else Dimension.BODY,
            is_loaded=is_loaded(self),
            has_terms=has_terms(self),
            is_inclined=touches_inclined(self),
            motion=self._motion,
        )

    @property
    def _motion(self) -> Motion:
        if self.probe.motion == "all":
            return Motion.SIX
        return Motion.SLIT if self.probe.slit else Motion.FAR if self.is_closed else Motion.PRESS

    @property
    def whole(self) -> str:
        """Its name in the dataset: that of all of its stages."""
        return _named({axis.name: self.words[axis.name] for axis in self.axes if not axis.is_stage})

    def __str__(self) -> str:
        return _named(self.words)


def _named(words: dict[str, str]) -> str:
    return ", ".join(f"{name} = {text}" for name, text in words.items()) or "the one case"
