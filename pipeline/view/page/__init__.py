"""One case as a page to turn round with the mouse or by touch: one HTML file that holds all it needs."""

from math import isfinite, isnan
from pathlib import Path
from typing import Any

from pipeline.files import write_whole
from pipeline.html import joined, json_in_page, render_page
from pipeline.quantities import write
from pipeline.view import palette
from pipeline.view.fields import Fields
from pipeline.view.page.numbers import Numbers, mesh_numbers
from pipeline.view.viewpoint import Viewpoint

TEMPLATES = Path(__file__).parent / "templates"
_SCRIPTS = ("mesh.js", "scene.js", "camera.js", "page.js")  # each knows those before it
_MM = 1e3


def write_page(fields: Fields, path: Path, title: str) -> Path:
    """Write the page of a case to ``path``, in place of an earlier one only once it is whole."""
    return write_whole(path, render(fields, title))


def render(fields: Fields, title: str) -> str:
    """Return the page of a case as HTML; it loads nothing else."""
    numbers = mesh_numbers(fields)
    return render_page(
        TEMPLATES / "view.html.j2", joined(*(TEMPLATES / name for name in _SCRIPTS)),
        title=title, facts=_facts(fields), style=joined(TEMPLATES / "view.css"),
        told=json_in_page(_told(fields, numbers)), numbers=numbers.text,
    )  # fmt: skip


def _facts(fields: Fields) -> list[str]:
    """Return, in words, what the case came to."""
    case, count = str(fields.case), f"{len(fields.cells):,} elements"
    facts = [case] if fields.case.axes else []
    if not isnan(fields.force):
        bar = "" if isnan(fields.force_error) else f" ± {100 * fields.force_error:.2g} %"
        facts.append(f"F = {write('force', float(f'{fields.force:.4g}'))}{bar}")
    return [*facts, f"{count}, {fields.dofs:,} unknowns" if fields.dofs else count]


def _told(fields: Fields, numbers: Numbers) -> dict[str, Any]:
    """Return what the script is told besides the arrays; lengths in mm, places relative to the contact."""
    view = Viewpoint.of(fields.case.frame, fields.planes)
    low, high = fields.points.min(axis=0), fields.points.max(axis=0)
    outline = [_MM * (line - fields.contact) for line in fields.outline]
    return {
        "arrays": numbers.layout,
        "colours": numbers.colours,
        "front": view.front.tolist(), "side": view.side.tolist(), "outward": view.outward.tolist(),
        "eye": view.eye.tolist(),
        "centre": (_MM * ((low + high) / 2 - fields.contact)).tolist(),
        "radius": float(_MM * ((high - low) @ (high - low)) ** 0.5 / 2),
        "tool": _MM * fields.case.probe.circumradius,
        "epsilon": _MM * fields.epsilon if isfinite(fields.epsilon) else None,
        "factor": 0 if fields.displacement is None else fields.visible_factor,
        "shift": numbers.shift,
        "outline": [line.round(4).tolist() for line in outline],
        "ink": {"footprint": palette.FOOTPRINT, "held": palette.HELD, "probe": palette.TOOL},
    }  # fmt: skip
