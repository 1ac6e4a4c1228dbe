"""What random fields of the modulus do to F, against sampled fields: ``python -m benchmarks.spread``.

Each scene is solved for samples of its fields on one mesh of the whole body. What the program computes from one
solution, on the quarter or half of symmetric scenes, is compared with the deviation of ln F of the samples. To first
order, ln F of a sample is known. Its deviation over all fields is a double sum over points. So F of few samples gives
the ratio of the two deviations.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.tables import Table, options
from epsmesh import compat
from epsmesh.arrays import FloatArray
from epsmesh.plan.plan import make_plan
from epsmesh.run import problem as problems
from epsmesh.run.meshing import mesh_case
from epsmesh.run.spread import deviation_of
from epsmesh.shapes.tissue import Spread
from epsmesh.solve.points.state import State
from epsmesh.solve.solution import Request
from epsmesh.solve.spaces import Spaces
from epsmesh.solve.variation import Factors, places
from epsmesh.study.read import parse

_MESH = {"epsilon": "full", "fine": "5 mm", "coarse": "8 mm", "rim": "1 mm", "growth": 0.8}
_BOX = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"}
_PLATE = {"shape": "box", "size": ["50 mm", "36 mm", "10 mm"], "fixed": "bottom"}
_CYLINDER = {"shape": "cylinder", "radius": "22 mm", "height": "24 mm", "fixed": "bottom"}
_ELLIPSOID = {"shape": "ellipsoid", "axes": ["24 mm", "22 mm", "20 mm"], "fixed": {"below": "-8 mm"}}
_DISC = {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm"}
_BALL = {"shape": "sphere", "radius": "8 mm", "depth": "0.5 mm", "contact": "unilateral"}
_BLADE = {"shape": "blade", "length": "10 mm", "width": "2 mm", "depth": "0.2 mm"}
_SKIN = {"name": "skin", "thickness": "2 mm", "young": "50 kPa", "poisson": 0.45}
# Body, tool, Poisson's ratio, correlation length (mm), law.
SCENES: dict[str, tuple[dict[str, Any], dict[str, Any], float, float, str]] = {
    "disc of 3 mm, box": (_BOX, _DISC, 0.3, 3.0, "linear"),
    "disc of 3 mm, cylinder": (_CYLINDER, _DISC, 0.45, 6.0, "linear"),
    "disc of 3 mm, box with a skin": (_BOX | {"layer": [_SKIN]}, _DISC, 0.45, 1.5, "linear"),
    "disc of 3 mm, ellipsoid": (_ELLIPSOID, _DISC | {"at": ["5 mm", "0 mm", "19 mm"]}, 0.4, 12.0, "linear"),
    "blade of 10 × 2 mm, plate": (_PLATE, _BLADE, 0.4, 4.0, "linear"),
    "ball of 8 mm, box": (_BOX, _BALL, 0.3, 2.0, "linear"),
    "ball of 8 mm, cylinder": (_CYLINDER, _BALL, 0.49, 8.0, "linear"),
    "ball of 8 mm, plate with a skin": (_PLATE | {"layer": [_SKIN]}, _BALL, 0.45, 4.0, "linear"),
    "disc of 4 mm, plate, may slide": (
        _PLATE,
        _DISC | {"radius": "4 mm", "contact": "frictionless"},
        0.4,
        7.0,
        "linear",
    ),
    "ball of 8 mm, ellipsoid": (_ELLIPSOID, _BALL | {"at": ["-4 mm", "3 mm", "19 mm"]}, 0.4, 5.0, "linear"),
    "blade of 10 × 2 mm, box with a skin": (_BOX | {"layer": [_SKIN]}, _BLADE, 0.45, 3.0, "linear"),
    "disc of 3 mm, box, neo-Hookean": (_BOX, _DISC | {"depth": "0.3 mm"}, 0.4, 3.0, "neo-hookean"),
}
SPREADS = (0.2, 0.4)
_WAVES = 1000  # of a sample
_SKIN_SPREAD = 0.5  # of that of the tissue
COLUMNS = {
    "scene": "", "ν": "", "l (mm)": ".3g", "spread": ".0%", "σ of ln F": ".2%", "sampled": ".2%", "off": "+.1%",
    "± (95 %)": ".1%", "mean of F": "+.1%", "samples": "d",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Cells:
    """A field by cells, in place of that of a study."""

    means: FloatArray

    def factors(self, _body: Any) -> Factors:
        """Return the factors of the energy."""
        count = len(self.means)
        constant = np.zeros(count), np.zeros(count), np.repeat(self.means[:, None], 4, axis=1)
        return Factors(self.means, False, *constant, lambda _: self.means[:, None])


class Scene:
    """A scene on its mesh, of the whole body or of a part."""

    def __init__(self, name: str, *, whole: bool):
        body, probe, poisson, _, law = SCENES[name]
        mesh = _MESH | ({"model": "3d"} if whole else {}) | ({"rim": "0.6 mm"} if probe["shape"] == "sphere" else {})
        material = {"young": "10 kPa", "poisson": poisson, "law": law}
        raw = {"body": body, "material": material, "probe": probe, "mesh": mesh}
        study = parse(raw | {"solve": {"exact": False, "influence": True}})
        (planned, *_) = make_plan(study).solves
        self.case = planned.case
        self.mesh = mesh_case(self.case, planned.mirrors, MPI.COMM_SELF, None)
        owned = self.mesh.owned_cells
        self.regions = np.zeros(owned, int) if self.mesh.regions is None else self.mesh.regions[:owned]
        nodes = compat.geometry_dofs(self.mesh.mesh)[:owned]
        self.points, self.weights = (part[:, ::4] for part in places(np.asarray(self.mesh.mesh.geometry.x)[nodes]))

    def force(self, cells: FloatArray | None = None, *, influence: bool = False) -> tuple[float, State]:
        """Return the force, and the fields."""
        found = problems.variation_of
        given: Any = None if cells is None else Cells(cells)
        problems.variation_of = lambda case: given
        try:
            with Spaces(self.mesh) as spaces, problems.problem_of(spaces, self.case) as problem:
                asked = Request(problems.law_of(self.case), problems.movement_of(self.case), tolerance=1e-6)
                return problem.answer(replace(asked, influence=influence)).reaction[2], problem.state()
        finally:
            problems.variation_of = found

    def spreads(self, length: float, spread: float) -> list[Spread]:
        """Return the random fields of the regions."""
        shares = [1.0, *(_SKIN_SPREAD for _ in self.case.tissues[1:])]
        return [Spread.model_construct(young=share * spread, correlation_length=length) for share in shares]


def sampled(points: FloatArray, length: float, rng: np.random.Generator) -> FloatArray:
    """Return a sample of a field of variance 1 at points (cells, q, 3)."""
    t = rng.gamma(1.5, size=(_WAVES, 1))
    waves = rng.normal(size=(_WAVES, 3)) / (length * np.sqrt(2 * t / 3))
    phases = (points.reshape(-1, 3) @ waves.T + rng.uniform(0, 2 * np.pi, _WAVES)).astype(np.float32)
    return np.asarray(np.sqrt(2 / _WAVES) * np.cos(phases, out=phases).sum(axis=1).reshape(points.shape[:2]), float)


def variance(points: FloatArray, shares: FloatArray, length: float) -> float:
    """Return the double sum of the correlation over all pairs of points, with the shares of F at them."""
    total = 0.0
    for rows in np.array_split(np.arange(len(points)), len(points) // 100 + 1):
        away = np.sqrt(3) / length * np.sqrt(sum((points[rows, None, k] - points[None, :, k]) ** 2 for k in range(3)))
        total += float(shares[rows] @ ((1 + away) * np.exp(-away)) @ shares)
    return total


def rows_of(name: str, samples: int) -> Iterator[dict[str, Any]]:
    """Yield the rows of a scene."""
    *_, poisson, in_mm, _ = SCENES[name]
    length, rng = 1e-3 * in_mm, np.random.default_rng(len(name))
    whole, part = Scene(name, whole=True), Scene(name, whole=False)
    force, state = whole.force(influence=True)
    _, of_part = part.force(influence=True)
    assert state.influence is not None
    relative = whole.weights / whole.weights.sum(axis=1, keepdims=True)
    shares = (state.influence.young * whole.weights.mean(axis=1) / 6)[:, None] * relative
    numbers = sorted({*whole.regions})
    fields = {number: [sampled(whole.points, length, rng) for _ in range(samples)] for number in numbers}
    for spread in SPREADS:
        spreads, logarithms, firsts, known = whole.spreads(length, spread), [], [], 0.0
        for number in numbers:
            own = whole.regions == number
            known += spreads[number].deviation ** 2 * variance(
                whole.points[own].reshape(-1, 3), shares[own].reshape(-1), length
            )
        for sample in range(samples):
            values = np.zeros(whole.points.shape[:2])
            for number in numbers:
                own, deviation = whole.regions == number, spreads[number].deviation
                values[own] = deviation * fields[number][sample][own]
            firsts.append(float((shares * values).sum()))
            mean = np.array([spreads[number].deviation ** 2 / 2 for number in whole.regions])
            cells = (np.exp(values - mean[:, None]) * relative).sum(axis=1)
            logarithms.append(np.log(whole.force(cells)[0] / force))
        found = deviation_of(of_part, np.asarray(part.regions, dtype=np.int64), spreads)
        ln, first = np.array(logarithms), np.array(firsts)
        truth, bar = known**0.5 * ln.std() / first.std(), 1.96 * _doubt(ln, first)
        rising = np.exp(first - known / 2) - 1
        slope = np.cov(np.exp(ln), rising)[0, 1] / rising.var(ddof=1)
        yield {
            "scene": name, "ν": str(poisson), "l (mm)": in_mm, "spread": spread, "σ of ln F": found, "sampled": truth,
            "off": found / truth - 1, "± (95 %)": bar, "mean of F": float((np.exp(ln) - slope * rising).mean() - 1),
            "samples": samples,
        }  # fmt: skip


def _doubt(ln: FloatArray, first: FloatArray) -> float:
    """Return the relative standard error of the ratio of two deviations, by leaving out one sample after the other."""
    keep = ~np.eye(len(ln), dtype=bool)
    ratios = np.log([ln[one].std() / first[one].std() for one in keep])
    return float(np.sqrt((len(ln) - 1) * ratios.var()))


def main() -> None:
    """Sample, print and write."""
    parser = options(__doc__)
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--samples", type=int, default=40)
    asked = parser.parse_args()
    table = Table(COLUMNS)
    for name in asked.scenes:
        for row in rows_of(name, asked.samples):
            table.add(row)
        table.write("spread", asked.output)


if __name__ == "__main__":
    main()
