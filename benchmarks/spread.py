"""What random fields of the modulus do to F, against sampled fields: ``python -m benchmarks.spread``.

Scenes of random proportions are solved for samples of their fields, on one mesh of the whole body each: coarse, because
its error is on both sides. What the program computes from one solution, on the part of the body that symmetry leaves,
is compared with the samples. Elements of half the size say what the mesh changes, to first order. F to first order is
known for each sample, and over all fields: the ratio of both is the control variate. Fields have one or four values per
cell.
Samples are kept beside the table: what they cost is not asked again.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import basix
import numpy as np
from mpi4py import MPI
from scipy import sparse
from scipy.linalg import lapack

from benchmarks.tables import Table, markdown, options, write
from epsmesh import compat
from epsmesh.arrays import FloatArray
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run import problem as problems
from epsmesh.run.execute import compute
from epsmesh.run.meshing import mesh_case
from epsmesh.run.spread import logarithm_of
from epsmesh.shapes.tissue import Spread
from epsmesh.solve.compiled import quadrature_degree
from epsmesh.solve.points.state import State
from epsmesh.solve.solution import Request
from epsmesh.solve.spaces import Spaces
from epsmesh.solve.variation import Factors, places
from epsmesh.study.read import parse

SEED = 90417
MESHES = Path(__file__).parents[1] / "meshes"
# Body, tool, law, degree.
KINDS = (
    ("box", "disc", "linear", 2), ("cylinder", "disc", "linear", 2), ("ellipsoid", "disc", "linear", 2),
    ("kidney", "disc", "linear", 2), ("kidney", "blade", "linear", 2), ("box, skin", "disc", "linear", 2),
    ("cylinder, skin", "blade", "linear", 2), ("box, lump", "disc", "linear", 2),
    ("box, skin, lump", "disc", "linear", 2), ("cylinder", "blade", "linear", 3),
    ("box", "sliding disc", "linear", 2), ("cylinder, skin", "sliding disc", "linear", 2),
    ("box", "blade", "linear", 1), ("cylinder, skin, lump", "disc", "linear", 2),
    ("box", "ball", "linear", 2), ("box, skin", "ball", "linear", 2), ("cylinder, lump", "ball", "linear", 2),
    ("ellipsoid", "ball", "linear", 2), ("box, lump", "disc", "neo-hookean", 2),
    ("cylinder, skin", "ball", "neo-hookean", 2),
)  # fmt: skip
SPREADS = (0.2, 0.4, 0.6)
# Shares of the samples: of the largest spread, and of scenes and meshes that the program solves one by one.
_LARGEST, _ONE_BY_ONE, _LARGE = 0.1, 0.2, 0.15
# Samples below which there is no row.
_LEAST = 10
# Unknowns up to which many fields are solved at once; cells up to which each has four values of its field, else one.
_UNKNOWNS, _CELLS = 9000, 1200
_OF_NORMAL = 1.959964
_RESAMPLED = 400
COLUMNS = {
    "scene": "", "l (mm)": "", "spread": ".0%", "samples": "d", "σ of F": ".2%", "sampled": ".2%", "off": "+.1%",
    "off on one mesh": "+.1%",
    "± (1 s.e.)": ".1%", "mean of ln F": "+.1%", "mean, sampled": "+.1%", "95 % of F within ±": ".1%", "its bar": ".1%",
    "off, in bars": ".2f", "bar, share of F": ".1%", "share off, in bars": ".2f",
}  # fmt: skip
HELD = {
    "spread": ".0%", "scenes": "d", "σ off, median": ".1%", "largest": ".1%", "largest on one mesh": ".1%",
    "s.e., largest": ".1%",
    "within the bar": "d", "share of F within": "d",
}  # fmt: skip
# Fields that are solved at once; the last change of the energy, relative; differences of ln F from the program's.
_BATCH, _ITERATIONS, _DECREMENT, _ALIKE = 100, 40, 2e-6, 1e-4


@dataclass(frozen=True)
class Scene:
    """A scene, its study without spread, and of each tissue the share of the spread and its correlation length (mm)."""

    name: str
    sections: Mapping[str, Any]
    fields: Sequence[tuple[float, float]]

    def raw(self, spread: float, size: float = 1.0) -> dict[str, Any]:
        """Return the study with a spread of the tissue, and elements of a relative size."""
        study = json.loads(json.dumps(self.sections))
        tables = [study["material"], *study["body"].get("layer", ()), *study["body"].get("inclusion", ())]
        for table, (share, length) in zip(tables, self.fields, strict=True):
            table["spread"] = {"young": f"{100 * share * spread:.4g} %", "correlation_length": f"{length} mm"}
        study["mesh"] |= {name: f"{size * study['mesh'][name]:.4f} mm" for name in ("rim", "fine", "coarse")}
        return {**study, "solve": {"exact": False, "influence": True}}


def scenes(seed: int) -> Iterator[Scene]:
    """Yield the scenes."""
    rng = np.random.default_rng(seed)
    for body, tool, law, degree in KINDS:
        shape, *parts = body.split(", ")
        wide, long, height, radius = (round(rng.uniform(*ends), 1) for ends in ((30, 46), (30, 46), (14, 24), (2.5, 4)))
        thick, lump, young = round(rng.uniform(2, 4), 2), round(rng.uniform(3, 4), 2), round(rng.uniform(3, 12), 1)
        shapes: dict[str, dict[str, Any]] = {
            "box": {"shape": "box", "size": [f"{wide} mm", f"{long} mm", f"{height} mm"], "fixed": "bottom"},
            "cylinder": {"shape": "cylinder", "radius": f"{wide / 2} mm", "height": f"{height} mm", "fixed": "bottom"},
            "ellipsoid": {
                "shape": "ellipsoid", "axes": [f"{wide / 2} mm", f"{long / 2} mm", f"{height} mm"],
                "fixed": {"below": f"{-0.4 * height:.1f} mm"},
            },
            "kidney": {
                "shape": "surface", "file": str(MESHES / "kidney.obj"), "unit": "mm", "fixed": {"below": "-8 mm"}
            },
        }  # fmt: skip
        section = shapes[shape]
        fields = [(1.0, round(float(np.exp(rng.uniform(np.log(2), np.log(12)))), 1))]
        poisson = round(float(rng.uniform(0.3, 0.45)), 2)
        if "skin" in parts:
            stiff = f"{young * rng.uniform(2, 6):.1f} kPa"
            section["layer"] = [{"name": "skin", "thickness": f"{thick} mm", "young": stiff, "poisson": poisson}]
            fields.append((round(rng.uniform(0.4, 1), 2), round(rng.uniform(2, 8), 1)))
        if "lump" in parts:
            deep, stiff = thick + lump + rng.uniform(1, 3), f"{young * rng.uniform(2, 8):.1f} kPa"
            at = ["2 mm", "0 mm", f"{-deep:.1f} mm"]
            section["inclusion"] = [
                {"name": "lump", "at": at, "radius": f"{lump} mm", "young": stiff, "poisson": poisson}
            ]
            fields.append((round(rng.uniform(0.4, 1), 2), round(rng.uniform(2, 8), 1)))
        is_ball = tool == "ball"
        depth = (0.16 if is_ball else 0.06 if law == "linear" else 0.12) * radius
        probe: dict[str, Any] = {
            "disc": {"shape": "disc", "radius": f"{radius} mm"},
            "sliding disc": {"shape": "disc", "radius": f"{radius} mm", "contact": "frictionless"},
            "blade": {"shape": "blade", "length": f"{3 * radius:.1f} mm", "width": "2 mm"},
            "ball": {"shape": "sphere", "radius": f"{2 * radius:.1f} mm", "contact": "unilateral"},
        }[tool] | {"depth": f"{depth:.2f} mm"}
        if rng.random() < 0.5 and shape in ("box", "cylinder"):
            probe["at"] = [f"{rng.uniform(1, 4):.1f} mm", f"{rng.uniform(1, 4):.1f} mm"]
        touch, far = (2 * radius * depth) ** 0.5 if is_ball else radius, 10.0
        rim = 1.5 if tool == "blade" else touch / (3.0 if is_ball else 1.8)
        sizes = {"rim": rim, "fine": 6.0, "coarse": far} if degree < 3 else {"rim": 2.0, "fine": 8.0, "coarse": 14.0}
        mesh = {"epsilon": "full", "growth": 1.0, "degree": degree} | sizes
        material = {"young": f"{young} kPa", "poisson": poisson, "law": law}
        sections = {"body": section, "probe": probe, "material": material, "mesh": mesh}
        yield Scene(f"{body}, {tool}{', large' if law != 'linear' else ''}", sections, fields)


@dataclass(frozen=True, eq=False)
class Cells:
    """A field by cells, in place of that of a study."""

    means: FloatArray

    def factors(self, _body: Any) -> Factors:
        """Return the factors of the energy."""
        count = len(self.means)
        constant = np.zeros(count), np.zeros(count), np.repeat(self.means[:, None], 4, axis=1)
        return Factors(self.means, False, *constant, lambda _: self.means[:, None])


class Meshed:
    """A scene on its mesh, of the whole body or of a part."""

    def __init__(self, scene: Scene, *, whole: bool, size: float = 1.0):
        raw = scene.raw(SPREADS[-1], size)
        (planned, *_) = make_plan(parse(raw | {"mesh": raw["mesh"] | ({"model": "3d"} if whole else {})})).solves
        self.case = planned.case
        self.mesh = mesh_case(self.case, planned.mirrors, MPI.COMM_SELF, None)
        owned = self.mesh.owned_cells
        self.regions = np.zeros(owned, int) if self.mesh.regions is None else self.mesh.regions[:owned].astype(int)
        nodes = compat.geometry_dofs(self.mesh.mesh)[:owned]
        points, weights = places(np.asarray(self.mesh.mesh.geometry.x)[nodes])
        self.volumes = weights.mean(axis=1) / 6
        if len(nodes) > _CELLS:
            points, weights = points.mean(axis=1, keepdims=True), weights.mean(axis=1, keepdims=True)
        self.points, self.weights = points[:, ::8], weights[:, ::8]

    def force(self, cells: FloatArray | None = None, *, influence: bool = False) -> tuple[float, State]:
        """Return the force, and the fields, as the program solves them."""
        found = problems.variation_of
        given: Any = None if cells is None else Cells(cells)
        problems.variation_of = lambda case: given
        try:
            with Spaces(self.mesh) as spaces, problems.problem_of(spaces, self.case) as problem:
                asked = Request(problems.law_of(self.case), problems.movement_of(self.case), tolerance=1e-6)
                self.prescribed = problem.elements.displacements.prescribed
                return abs(problem.answer(replace(asked, influence=influence)).reaction[2]), problem.state()
        finally:
            problems.variation_of = found


class Batches:
    """Linear tissue under a known footprint, for many fields at once, in single precision.

    Conjugate gradients, preconditioned by the inverse of the operator without spread; the energy is that of F.
    """

    def __init__(self, meshed: Meshed, state: State):
        space, law = state.displacement.function_space, problems.law_of(meshed.case)
        count, degree, mesh = len(meshed.regions), state.degree, meshed.mesh.mesh
        blocks = np.asarray(compat.cell_dofs(space))[:count]
        at, weights = map(np.asarray, basix.make_quadrature(basix.CellType.tetrahedron, quadrature_degree(degree)))
        nodes = np.asarray(mesh.geometry.x)[compat.geometry_dofs(mesh)[:count]]
        table = compat.reference_element(1 if nodes.shape[1] == 4 else 2).tabulate(1, at)[1:4, :, :, 0]
        jacobian = np.einsum("aqi,cir->cqra", table, nodes)
        slopes = compat.reference_element(degree).tabulate(1, at)[1:4, :, :, 0]
        slopes = np.einsum("cqar,aqi->cqir", np.linalg.inv(jacobian), slopes)
        scaled = slopes * (np.abs(np.linalg.det(jacobian)) * weights)[:, :, None, None]
        products = np.einsum("cqia,cqjb->ciajb", scaled, slopes, optimize=True)
        moduli = np.array([law.lame_lambda, law.lame_mu])[:, meshed.regions]
        lame_lambda, mu = moduli[..., None, None, None, None]
        stiff = lame_lambda * products + mu * products.transpose(0, 1, 4, 3, 2)
        alike = mu[..., 0, 0] * np.einsum("ciaja->cij", products)
        for axis in range(3):
            stiff[:, :, axis, :, axis] += alike
        size = 3 * blocks.shape[1]
        self.dofs = (3 * blocks[:, :, None] + np.arange(3)).reshape(count, size)
        self.start = np.array(state.displacement.x.array)
        stiff = stiff.reshape(count, size, size) / stiff.max()
        rows, columns = np.repeat(self.dofs, size, axis=1).ravel(), np.tile(self.dofs, size).ravel()
        whole = sparse.coo_matrix((stiff.ravel(), (rows, columns))).tocsr()
        self.free = np.setdiff1d(np.arange(len(self.start)), meshed.prescribed)
        factor, _ = lapack.spotrf(whole[self.free][:, self.free].toarray().astype(np.float32), lower=1)
        inverse, failed = lapack.spotri(factor, lower=1, overwrite_c=1)
        assert not failed
        self.inverse = inverse + np.tril(inverse, -1).T
        self.stiff = stiff.astype(np.float32)
        ones = np.ones(self.dofs.size, np.float32)
        self.gather = sparse.csr_matrix((ones, (self.dofs.ravel(), np.arange(self.dofs.size))))
        self.energy = float(self.start @ (whole @ self.start))

    def logarithms(self, cells: FloatArray) -> FloatArray:
        """Return ln F/F0 of fields (samples, cells)."""
        factors = cells.T[:, None, :].astype(np.float32)

        def apply(moved: Any) -> FloatArray:
            forces = np.matmul(self.stiff, moved[self.dofs]) * factors
            return np.asarray(self.gather @ forces.reshape(self.dofs.size, -1))

        moved = np.repeat(self.start[:, None], len(cells), axis=1).astype(np.float32)
        force = apply(moved)
        rest, energy = -force[self.free], (moved * force).sum(axis=0, dtype=float)
        step, before = np.zeros_like(moved), np.ones(len(cells))
        for _ in range(_ITERATIONS):
            best = self.inverse @ rest
            left = (rest * best).sum(axis=0, dtype=float)
            step[self.free] = best + step[self.free] * (left / before).astype(np.float32)
            force = apply(step)
            length = left / (step * force).sum(axis=0, dtype=float)
            energy -= length * left
            if (length * left < _DECREMENT * energy).all():
                return np.log(energy / self.energy)
            rest, before = rest - force[self.free] * length.astype(np.float32), left
        raise RuntimeError("conjugate gradients did not converge")


def spreads(scene: Scene, spread: float) -> list[Spread]:
    """Return the random fields of the regions."""
    return [Spread.model_construct(young=a * spread, correlation_length=1e-3 * b) for a, b in scene.fields]


def correlation(points: FloatArray, length: float) -> FloatArray:
    """Return the correlation of a field at points (n, 3)."""
    found = np.empty((len(points), len(points)))
    for rows in np.array_split(np.arange(len(points)), len(points) // 200 + 1):
        away = np.sqrt(3) / length * np.sqrt(sum((points[rows, None, k] - points[None, :, k]) ** 2 for k in range(3)))
        found[rows] = (1 + away) * np.exp(-away)
    return found


def solver(
    scene: Scene, whole: Meshed, force: float, state: State, samples: int
) -> tuple[Callable[[FloatArray], FloatArray], int]:
    """Return what gives ln F/F0 of fields (samples, cells), checked against the program, and the number of samples."""

    def one_by_one(cells: FloatArray) -> FloatArray:
        return np.log([whole.force(one)[0] / force for one in cells])

    is_large = scene.sections["material"]["law"] != "linear"
    if is_large or "ball" in scene.name or len(state.displacement.x.array) > _UNKNOWNS:
        return one_by_one, round((_LARGE if is_large else _ONE_BY_ONE) * samples)
    batches, trial = Batches(whole, state), np.exp(0.4 * np.random.default_rng(1).normal(size=(1, len(whole.regions))))
    assert abs(batches.logarithms(trial) - one_by_one(trial)) < _ALIKE

    def at_once(cells: FloatArray) -> FloatArray:
        return np.concatenate([batches.logarithms(part) for part in np.array_split(cells, -(-len(cells) // _BATCH))])

    return at_once, samples


def sampled(scene: Scene, samples: int, seed: int) -> dict[str, FloatArray]:
    """Solve a scene for sampled fields: ln F/F₀ by spread and sample, that to first order, and its known deviation."""
    began, rng, whole = perf_counter(), np.random.default_rng(seed), Meshed(scene, whole=True)
    force, state = whole.force(influence=True)
    assert state.influence is not None
    solved, samples = solver(scene, whole, force, state, samples)
    relative = whole.weights / whole.weights.sum(axis=1, keepdims=True)
    shares = (state.influence.young * whole.volumes)[:, None] * relative
    normal, variances = np.zeros((samples, *relative.shape)), {}
    for number in sorted({*whole.regions}):
        own = np.flatnonzero(whole.regions == number)
        points, part = whole.points[own].reshape(-1, 3), shares[own].ravel()
        known = correlation(points, 1e-3 * scene.fields[number][1])
        variances[number] = float(part @ known @ part)
        known[np.diag_indices(len(known))] += 1e-8
        factor = np.linalg.cholesky(known)
        normal[:, own] = (rng.normal(size=(samples, len(points))) @ factor.T).reshape(samples, len(own), -1)
    found: dict[str, Any] = {"force": force, "cells": len(relative)}
    for spread in SPREADS:
        deviations = np.array([one.deviation for one in spreads(scene, spread)])
        each = deviations[whole.regions][:, None]
        some = round(samples * (_LARGEST if spread == SPREADS[-1] else 1))
        cells = ((np.exp(each * field - each**2 / 2) * relative).sum(axis=1) for field in normal[:some])
        found[f"ln {spread}"] = solved(np.array([*cells]))
        found[f"first {spread}"] = np.einsum("scq,cq->s", normal[:some], each * shares)
        found[f"known {spread}"] = sum(deviations[number] ** 2 * one for number, one in variances.items()) ** 0.5
    return found | {"seconds": perf_counter() - began}


def rows_of(scene: Scene, found: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the rows of a scene with its samples: what the program has, against them and elements of half the size."""
    size = 0.4 if scene.sections["mesh"]["degree"] == 1 else 1.0  # without which F has no error bar
    meshed = Meshed(scene, whole=False, size=size / 2)
    force, state = meshed.force(influence=True)
    rng = np.random.default_rng(SEED)
    for spread in (spread for spread in SPREADS if len(found[f"ln {spread}"]) >= _LEAST):
        plan = make_plan(parse(scene.raw(spread, size)))
        records = compute(plan, MPI.COMM_SELF)
        dataset, influence = build(plan, records), records[plan.keys[0]].influence
        assert str(dataset["status"].values) == "ok", str(dataset["message"].values)
        (mean, _), (deviation, _) = influence["tissue_mean"], influence["tissue_spread"]
        fine = logarithm_of(state, None, meshed.regions, spreads(scene, spread), 0.0).deviation
        ln, first = found[f"ln {spread}"], found[f"first {spread}"]
        known = float(found[f"known {spread}"])
        picks = rng.integers(len(ln), size=(_RESAMPLED, len(ln)))
        ratios = np.exp(ln[picks]).std(axis=1) / np.exp(first[picks]).std(axis=1)
        ratio = float(np.exp(ln).std() / np.exp(first).std())
        truth = ratio * _of_logarithm(0.0, fine)
        value = _of_logarithm(mean, deviation)
        of_mean, of_deviation = float(ln.mean() - first.mean()), fine * float(ln.std() / first.std())
        half = float(np.exp(of_mean) * np.sinh(_OF_NORMAL * of_deviation))
        bar, error = (float(dataset[f"force_uncertainty_tissue{end}"]) for end in ("", "_error"))
        own, of_force = abs(float(dataset["force"])), float(dataset["force_error"])
        of_share = ((error / bar) ** 2 - (of_force / own) ** 2) ** 0.5 * bar / own
        yield {
            "scene": scene.name, "l (mm)": ", ".join(f"{length:g}" for _, length in scene.fields), "spread": spread,
            "samples": len(ln), "σ of F": value, "sampled": truth, "off": value / truth - 1,
            "off on one mesh": _of_logarithm(mean, known) / (ratio * _of_logarithm(0.0, known)) - 1,
            "± (1 s.e.)": float(ratios.std() / ratios.mean()), "mean of ln F": mean, "mean, sampled": of_mean,
            "95 % of F within ±": bar / own, "its bar": error / bar, "off, in bars": abs(bar - force * half) / error,
            "bar, share of F": of_share / (bar / own), "share off, in bars": abs(bar / own - half) / of_share,
        }  # fmt: skip


def _of_logarithm(mean: float, deviation: float) -> float:
    """Return the standard deviation of a log-normal variable from those of its logarithm."""
    return float(np.exp(mean + deviation**2 / 2) * np.sqrt(np.expm1(deviation**2)))


def main() -> None:
    """Sample, print and write."""
    parser = options(__doc__)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--scenes", type=int, nargs="+", help="numbers of scenes, from 0 on")
    parser.add_argument("--samples", type=int, default=1000)
    asked, table = parser.parse_args(), Table(COLUMNS)
    folder, made = asked.output / f"spread-{asked.seed}", [*scenes(asked.seed)]
    folder.mkdir(parents=True, exist_ok=True)
    for number in asked.scenes or range(len(made)):
        path = folder / f"{number}.npz"
        if not path.exists():
            np.savez(path, **sampled(made[number], asked.samples, asked.seed + number))
        for row in rows_of(made[number], np.load(path, allow_pickle=False)):
            table.add(row)
    tables = markdown(table.rows, COLUMNS), markdown([*_held(table.rows)], HELD)
    write("spread", asked.output, table.rows, "\n".join(tables))


def _held(rows: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    for spread in SPREADS:
        own = [row for row in rows if row["spread"] == spread]
        if not own:
            continue
        off, bars, of_share = (
            np.abs([row[name] for row in own]) for name in ("off", "off, in bars", "share off, in bars")
        )
        yield {
            "spread": spread, "scenes": len(own), "σ off, median": float(np.median(off)), "largest": float(off.max()),
            "largest on one mesh": max(abs(row["off on one mesh"]) for row in own),
            "s.e., largest": max(row["± (1 s.e.)"] for row in own), "within the bar": int((bars <= 1).sum()),
            "share of F within": int((of_share <= 1).sum()),
        }  # fmt: skip


if __name__ == "__main__":
    main()
