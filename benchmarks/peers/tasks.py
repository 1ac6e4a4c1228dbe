"""The tasks of all programs, independent of their libraries. Lengths in mm, F in units of E·d·mm."""

from dataclasses import dataclass
from math import sqrt

from tests.verification import known


@dataclass(frozen=True)
class Task:
    """A body held at its bottom, and a bonded footprint on its top face z = 0 pushed down by d, or a ball in contact.

    ``body`` is ("box", length, width, height), centred on the z axis, or ("cylinder", radius, height); ``probe`` is
    ("disc", radius), ("blade", length along x, width) or ("ball", radius, depth); ``truth`` is F, converged, and its
    relative bar. With a ``law`` displacements are large, and a disc has a depth, too: "neo-hookean",
    μ/2 (A : A − 3) − μ ln J + λ/2 (J − 1)², or "mooney-rivlin", μ/2 (Ī₁ − 3) + K/2 (J − 1)², its c₂ = 0: the
    neo-Hookean law of CalculiX.
    """

    name: str
    title: str
    body: tuple[str, float, float] | tuple[str, float, float, float]
    probe: tuple[str, float] | tuple[str, float, float]
    poisson: float
    truth: tuple[float, float]
    at: tuple[float, float] = (0.0, 0.0)
    law: str = "linear"

    @property
    def is_large(self) -> bool:
        """Whether displacements are large."""
        return self.law != "linear"

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
        """Depth of the probe: 1 where F is proportional to it."""
        return self.probe[2] if self.probe[0] == "ball" or self.is_large else 1.0

    @property
    def height(self) -> float:
        """Thickness of the body."""
        return self.body[-1]


_CYLINDER = (known.CYLINDER["bonded", 0.45], known.CYLINDER_ERROR)
_DEEP = ("cylinder", 30, 30)
# NGSolve's axisymmetric elements of degrees 2, 3 and 4 on three nested meshes, extrapolated in their size at the edge
# (9.562, 9.563, 9.569), and this program's own ones, in which contact is found.
_DISC, _BALL = (9.565, 2e-3), (4.34673, 1e-4)
# By the same axisymmetric elements, with the other law.
_CCX_BALL = (4.56248, 1e-4)
TASKS = {
    scene.name: scene
    for scene in (
        Task("disc", "disc off the centre of a box", ("box", 60, 60, 20), ("disc", 2), 0.45, known.BOX_DISC, (10, 5)),
        Task("blade", "blade on a box", ("box", 60, 60, 20), ("blade", 6, 1), 0.3, known.BOX_BLADE),
        Task("cylinder", "disc on a cylinder", ("cylinder", 50, 50), ("disc", 3), 0.45, _CYLINDER),
        Task("ball", "ball on a cylinder", ("cylinder", 30, 30), ("ball", 4, 0.3), 0.3, known.CYLINDER_BALL),
        Task("deep-disc", "disc pressed by half its radius", _DEEP, ("disc", 4, 2), 0.3, _DISC, law="neo-hookean"),
        Task("deep-ball", "ball pressed by half its radius", _DEEP, ("ball", 4, 2), 0.3, _BALL, law="neo-hookean"),
        Task("ccx-ball", "the same, CalculiX's law", _DEEP, ("ball", 4, 2), 0.3, _CCX_BALL, law="mooney-rivlin"),
    )
}
