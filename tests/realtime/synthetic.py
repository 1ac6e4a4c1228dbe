"""A body of smooth random c and h, as a model and as a file."""

from pathlib import Path

import numpy as np

from epsmesh_realtime.export.file import write_model
from epsmesh_realtime.model import Model, read
from epsmesh_realtime.surface import Surface, SurfaceTable, read_surface
from epsmesh_realtime.table import Face, Pairs, Table


def random_model(*, is_round: bool = False, turned: bool = False, is_even: bool = True, curved: bool = False) -> Model:
    rng = np.random.default_rng(4)
    is_axial = is_round and is_even
    shape = (3, 1, 7) if is_axial else (3, 6, 7)
    order = sum(np.ogrid[: shape[0], : shape[1], : shape[2]])
    reciprocal, curvature = rng.standard_normal((2, *shape)) / np.maximum(order, 1) ** 2 / 20
    reciprocal[0, 0, 0], curvature[0, 0, 0] = 1.0, 0.8
    reach, sides = ((0.03, 0.03), (0.036, 0.036)) if is_round else ((0.03, 0.025), (0.036, 0.03))
    tensors = rng.standard_normal((7, *shape)) / np.maximum(order, 1) ** 2 * 0.05
    kind = {"even": (is_even, is_even), "leans": not curved, "tensors": tensors}
    table = Table(0.02 * reciprocal, 0.06 * curvature, 45.0, reach, is_round, (0.3, 0.49), **kind)
    axes = np.linalg.qr(rng.standard_normal((3, 3)))[0] if turned else np.eye(3)
    origin = np.array([0.1, -0.2, 0.05]) if turned else np.zeros(3)
    face = Face()
    if curved:
        heights = rng.standard_normal((2, 1 if is_axial else 4, 5)) / np.arange(1, 6) ** 3
        face = Face(2e-3 * heights[0], 4.0 * heights[1])
    rest = {"face": face, "off": 1e-7, "aligned": 0.02 if curved else 1e-6, "bend_error": 3.0 if curved else 0.0}
    rest["pairs"] = random_pairs(table)
    return Model(table, origin, axes, sides, 0.02, 10e3, 0.45, 0.5, (0.02, 0.1, 0.5, 0.001), **rest)


def of_place(c: float = 0.0, h: float = 0.0, poisson: float = 0.3, *, pairs: bool = False) -> Model:
    """A body with E = 1 whose regular part is the same everywhere: by default a half-space."""
    one = np.full((1, 1, 1), 1 / (c + 45.0))
    table = Table(
        one, h * one**3, 45.0, (0.5, 0.5), False, (poisson, poisson), leans=False, tensors=np.zeros((7, 1, 1, 1))
    )
    none = Pairs(np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), 0.0, 0.0, table.reach, table.poisson)
    rest = {"off": 1e-9, "pairs": none if pairs else None}
    return Model(table, np.zeros(3), np.eye(3), (10.0, 10.0), 10.0, 1.0, poisson, 1.0, (0.0,) * 4, **rest)


def point_force(away: np.ndarray, poisson: float) -> np.ndarray:
    """J. Boussinesq, 1885: the displacement (n, 3) of a half-space with E = 1, at points (n, 3) from a unit force."""
    r = np.maximum(np.linalg.norm(away, axis=1), 1e-15)
    depth = np.maximum(-away[:, 2], -0.95 * r)
    aside = depth / r**3 - (1 - 2 * poisson) / (r * (r + depth))
    down = depth**2 / r**3 + 2 * (1 - poisson) / r
    return (1 + poisson) / (2 * np.pi) * np.column_stack([aside[:, None] * away[:, :2], -down])


def random_pairs(table: Table, rank: int = 4) -> Pairs:
    """Of smooth random modes; a force sinks other places a tenth to a half more or less than on a half-space."""
    rng, rows = np.random.default_rng(6), np.arange(1, 6)
    modes = rng.standard_normal((rank, 5, 5)) / np.multiply.outer(rows, rows) ** 2
    links = 4 * rng.standard_normal((3, rank, rank)) / np.arange(1, 4)[:, None, None]
    return Pairs(modes, (links + links.transpose(0, 2, 1)) / 2, 2e-3, 0.2, table.reach, table.poisson)


def write_random(path: Path, **kind: bool) -> Model:
    """Write a model, and return it as it is read."""
    checks = {"force": np.array([0.1, 0.2]), "bar": np.array([0.01, 0.01])}
    write_model(path, random_model(**kind), checks, {"title": "random"})
    return read(path)


def random_surface(*, rank: int = 5, side: int = 9, **kind: bool) -> Surface:
    """A face and a floor of side × side points, and modes as small as a far field is."""
    model, rng = random_model(**kind), np.random.default_rng(5)
    x, y = (np.linspace(-half, half, side) for half in model.sides)
    flat = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    heights = np.array([model.spot(x, y).height for x, y in flat.tolist()])
    points = np.vstack([np.column_stack([flat, heights + z]) for z in (0.0, -model.thickness)])
    corner = np.add.outer(side * np.arange(side - 1), np.arange(side - 1)).ravel()
    face = np.vstack(
        [
            np.column_stack([corner, corner + 1, corner + side + 1]),
            np.column_stack([corner, corner + side + 1, corner + side]),
        ]
    )
    triangles = np.vstack([face, face[:, ::-1] + len(flat)]).astype(np.int32)
    modes = rng.integers(-32767, 32768, (len(points), 3, rank)).astype(np.int16)
    amounts = (2e-5 * rng.standard_normal((rank, 3, 4, 5))).astype(np.float32)
    table = SurfaceTable(
        points.astype(np.float32), triangles, modes, amounts, 0.01, model.table.reach, model.table.poisson
    )
    return Surface(model, table)


def write_surface(path: Path, **kind: bool) -> Surface:
    """Write a model with its surface, and return it as it is read."""
    made = random_surface(**kind)
    write_model(path, made.model, {}, {"title": "random"}, made.table)
    return read_surface(path)
