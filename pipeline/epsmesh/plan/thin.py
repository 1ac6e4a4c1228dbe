"""Layers and regions so thin that elements by their thickness are too many to be meshed, or most of a mesh."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from epsmesh.plan import estimate
from epsmesh.plan.steps import Solve
from epsmesh.shapes.body import Layered
from epsmesh.shapes.regions import Embedded
from epsmesh.shapes.section import in_mm
from epsmesh.shapes.segment import Segment
from epsmesh.study.case import Case
from epsmesh.study.problems import Problem, StudyError
from epsmesh.study.regions import place_of

# Most tetrahedra that a layer or a region may ask for: gmsh takes 20 minutes and 20 GB for so many.
MOST = 20e6
# From so many on, and above this share of all, a layer or region is named where the mesh fails.
_MANY, _SHARE = 20_000, 0.5


@dataclass(frozen=True)
class Thin:
    """A layer or region, the key of a study that says so with its value, its thickness (m), and its tetrahedra."""

    key: str
    value: Any
    name: str
    thickness: float
    tetrahedra: float
    is_drawn: bool

    def way_out(self, share: float = 1.0) -> str:
        """Return what to do, for ``share`` of the tetrahedra to be few enough."""
        enough = self.thickness * max(share * self.tetrahedra / MOST, 1.0) ** 0.5
        thicker = f"make it at least {in_mm(enough)} thick" if enough > self.thickness else "make it thicker"
        if self.is_drawn:
            return f"{thicker}, cut the body off at a smaller `epsilon` or size, or leave the layer out"
        return f"{thicker}, make it one with its neighbour, or leave it out"


def thinnest(case: Case) -> Thin | None:
    """Return the layer or region of a case that asks for the most tetrahedra, None without any."""
    body = case.body
    if not body.regions:
        return None
    counts = estimate.cells_of_regions(case)
    number = int(np.argmax(counts))
    piece, place = body.regions[number], body.places[number]
    if isinstance(piece, Embedded):
        is_named = isinstance(piece, Segment)
        key, value = place_of(piece, place) if is_named else (f"body.{place}", None)
        return Thin(key, value, piece.name, 2 * piece.surface.least, counts[number], is_drawn=False)
    assert isinstance(body, Layered)
    ends = (body.heights[1], *body.interfaces, body.heights[0])
    thickness = ends[number] - ends[number + 1]
    return Thin(f"body.{place}.thickness", in_mm(thickness), piece.name, thickness, counts[number], is_drawn=True)


def refuse_thin(solves: Iterable[Solve], file: str) -> None:
    """Refuse solves in three dimensions whose layers or regions are too thin to be meshed.

    Raises:
        StudyError: with each of these layers and regions once.
    """
    problems, seen = [], set()
    for solve in solves:
        case, share = solve.meshed_case, 0.5 ** len(solve.mirrors)
        scene = (id(case.body), case.frame.point, case.mesh)
        if solve.axisymmetric or solve.is_reference or scene in seen:
            continue
        seen.add(scene)
        thin = thinnest(case)
        if thin is not None and share * thin.tetrahedra > MOST:
            limit, way_out = f"a mesh may have at most {MOST:,.0f} of them", thin.way_out(share).capitalize()
            problems.append(Problem(thin.key, thin.value, f"{_words(thin, share)}; {limit}. {way_out}"))
    if problems:
        raise StudyError(file, problems)


def cause(case: Case) -> str:
    """Return a sentence about the layer or region that asks for most of a mesh, which failed; "" if none does."""
    thin = thinnest(case)
    if thin is None or thin.tetrahedra < max(_MANY, _SHARE * estimate.cells(case)):
        return ""
    value = "" if thin.value is None else f" = {thin.value}"
    return f"{thin.key}{value}: {_words(thin)}: {thin.way_out()}"


def _words(thin: Thin, share: float = 1.0) -> str:
    count = float(f"{share * thin.tetrahedra:.2g}")
    return f"{thin.name} is {in_mm(thin.thickness)} thick, for which about {count:,.0f} tetrahedra are needed"
