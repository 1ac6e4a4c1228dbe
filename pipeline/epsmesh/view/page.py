"""One case as a page to turn with the mouse or by touch: one HTML file that holds all it needs."""

from math import isfinite, isnan
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from epsmesh.files import write_whole
from epsmesh.pages import compressed, hash_of, joined, json_in_page, layout, packed, render_page
from epsmesh.quantities import QUANTITIES, readable
from epsmesh.report.words import barred
from epsmesh.shapes.support import NONE
from epsmesh.study.case import Case
from epsmesh.view import palette
from epsmesh.view.fields import Fields
from epsmesh.view.numbers import colours_of, mesh_arrays, shift_unit
from epsmesh.view.tool import tool_of
from epsmesh.view.viewpoint import Viewpoint

SCENE = Path(__file__).parent / "templates"
_LIBRARY = Path(__file__).parent / "vendor" / "three.min.js"
_MM = 1e3


def write_page(fields: Fields, path: Path, title: str) -> Path:
    """Write the page of a case to ``path``, in place of an earlier one only once it is whole."""
    return write_whole(path, render(fields, title))


def render(fields: Fields, title: str) -> str:
    """Return the page of a case as HTML; it loads nothing else."""
    return render_scene(
        SCENE / "view.html.j2",
        [SCENE / "mesh.js", SCENE / "view.js"],
        [],
        inputs=_inputs(fields),
        arrays=mesh_arrays(fields),
        title=title,
        facts=_facts(fields),
    )


def render_scene(
    template: Path,
    scripts: list[Path],
    styles: list[Path],
    *,
    inputs: dict[str, Any],
    arrays: dict[str, npt.NDArray[Any]],
    **content: Any,
) -> str:
    """Return a page in three dimensions: ``inputs`` and ``arrays`` are for its scripts, ``content`` for its template.

    The library is compressed; a script puts it into the page, where the policy allows it by its hash.
    """
    library = _LIBRARY.read_text(encoding="ascii")
    ink = {"footprint": palette.FOOTPRINT, "held": palette.HELD, "probe": palette.TOOL, "outline": palette.OUTLINE}
    return render_page(
        template,
        joined(SCENE / "scene.js", *scripts),
        base=SCENE,
        style=joined(SCENE / "scene.css", *styles),
        inputs=json_in_page(inputs | {"ink": ink, "arrays": layout(arrays)}),
        numbers=packed(arrays),
        library=compressed(library.encode(), 9),
        library_hash=hash_of(library),
        **content,
    )


def _facts(fields: Fields) -> list[str]:
    """Return, in words, the case, its force and the size of its mesh."""
    case = str(fields.case)
    facts = [case] if fields.case.axes else []
    of = "elastic " if fields.case.probe.history else ""
    if not isnan(fields.force):
        where = ", on the meridian" if fields.on_meridian else ""
        factor, unit = readable("force")
        force = barred(factor * fields.force, factor * abs(fields.force) * fields.force_error, unit)
        facts.append(f"{of}F = {force}{where}")
        facts += [
            f"{QUANTITIES[name].symbol} = {barred(factor * value, factor * bar, unit)}"
            for name, (value, bar) in fields.besides.items()
        ]
    return [*facts, fields.size]


def _inputs(fields: Fields) -> dict[str, Any]:
    """Return what the script needs besides arrays and colours; lengths in mm, places relative to the contact."""
    view = Viewpoint.of(fields.case.frame, fields.planes)
    case, is_solved = fields.case, fields.displacement is not None
    # What is below the body is seen, too: the second jaw of a grasp, or the plane of a support.
    alone = case.jaw is None and case.body.resting is None
    seen = fields.points if alone else np.vstack([fields.points, tool_of(fields).points])
    low, high = (_MM * (end(seen, axis=0) - fields.contact) for end in (np.min, np.max))
    return {
        "colours": colours_of(fields),
        "shift": _MM * shift_unit(fields),
        "front": view.front.tolist(),
        "side": view.side.tolist(),
        "outward": view.outward.tolist(),
        "eye": view.eye.tolist(),
        "low": low.tolist(),
        "high": high.tolist(),
        "radius": float(np.linalg.norm(high - low) / 2),
        "tool": _MM * fields.case.probe.circumradius,
        "epsilon": _MM * fields.epsilon if isfinite(fields.epsilon) else None,
        "largest": _MM * float(fields.magnitude.max()) if is_solved else 0,
        "factor": fields.visible_factor if is_solved else 0,
        "start": fields.drawn_factor if is_solved else 0,
        "keeps_depth": not fields.case.probe.is_flat,
        "outline": [(_MM * (line - fields.contact)).round(4).tolist() for line in fields.outline],
        "touching": _touching(case),
        "held": _held(case),
    }


def _touching(case: Case) -> str:
    """Return what is said of rigid bodies that touch the tissue, "" if there is none."""
    if case.jaw is not None:
        return "jaws"
    found = {"tool": case.probe.elastic is None, "support": case.body.resting is not None}
    return " and ".join(name for name, is_there in found.items() if is_there)


def _held(case: Case) -> str:
    """Return what is said of the part that holds the body, "" if there is none."""
    if case.body.resting is not None:
        return "on the support"
    return "" if case.body.fixed == NONE else "fixed"
