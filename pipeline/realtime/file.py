"""Read a model file; every number is checked."""

from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.classic import ModelError, check_shapes, read_doubles
from pipeline.realtime.face import Face
from pipeline.realtime.model import Model
from pipeline.realtime.pairs import read_pairs
from pipeline.realtime.table import TENSORS, Table

FORMAT = 2.0
# Largest number of coefficients along one direction, and in total; the same as in C.
MOST, MOST_IN_ALL = 64, 4096
# Numbers of a file that are fields of a model.
_NUMBERS = ("thickness", "young", "poisson", "largest", "off", "aligned")


def read(path: str | Path) -> Model:
    """Return the model at ``path``.

    Raises:
        ModelError: if it is no model, of another version, or damaged; OSError if it cannot be read.
    """
    return model_of(Path(path).read_bytes())


def model_of(data: bytes) -> Model:
    """Return the model in the bytes of a file.

    Raises:
        ModelError: if they are no model, of another version, or damaged.
    """
    found = read_doubles(data)
    shapes: dict[str, int | tuple[int, ...]]
    shapes = {"reciprocal": 3, "curvature": 3, "origin": (3,), "axes": (3, 3), "bar": (4,), "height": 2, "bend": 2}
    shapes |= dict.fromkeys(("reach", "sides", "poisson_range", "even"), (2,))
    shapes |= {name: rank for name, rank in (("tensors", 4), ("bend_error", ())) if name in found}
    shapes |= dict.fromkeys(("format", "is_round", "c_ref", "leans", *_NUMBERS), ())
    if "format" in found and found["format"].shape == () and found["format"] != FORMAT:
        raise ModelError(
            f"the file has format {float(found['format']):g}, and this program reads {FORMAT:g}: export it again"
        )
    check_shapes(found, shapes)
    _check(found)
    reach, sides, ratios, bar = (found[name].tolist() for name in ("reach", "sides", "poisson_range", "bar"))
    rest = {name: float(found[name]) for name in (*_NUMBERS, "bend_error") if name in found}
    is_round, (even_x, even_y) = bool(found["is_round"] == 1.0), found["even"] == 1.0
    tensors = {"tensors": found["tensors"]} if "tensors" in found else {}
    table = Table(
        found["reciprocal"],
        found["curvature"],
        float(found["c_ref"]),
        (reach[0], reach[1]),
        is_round,
        (ratios[0], ratios[1]),
        (bool(even_x), bool(even_y)),
        leans=bool(found["leans"] == 1.0),
        **tensors,
    )
    table.prepare()
    return Model(
        table,
        found["origin"],
        found["axes"],
        (sides[0], sides[1]),
        bar=(bar[0], bar[1], bar[2], bar[3]),
        face=Face(found["height"], found["bend"]),
        pairs=read_pairs(found, table.reach, table.poisson),
        **rest,
    )


def numbers_of(model: Model) -> dict[str, NDArray[np.float64]]:
    """Return the numbers of a model's file, by name, without those for several tools."""
    table, face = model.table, model.face
    found = {name: getattr(model, name) for name in (*_NUMBERS, "bend_error", "sides", "origin", "axes", "bar")}
    found |= {name: getattr(table, name) for name in ("reciprocal", "curvature", "c_ref", "reach", "even", "leans")}
    found |= {"is_round": table.is_round, "poisson_range": table.poisson, "height": face.height, "bend": face.bend}
    found |= {"format": FORMAT} | ({"tensors": table.tensors} if len(table.tensors) else {})
    return {name: np.asarray(value, dtype=float) for name, value in found.items()}


def _check(found: dict[str, NDArray[np.float64]]) -> None:
    """Check that the numbers of a file are valid for a model."""
    shape, axes, (low, high) = found["reciprocal"].shape, found["axes"], found["poisson_range"]
    reach, sides = found["reach"], found["sides"]
    flags, face, tensors = found["even"], found["height"].shape, found.get("tensors")
    fits = {
        "even": all(flag in (0.0, 1.0) for flag in flags),
        "leans": float(found["leans"]) in (0.0, 1.0),
        "height": face == found["bend"].shape and max(face) <= MOST and (face[0] == 1 or not found["is_round"]),
        "off": bool(found["off"] > 0),
        "aligned": bool(0 < found["aligned"] <= 0.5),
        "tensors": tensors is None or tensors.shape == (TENSORS, *shape),
        "reciprocal": shape == found["curvature"].shape and max(shape) <= MOST and prod(shape) <= MOST_IN_ALL,
        "is_round": bool(found["is_round"] == 0)
        or (bool(found["is_round"] == 1) and shape[1] == 1 and bool((flags == 1).all())),
        "axes": bool(np.abs(axes @ axes.T - np.eye(3)).max() < 1e-9),
        "reach": bool((reach > 0).all() and (reach < sides).all()),
        "poisson_range": bool(-1 < low <= found["poisson"] <= high <= 0.5) and (shape[0] == 1 or bool(low < high)),
        "thickness": bool(found["thickness"] > 0),
        "young": bool(found["young"] > 0),
        "largest": bool(0 < found["largest"] <= 1),
        "bar": bool((found["bar"] >= 0).all()),
        # Files of earlier versions lack it, and are too inaccurate for a curved face.
        "bend_error": bool(found["bend_error"] >= 0) if "bend_error" in found else not found["bend"].any(),
    }
    for name, is_right in fits.items():
        if not is_right:
            raise ModelError(f"{name} has an invalid value: the file is damaged")
