"""Cutting: a blade whose slit ends where the energy release rate is the toughness.

With tip and front at a fixed distance a, the stored energy U grows by dU/dD = F − 2b G per advance D, where F drives
the blade at a fixed front, and 2b is the length of the front. Where G = Γ, the blade needs dU/dD + Γ dA/dD: the energy
that is stored, and the work of fracture.
"""

from dataclasses import dataclass, replace
from typing import Self

import scipy

from epsmesh.insertion.near_tip import EXTENSION_ERROR, NearTip, strength
from epsmesh.insertion.states import SHORT, Cut, Scene, Tissue
from epsmesh.insertion.steps import CUTTING, INDENTATION

# A front is solved again if it is this much farther ahead than where it was solved.
_FARTHER = 1.1
_MOST_ROUNDS = 8
# The front is ahead by at most this many depths of the tip.
_SHALLOW = 3.5


@dataclass(frozen=True)
class Cutting:
    """A blade that cuts, its tip at ``depth`` (m) and the front of the slit ``ahead`` (m), in the ``field`` between.

    ``stored`` and ``fracture`` are energies (J) since the first touch; ``elastic`` and ``cutting`` the parts of the
    force (N), ``squeeze`` (N) the normal force on each flank. Those with an error have its 95 % bar. In the ``phase``
    of indentation, the tip is below the front.
    """

    depth: float
    ahead: float
    field: NearTip
    stored: float = 0.0
    stored_error: float = 0.0
    fracture: float = 0.0
    elastic: float = 0.0
    elastic_error: float = 0.0
    cutting: float = 0.0
    squeeze: float = 0.0
    squeeze_error: float = 0.0
    phase: str = CUTTING

    @property
    def energy(self) -> float:
        """Stored energy and work of fracture (J)."""
        return self.stored + self.fracture

    @property
    def slope(self) -> float:
        """Change of both energies with the depth (N)."""
        return self.elastic + self.cutting

    @property
    def crack_depth(self) -> float:
        """Depth (m) of the front of the slit."""
        return self.depth + self.ahead

    @property
    def flank(self) -> float:
        """Depth (m) to which its flanks touch tissue."""
        return min(self.depth, self.crack_depth)

    @property
    def is_indentation(self) -> bool:
        """Whether it presses on tissue that it does not cut."""
        return self.phase == INDENTATION

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


def between(before: Cutting, after: Cutting, depth: float) -> Cutting:
    """Return the cutting blade at a depth (m) between two others."""
    share = (depth - before.depth) / (after.depth - before.depth)
    numbers = [name for name, value in vars(before).items() if isinstance(value, float)]
    mixed = {name: (1 - share) * getattr(before, name) + share * getattr(after, name) for name in numbers}
    ends = [before.depth, after.depth]
    stored = scipy.interpolate.CubicHermiteSpline(ends, [before.stored, after.stored], [before.elastic, after.elastic])
    return replace(after, **(mixed | {"depth": depth, "stored": float(stored(depth))}))


def cuttings(scene: Scene, depths: list[float]) -> tuple[list[Cutting], str]:
    """Return the blade cutting at each depth (m), up to the first that cannot be solved, and why it cannot."""
    places = {depth: scene.ahead(depth) for depth in depths}
    found: dict[float, Cutting] = {}
    message: dict[float, str] = {}
    for _ in range(_MOST_ROUNDS):
        again: dict[float, float] = {}
        for (depth, ahead), cut in scene.cuts(sorted(places.items())).items():
            if isinstance(cut, str):
                message[depth] = cut
                continue
            one, farthest = _cutting(scene, cut), _room(scene, depth)
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


def _cutting(scene: Scene, cut: Cut) -> Cutting:
    """Return the blade where G is the toughness, below its tip and beside its ends, from one solved slit."""
    tissue, length, width = scene.at(cut.depth), scene.blade.length, scene.blade.width
    field = NearTip.through(_strength(scene, tissue), cut.ahead, cut.release)
    ahead, share = field.ahead(tissue.toughness), cut.release_error / cut.release
    # What is between the solved front and this one, and how far the error of G moves it.
    added = length * field.per_length(ahead, cut.ahead) + field.corners(ahead, cut.ahead)
    added += sides(scene, field, cut.depth, cut.ahead)
    moved = length * field.strength
    fracture = length * scene.tear(cut.depth + ahead) + 2 * ahead**2 * tissue.toughness
    for layer, height in scene.above(cut.depth):
        beside = _beside(scene, field, layer)
        end = beside.ahead(layer.toughness)
        moved += 2 * height * beside.strength
        fracture += 2 * height * end * layer.toughness
    widened, solved_front = 2 * field.per_length(ahead, cut.ahead), length + 2 * cut.ahead
    stored = cut.energy + added
    stored_error = cut.energy_error + EXTENSION_ERROR * abs(added) + share * moved
    force_error = cut.drive_error + solved_front * cut.release_error
    return Cutting(
        depth=cut.depth,
        ahead=ahead,
        field=field,
        stored=stored,
        stored_error=stored_error,
        fracture=fracture,
        elastic=cut.drive - solved_front * cut.release + widened,
        elastic_error=force_error + EXTENSION_ERROR * abs(widened) + 2 * share * field.strength,
        cutting=(length + 2 * ahead) * tissue.toughness,
        squeeze=2 * stored / width,
        squeeze_error=2 * stored_error / width,
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
