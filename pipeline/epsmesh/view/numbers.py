"""The numbers of a page: the mesh and what happens on it, small enough for a file that is sent by mail.

Every corner and every cell of the body is in it, as the page cuts it wherever it is asked to. Points are sorted along
Morton's curve and cells by their points, which leaves differences of few bits; arrays are stored by planes of bytes and
deflated: about 7 bytes a cell, where a list of cells and points takes 30.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.scene.model import CUT, FIXED, JAW, PROBE
from epsmesh.shapes.triangles import facet_keys
from epsmesh.view.fields import Fields
from epsmesh.view.palette import VIRIDIS, YLGNBU, YLORRD, region_colours
from epsmesh.view.tool import tool_of

_MM, _KPA = 1e3, 1e-3
# Numbers that the script knows groups of the boundary by; 0 is free.
_GROUPS = {PROBE: 1, JAW: 1, FIXED: 2, CUT: 3}
# Strains are shown over this range below the largest, which the singular edge of the probe has.
_STRAINS = 1e-3
# Below this (m) a scale of lengths is read in µm, as in scene.js.
_SMALL = 1e-4
# The largest displacement, in its units.
_HALF = 32767
# Bits of a coordinate along Morton's curve.
_BITS = 10
# The corners of a tetrahedron's face, by the corner that it lies opposite to.
FACES = np.array(((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)))


def mesh_arrays(fields: Fields) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of a case's page, by name.

    ``points`` (3, n) in mm from the contact; ``cells`` (4, m), each number the difference to the corner before it, the
    first one's to the cell before; ``faces`` of the boundary, 4 × cell + the corner that it lies opposite to, each the
    difference to the one before, and their ``groups``; ``shift`` (3, n), displacements in units of :func:`shift_unit`;
    ``regions``, ``sizes``, ``young`` and ``strains`` (m), the last three in 0 … 255 of the scale of their colours, as
    are ``pressures``, of the faces; ``tool_points``, ``tool_moved`` (k, 3), mm, and ``tool_triangles``.
    """
    sizes, (used, number) = fields.sizes, _along_curve(fields.points, fields.cells[:, :4])
    corners = np.sort(number[fields.cells[:, :4]], axis=1)
    order = np.lexsort(corners.T[::-1])
    corners = corners[order]
    regions = np.zeros(len(corners), dtype=np.int64) if fields.regions is None else fields.regions
    tool = tool_of(fields)
    arrays: dict[str, npt.NDArray[Any]] = {
        "points": (_MM * (fields.points[used] - fields.contact)).T.astype("<f4"),
        "cells": np.vstack([np.diff(corners[:, 0], prepend=0), np.diff(corners, axis=1).T]).astype("<i4"),
        **_faces(corners, {name: number[facets] for name, facets in fields.facets.items()}, fields.pressure),
        "regions": regions[order].astype("u1" if regions.max(initial=0) < 256 else "i4"),
        "sizes": _steps(sizes, float(sizes.min()))[order],
        "tool_points": (_MM * (tool.points - fields.contact)).astype("<f4"),
        "tool_moved": (_MM * tool.moved).astype("<f4"),
        "tool_triangles": tool.triangles.astype("<i4"),
    }
    if fields.young is not None:
        arrays["young"] = _steps(fields.young, float(fields.young.min()))[order]
    if fields.displacement is not None and fields.strain is not None:
        arrays["shift"] = np.round(fields.displacement[used] / shift_unit(fields)).T.astype("<i2")
        arrays["strains"] = _steps(fields.strain, _STRAINS * float(fields.strain.max()))[order]
    return arrays


def shift_unit(fields: Fields) -> float:
    """Return the length (m) of a displacement's unit, 1 where there is none."""
    return 1.0 if fields.displacement is None else float(np.abs(fields.displacement).max()) / _HALF


def unit_of_length(largest: float) -> tuple[str, float]:
    """Return the unit in which lengths up to ``largest`` (m) are read, and its factor."""
    return ("µm", 1e6) if largest < _SMALL else ("mm", _MM)


def colours_of(fields: Fields) -> list[dict[str, Any]]:
    """Return what can colour the body, each with its scale or its labels."""
    names, sizes = list(fields.region_names), _MM * fields.sizes
    regions = {"name": "region", "array": "regions", "labels": names, "stops": region_colours(len(names))}
    size = _scale("element size", "mm", float(sizes.min()), float(sizes.max()), VIRIDIS, array="sizes")
    last = [size]
    if (young := fields.young) is not None:
        low, high = _KPA * float(young.min()), _KPA * float(young.max())
        last = [_scale("Young's modulus", "kPa", low, high, VIRIDIS, array="young"), size]
    if pressures := fields.pressure.values():
        most = max(float(own.max(initial=0.0)) for own in pressures)
        last = [_scale("contact pressure", "kPa", 0.0, _KPA * most, YLORRD, array="pressures", of_faces=True), *last]
    if fields.displacement is None or fields.strain is None:
        return [regions, *last]
    largest, worst = float(fields.magnitude.max()), 100 * float(fields.strain.max())
    unit, factor = unit_of_length(largest)
    strain = _scale("largest principal strain", "%", _STRAINS * worst, worst, YLORRD, array="strains")
    return [regions, _scale("displacement", unit, 0.0, factor * largest, YLGNBU), strain, *last]


def _scale(
    name: str, unit: str, low: float, high: float, stops: tuple[str, ...], array: str = "", *, of_faces: bool = False
) -> dict[str, Any]:
    """Describe a scale of colours: logarithmic, of an array of the cells, or linear, of the displacement or faces."""
    return {
        "name": name,
        "unit": unit,
        "limits": [low, high],
        "stops": list(stops),
        "array": array,
        "linear": of_faces or not array,
        "faces": of_faces,
    }


def _along_curve(points: FloatArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """Return the points that are ``corners``, sorted along Morton's curve, and every point's number among them."""
    used = np.unique(corners)
    offset = points[used] - points[used].min(axis=0)
    grid = (offset / offset.max() * (2**_BITS - 1)).astype(np.int64)
    code = np.zeros(len(used), dtype=np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= ((grid[:, axis] >> bit) & 1) << (3 * bit + axis)
    used = used[np.argsort(code, kind="stable")]
    number = np.full(len(points), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    return used, number


def _faces(
    corners: IntArray, facets: dict[str, IntArray], pressure: dict[str, FloatArray]
) -> dict[str, npt.NDArray[Any]]:
    """Find the boundary's triangles ``facets`` among the faces of cells, by their ``corners`` (m, 4).

    Some groups of them have a contact ``pressure`` (Pa).

    Raises:
        ValueError: if a triangle is the face of no cell.
    """
    triangles = np.vstack(list(facets.values()))
    is_on = np.isin(np.arange(corners.max() + 1), triangles)
    near = np.flatnonzero(is_on[corners[:, FACES]].all(axis=-1))  # 4 × cell + the corner opposite to the face
    known, faces = facet_keys(triangles), facet_keys(corners[:, FACES].reshape(-1, 3)[near])
    groups = np.repeat([_GROUPS.get(name, 0) for name in facets], [len(facet) for facet in facets.values()])
    _, place, found = np.intersect1d(faces, known, return_indices=True)
    if len(found) < len(known):
        raise ValueError(f"{len(known) - len(found)} triangles of the boundary are the face of no cell")
    codes = near[place]
    order = np.argsort(codes)
    arrays = {
        "faces": np.diff(codes[order], prepend=0).astype("<i4"),
        "groups": groups[found[order]].astype("u1"),
    }
    if pressure:
        values = np.concatenate([pressure.get(name, np.zeros(len(facet))) for name, facet in facets.items()])
        arrays["pressures"] = np.round(255 * values / (values.max() or 1.0)).astype("u1")[found[order]]
    return arrays


def _steps(values: FloatArray, low: float) -> npt.NDArray[np.uint8]:
    """Return where positive values lie between ``low`` and the largest, by their logarithms, in 0 … 255."""
    span = np.log(values.max() / low) or 1.0
    return np.round(255 * np.log(np.maximum(values, low) / low) / span).astype("u1")
