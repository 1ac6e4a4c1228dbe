"""The tasks of all programs, independent of their libraries. Lengths in mm, F in units of E·d·mm."""

from dataclasses import dataclass
from math import sqrt

from pipeline.verify import known


@dataclass(frozen=True)
class Task:
    """A body held at its bottom, and a bonded footprint on its top face z = 0 pushed down by d, or a ball in contact.

    ``body`` is ("box", length, width, height), centred on the z axis, or ("cylinder", radius, height); ``probe`` is
    ("disc", radius), ("blade", length along x, width) or ("ball", radius, depth); ``truth`` is F, converged, and its
    relative bar.
    """

    name: str
    title: str
    body: tuple[str, float, float] | tuple[str, float, float, float]
    probe: tuple[str, float] | tuple[str, float, float]
    poisson: float
    truth: tuple[float, float]
    at: tuple[float, float] = (0.0, 0.0)

    @property
    def planes(self) -> tuple[str, ...]:
        """Planes of mirror symmetry, "x" for x = 0; a place off the centre breaks them."""
        return tuple(axis for axis, place in zip("xy", self.at, strict=True) if place == 0.0)

    @property
    def half_width(self) -> float:
        """Half of the probe's least width, the unit of sizes at its edge; for a ball, Hertz's contact radius."""
        if self.probe[0] == "ball":
            return sqrt(self.probe[1] * self.depth)
        return self.probe[1] if self.probe[0] == "disc" else self.probe[-1] / 2

    @property
    def depth(self) -> float:
        """Depth of the probe: 1, since F is proportional to it, except for a ball."""
        return self.probe[2] if self.probe[0] == "ball" else 1.0

    @property
    def height(self) -> float:
        """Thickness of the body."""
        return self.body[-1]


_CYLINDER = (known.CYLINDER["bonded", 0.45], known.CYLINDER_ERROR)
TASKS = {
    scene.name: scene
    for scene in (
        Task("disc", "disc off the centre of a box", ("box", 60, 60, 20), ("disc", 2), 0.45, known.BOX_DISC, (10, 5)),
        Task("blade", "blade on a box", ("box", 60, 60, 20), ("blade", 6, 1), 0.3, known.BOX_BLADE),
        Task("cylinder", "disc on a cylinder", ("cylinder", 50, 50), ("disc", 3), 0.45, _CYLINDER),
        Task("ball", "ball on a cylinder", ("cylinder", 30, 30), ("ball", 4, 0.3), 0.3, known.CYLINDER_BALL),
    )
}
