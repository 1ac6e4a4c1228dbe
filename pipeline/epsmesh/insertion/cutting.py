"""Cutting: a blade whose slit ends where the energy release rate is the toughness.

With tip and front at a fixed distance a, the stored energy U grows by dU/dD = F − 2b G per advance D, where F drives
the blade at a fixed front, and 2b is the length of the front. Where G = Γ, the blade needs dU/dD + Γ dA/dD: the energy
that is stored, and the work of fracture.
"""

from dataclasses import dataclass, replace
from typing import Self

import scipy

from epsmesh import fitted
from epsmesh.insertion.curve import Curve
from epsmesh.insertion.near_tip import NearTip, strength
from epsmesh.insertion.states import SHORT, Scene, Solved, Tissue
from epsmesh.insertion.steps import CUTTING, Step

# A front is solved again if it is this much farther ahead than where it was solved.
_FARTHER = 1.1
_MOST_ROUNDS = 8
# The front is ahead by at most this many depths of the tip.
_SHALLOW = 3.5


@dataclass(frozen=True, kw_only=True)
class Cutting(Step):
    """A step of a blade with the front of its slit ``ahead`` (m) of the tip, and the ``field`` between.

    ``squeeze`` (N) is the normal force on each flank, with its bar. In the phase of indentation, the tip may be below
    the front.
    """

    ahead: float
    field: NearTip
    squeeze: float = 0.0
    squeeze_error: float = 0.0

    @property
    def front(self) -> float:
        """Depth (m) of the front of the slit."""
        return self.depth + self.ahead

    @property
    def flank(self) -> float:
        """Depth (m) to which its flanks touch tissue."""
        return min(self.depth, self.front)

    def moved(self, depth: float) -> Self:
        """Return it at another depth (m), at the same force."""
        by = depth - self.depth
        return replace(
            self, depth=depth, stored=self.stored + self.elastic * by, fracture=self.fracture + self.cutting * by
        )

    def defect(self, after: Self) -> float:
        """Return by how much the mean force (N) up to a deeper state differs from the change of the energies."""
        moved = after.depth - self.depth
        return abs((after.energy - self.energy) / moved - (after.slope + self.slope) / 2) if moved else 0.0


@dataclass(frozen=True)
class Cuts(Curve):
    """The cutting blade from one state to the next; without the first, its front stays where the next one has it."""

    before: Cutting | None
    after: Cutting

    def at(self, depth: float) -> Cutting:
        """Return the blade at a depth (m)."""
        before, after = self.before, self.after
        if before is None:
            return after.moved(depth)
        share = (depth - before.depth) / (after.depth - before.depth)
        numbers = [name for name, value in vars(before).items() if isinstance(value, float)]
        mixed = {name: (1 - share) * getattr(before, name) + share * getattr(after, name) for name in numbers}
        ends = [before.depth, after.depth]
        stored = scipy.interpolate.CubicHermiteSpline(
            ends, [before.stored, after.stored], [before.elastic, after.elastic]
        )
        return replace(after, **(mixed | {"depth": depth, "stored": float(stored(depth))}))


def cuttings(scene: Scene, depths: list[float]) -> tuple[list[Cutting], str]:
    """Return the blade cutting at each depth (m), up to the first that cannot be solved, and why it cannot."""
    places = {depth: scene.ahead(depth) for depth in depths}
    found: dict[float, Cutting] = {}
    message: dict[float, str] = {}
    for _ in range(_MOST_ROUNDS):
        again: dict[float, float] = {}
        for depth, ahead in sorted(places.items()):
            cut = scene.cut(depth, ahead)
            if isinstance(cut, str):
                message[depth] = cut
                continue
            one, farthest = _cutting(scene, depth, ahead, cut), _room(scene, depth)
            if one.ahead <= _FARTHER * ahead:
                found[depth] = one
            elif farthest <= _FARTHER * ahead:
                message[depth] = "the slit would run too far ahead of the blade, which would split the tissue"
            else:
                again[depth] = min(one.ahead, farthest)
        if not again:
            break
        places = again
    else:
        message |= dict.fromkeys(places, "the distance of the slit's front ahead of the blade does not settle")
    reached = [found[depth] for depth in depths if depth < min(message, default=float("inf"))]
    return reached, f"{1e3 * min(message):.4g} mm: {message[min(message)]}" if message else ""


def _room(scene: Scene, depth: float) -> float:
    """Return the largest distance (m) of the front ahead of a tip at a depth (m) that can be solved.

    Both the next layer, or the bottom, and the surface must be far enough.
    """
    ends = [end for end in (*scene.interfaces, scene.bottom) if end > depth]
    return min(SHORT * (min(ends) - depth), _SHALLOW * depth)


def _cutting(scene: Scene, depth: float, solved: float, cut: Solved) -> Cutting:
    """Return the blade where G is the toughness, below its tip and beside its ends, from one ``solved`` slit.

    Its front is that distance (m) ahead of the tip at a depth (m).
    """
    tissue, length, width, release = scene.at(depth), scene.blade.length, scene.blade.width, cut.energy_release
    field = NearTip.through(_strength(scene, tissue), solved, release)
    release_error = cut.energy_release_error * release
    ahead, share = field.ahead(tissue.toughness), release_error / release
    # What is between the solved front and this one, and how far the error of G moves it.
    added = length * field.per_length(ahead, solved) + field.corners(ahead, solved)
    added += sides(scene, field, depth, solved)
    moved = length * field.strength
    fracture = length * scene.tear(depth + ahead) + 2 * ahead**2 * tissue.toughness
    for layer, height in scene.above(depth):
        beside = _beside(scene, field, layer)
        end = beside.ahead(layer.toughness)
        moved += 2 * height * beside.strength
        fracture += 2 * height * end * layer.toughness
    widened, solved_front = 2 * field.per_length(ahead, solved), length + 2 * solved
    stored = cut.energy + added
    energy_error = cut.force_error * cut.energy + fitted.EXTENSION * abs(added) + share * moved
    force_error = cut.force_error * abs(cut.force) + solved_front * release_error
    return Cutting(
        phase=CUTTING,
        depth=depth,
        ahead=ahead,
        field=field,
        stored=stored,
        energy_error=energy_error,
        fracture=fracture,
        elastic=cut.force - solved_front * release + widened,
        error=force_error + fitted.EXTENSION * abs(widened) + 2 * share * field.strength,
        cutting=(length + 2 * ahead) * tissue.toughness,
        squeeze=2 * stored / width,
        squeeze_error=2 * energy_error / width,
    )


def sides(scene: Scene, field: NearTip, depth: float, solved: float) -> float:
    """Return the energy (J) that both side ends of a slit add, down to a depth (m), where G is the toughness there.

    That is to the energy with the front a ``solved`` distance (m) beside the blade.
    """
    layers = [(_beside(scene, field, layer), layer, height) for layer, height in scene.above(depth)]
    return sum(2 * height * one.per_length(one.ahead(layer.toughness), solved) for one, layer, height in layers)


def _beside(scene: Scene, field: NearTip, layer: Tissue) -> NearTip:
    """Return the field beside the blade in a layer."""
    return replace(field, strength=_strength(scene, layer))


def _strength(scene: Scene, tissue: Tissue) -> float:
    return strength(tissue.young, tissue.poisson, scene.blade.width / 2)
