"""A label map as a page, before a study exists: surfaces, slices, and places with what a study needs of them."""

from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from epsmesh.files import write_whole
from epsmesh.shapes.files.label_map import LabelMap
from epsmesh.view import palette
from epsmesh.view.page import SCENE, render_scene
from epsmesh.view.segments import Segment, block, slices_of, surfaces_of

_MM = 1e3
_EYE = np.array([0.5, 0.75, 0.4]) / hypot(0.5, 0.75, 0.4)  # from the front, the right and above


def write_image_page(found: LabelMap, segments: list[Segment], path: Path, given: dict[str, str]) -> Path:
    """Write the page of a label map; ``given`` are file, unit and names, as a study has them."""
    return write_whole(path, render(found, segments, given))


def render(found: LabelMap, segments: list[Segment], given: dict[str, str]) -> str:
    """Return the page of a label map as HTML; it loads nothing else."""
    box = np.array([[one.box[end] for one in segments] for end in (0, 1)])
    low, high = _MM * box[0].min(axis=0), _MM * box[1].max(axis=0)
    centre = (low + high) / 2
    values, affine = slices_of(found)
    inverse = np.linalg.inv(_MM * affine[:, :3])
    colours = palette.region_colours(len(segments))
    shape, spacing = " × ".join(map(str, found.values.shape)), " × ".join(f"{_MM * s:.3g}" for s in found.spacing)
    return render_scene(
        SCENE / "image.html.j2",
        [SCENE / "places.js", SCENE / "image.js"],
        [SCENE / "image.css"],
        inputs={
            "eye": _EYE.tolist(),
            "radius": float(np.linalg.norm(high - low) / 2),
            "centre": centre.tolist(),
            "low": (low - centre).tolist(),
            "high": (high - centre).tolist(),
            "segments": [_inputs(one, colour, given) for one, colour in zip(segments, colours, strict=True)],
            "shape": values.shape,
            "spacing": (_MM * np.linalg.norm(affine[:, :3], axis=0)).tolist(),
            "inverse": np.column_stack([inverse, -inverse @ (_MM * affine[:, 3])]).tolist(),
        },
        arrays=_arrays(surfaces_of(found, segments), centre) | {"voxels": values.ravel()},
        title=Path(given["file"]).name,
        facts=[f"{shape} voxels of {spacing} mm, {len(segments)} labels", *found.notices],
    )


def _inputs(one: Segment, colour: str, given: dict[str, str]) -> dict[str, Any]:
    return {
        "title": one.title,
        "label": one.label,
        "colour": colour,
        "volume": 1e6 * one.volume,
        "extent": (_MM * one.extent).tolist(),
        "box": (_MM * one.box).tolist(),
        "pieces": one.pieces,
        "cut": one.cut,
        "block": block(one, **given),
    }


def _arrays(surfaces: list[Any], centre: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
    """Return ``points`` (3, n), mm from the centre, ``triangles`` (3, m) and the number of its segment for each."""
    sizes = [len(points) for points, _ in surfaces]
    starts = np.cumsum([0, *sizes[:-1]])
    points = np.vstack([points for points, _ in surfaces])
    triangles = np.vstack([facets + start for (_, facets), start in zip(surfaces, starts, strict=True)])
    owners = np.repeat(np.arange(len(surfaces)), [len(facets) for _, facets in surfaces])
    return {
        "points": (_MM * points - centre).T.astype("<f4"),
        "triangles": triangles.T.astype("<i4"),
        "owners": owners.astype("u1"),
    }
