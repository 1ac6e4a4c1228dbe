"""A real-time model as a page: one HTML file that holds the model, what evaluates it, and what draws it."""

from dataclasses import replace
from math import degrees, hypot
from pathlib import Path
from typing import Any

import numpy as np

from epsmesh.files import write_whole
from epsmesh.view import palette
from epsmesh.view.page import render_scene
from epsmesh_realtime.file import pack
from epsmesh_realtime.surface import Surface
from epsmesh_realtime.touch import SENTENCES

_TEMPLATES = Path(__file__).parent / "templates"
# Each knows those before it.
_SCRIPTS = [_TEMPLATES / name for name in ("evaluator.js", "surface.js", "unanswered.js", "touch.js")]
# The evaluator in C, by pipeline/epsmesh_realtime/wasm/build.py.
EVALUATOR = _TEMPLATES / "evaluator.wasm"
_MM = 1e3
# Of the way to the nearest side or to the bottom: the radius that the page begins with, and the depths that it offers.
_RADIUS, _RADII, _DEPTH, _DEPTHS = 0.12, (0.02, 0.4), 0.04, (-0.02, 0.15)
# A size or a depth (m) that means none: measured studies have such a depth.
_NO_SIZE = 1e-8
# What the page says in place of a hint for Python.
_OUTSIDE = "The place is outside the model's region: move the tool within the grey line."
_YOUNG = (0.1, 10.0)
_ANGLES = (20.0, 85.0)
# A blade's length and width, least, most and at first, and its turn from x.
_LENGTH, _WIDTH, _TURN = (0.06, 0.7, 0.3), (0.015, 0.2, 0.03), (-90.0, 90.0, 20.0)


def write_touch_page(surface: Surface, path: Path, title: str) -> Path:
    """Write the page of a model to ``path``, in place of an earlier one only once it is whole."""
    return write_whole(path, render(surface, title))


def render(surface: Surface, title: str) -> str:
    """Return the page of a model as HTML; it loads nothing else."""
    return render_scene(
        _TEMPLATES / "touch.html.j2",
        _SCRIPTS,
        [_TEMPLATES / "touch.css"],
        inputs=_inputs(surface),
        arrays=_arrays(surface),
        title=title,
        facts=_facts(surface),
        sliders=_sliders(surface),
        tools=_tools(surface),
        tool=_first(surface),
    )


def _tools(surface: Surface) -> list[str]:
    """Return the tools that the model has tables for, as the page names them."""
    has_all = len(surface.model.table.tensors) > 0
    return ["disc", "sphere", "cone", *(("blade", "bonded disc") if has_all else ())]


def _first(surface: Surface) -> str:
    """Return the tool with which the page begins: the study's, if the model has it."""
    tools, own = _tools(surface), surface.model.tool
    return tools[int(own[0])] if own and own[0] < len(tools) else tools[0]


def _facts(surface: Surface) -> list[str]:
    model = surface.model
    x, y = (_MM * reach for reach in model.table.reach)
    region = (
        f"places up to {x:.3g} mm from the middle" if model.table.is_round else f"x to ±{x:.3g} mm and y to ±{y:.3g} mm"
    )
    friction = "without friction; the bonded disc sticks" if "bonded disc" in _tools(surface) else "without friction"
    along = "straight down" if model.face.is_flat else "along the surface's normal"
    at_once = ["The tissue relaxes: forces are those of a sudden touch."] if model.relaxation else []
    return [
        *at_once,
        f"Valid within the grey line: {region}. Tools move {along}, {friction}.",
        "Inclusions are seen through the surface; layers act on the force and are not shown."
        if surface.table.inside
        else "Only the outer surface is drawn; layers and inclusions act on the force and are not shown.",
        "Shaded: no answer for this tool at this depth.",
        "Drag on the body's face to move the tool, beside it to turn the body; scroll to zoom.",
    ]


def _sliders(surface: Surface) -> list[dict[str, Any]]:
    """Return what can be changed, in the units of the page: at first the study's tool, in the middle of the face."""
    model = surface.model
    size = _MM * min(*model.sides, model.thickness)
    x, y = (_MM * side for side in (model.sides if model.face.is_flat else model.table.reach))
    low, high = model.table.poisson
    rows: list[tuple[str, str, float, float, float]] = [
        ("x", "x, mm", -x, x, 0.0),
        ("y", "y, mm", -y, y, 0.0),
        ("depth", "depth, mm", size * _DEPTHS[0], size * _DEPTHS[1], size * _DEPTH),
        ("radius", "radius, mm", size * _RADII[0], size * _RADII[1], size * _RADIUS),
        ("angle", "angle to the axis, °", *_ANGLES, 60.0),
        ("length", "length, mm", size * _LENGTH[0], size * _LENGTH[1], size * _LENGTH[2]),
        ("width", "width, mm", size * _WIDTH[0], size * _WIDTH[1], size * _WIDTH[2]),
        ("turn", "turn, °", *_TURN),
        ("young", "E, kPa", _YOUNG[0] * model.young / 1e3, _YOUNG[1] * model.young / 1e3, model.young / 1e3),
        ("poisson", "ν", low, high, model.poisson),
    ]
    found: list[dict[str, Any]] = [
        dict(zip(("name", "label", "low", "high", "value"), row, strict=True)) for row in rows
    ]
    own = zip(("radius", "angle", "length", "width", "depth"), model.tool[1:], strict=False)
    sizes = {name: size * (degrees(1) if name == "angle" else _MM) for name, size in own if size > _NO_SIZE}
    if model.tool:
        sizes["turn"] = (degrees(model.tool[-1]) + 90) % 180 - 90
    return [_beginning(slider, sizes.get(slider["name"], slider["value"])) for slider in found]


def _beginning(slider: dict[str, Any], value: float) -> dict[str, Any]:
    """Return a slider that begins at ``value``, and includes it."""
    return slider | {"low": min(slider["low"], value), "high": max(slider["high"], value), "value": value}


def _arrays(surface: Surface) -> dict[str, Any]:
    """Return the evaluator, the file of the model, which it loads, and the surfaces of inclusions (mm)."""
    table = surface.table
    model = pack(surface.model.numbers() | replace(table, inside=None).numbers())
    points, triangles = table.inside or (np.empty((0, 3)), np.empty((0, 3)))
    return {
        "evaluator": np.frombuffer(EVALUATOR.read_bytes(), "u1"),
        "model": np.frombuffer(model, "u1"),
        "inside": (_MM * points).astype("<f4").ravel(),
        "corners": triangles.astype("<i4").ravel(),
    }


def _inputs(surface: Surface) -> dict[str, Any]:
    """Return the inputs of the script besides the arrays; the camera's lengths are in mm, along the face's axes."""
    model, table = surface.model, surface.table
    low, high = table.points.min(axis=0), table.points.max(axis=0)
    numbers = {name: np.asarray(getattr(model, name)).tolist() for name in ("origin", "axes", "young", "poisson")}
    is_which = {"is_flat": model.face.is_flat, "is_round": model.table.is_round}
    return {
        "model": numbers | is_which | {"reach": list(model.table.reach), "sides": list(model.sides)},
        "eye": (np.array([-0.5, -0.75, 0.55]) / hypot(0.5, 0.75, 0.55)).tolist(),
        "centre": (_MM * (low + high) / 2).tolist(),
        "radius": float(_MM * np.linalg.norm(high - low) / 2),
        "stops": palette.YLGNBU,
        "inclusion": palette.REGIONS[4],
        "sentences": SENTENCES | {"outside": _OUTSIDE},
    }
