"""The loads of a case for the solver: in newtons, on the mesh turned so that the probe presses along -z."""

from collections.abc import Callable, Mapping

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.frame import Frame, Vector
from epsmesh.shapes.part import FREE, Around, Cap
from epsmesh.shapes.surface import Surface
from epsmesh.shapes.term import BodyTerm
from epsmesh.solve.movement import Loads, SurfaceLoad
from epsmesh.solve.terms import AddedTerm, EnergyTerm
from epsmesh.study.case import Case
from epsmesh.study.loads import Load, Traction

_Test = Callable[[FloatArray, FloatArray], BoolArray]
# A facet belongs to a cap if the cosine between its normal and that at the cap's centre exceeds this.
_SAME_WAY = 0.5


def loads_of(case: Case) -> Loads | None:
    """Return the loads of ``case``, None if there are none."""
    return _loads(case, case.load) if case.load.acts else None


def imaged_loads_of(case: Case) -> Loads | None:
    """Return the loads under which the body has its given shape; None if it has it without load."""
    return None if case.imaged is None else _loads(case, case.imaged)


def _loads(case: Case, load: Load) -> Loads:
    turn = case.frame.turn
    weights: tuple[Vector, ...] = ()
    if any(load.gravity):
        gravity = _turned(turn, load.gravity)
        densities = [density or 0.0 for density in case.densities] * (2 if case.is_linear_beyond else 1)
        weights = tuple((rho * gravity[0], rho * gravity[1], rho * gravity[2]) for rho in densities)
    return Loads(weights, tuple(_surface_load(case, traction) for traction in load.traction if traction.acts))


def terms_of(case: Case) -> tuple[AddedTerm, ...]:
    """Return the terms of the energy besides the law's."""
    turn = case.frame.turn

    def of(term: BodyTerm) -> AddedTerm:
        key = term, None if turn is None else turn.tobytes()  # spaces are those of one mesh, hence of one body
        if isinstance(term.on, Around) and term.on not in case.body.cavities:
            number = case.body.region_names.index(term.on)
            numbers = number, number + len(case.tissues)  # the second of its linear part
            return EnergyTerm(term.energy, key, turn=turn, around=numbers)
        return EnergyTerm(term.energy, key, *_part(case, term.on), turn)

    return tuple(map(of, case.terms))


def _surface_load(case: Case, traction: Traction) -> SurfaceLoad:
    vector, pressure = _turned(case.frame.turn, traction.traction or (0.0, 0.0, 0.0)), traction.pressure or 0.0
    on_facets, within = _part(case, traction.on)
    return SurfaceLoad(on_facets, vector, pressure, within)


def _part(case: Case, on: str | Cap) -> tuple[_Test, tuple[Vector, float] | None]:
    """Return a test of the facets of a part of the boundary, and the ball that bounds it, None for no bound."""
    turn, outer = case.frame.turn, case.body.surfaces()
    cavities = {name: (wall,) for name, wall in case.body.cavities.items()}
    is_outside = _on_face(outer | cavities, (*outer,), case.frame) if cavities else _everywhere
    if isinstance(on, Cap):
        place = case.body.frame(on.around)
        outward = np.array(_turned(turn, place.outward))

        def in_cap(corners: FloatArray, normals: FloatArray) -> BoolArray:
            return np.asarray(normals @ outward > _SAME_WAY) & is_outside(corners, normals)

        return in_cap, (_turned(turn, place.point), on.radius)
    return (is_outside if on == FREE else _on_face(outer | cavities, (on,), case.frame)), None


def _everywhere(corners: FloatArray, _: FloatArray) -> BoolArray:
    return np.ones(len(corners), dtype=bool)


def _on_face(surfaces: Mapping[str, tuple[Surface, ...]], names: tuple[str, ...], frame: Frame) -> _Test:
    """Return a test of facets: whether one of the faces ``names`` is the nearest of all ``surfaces``.

    All corners of a facet beside an edge may be on another face; its middle is then not.
    """

    def on_face(corners: FloatArray, _: FloatArray) -> BoolArray:
        points = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
        points = points.reshape(-1, 3) if frame.turn is None else points.reshape(-1, 3) @ frame.turn
        away = {
            key: np.min([_farthest(surface, points) for surface in parts], axis=0) for key, parts in surfaces.items()
        }
        return np.asarray(np.min([away[name] for name in names], axis=0) <= np.min(list(away.values()), axis=0))

    return on_face


def _farthest(surface: Surface, points: FloatArray) -> FloatArray:
    """Return the largest distance (m) of each facet's four points from a surface."""
    return np.asarray(np.abs(surface.distance(points)).reshape(-1, 4).max(axis=1))


def _turned(turn: FloatArray | None, vector: Vector) -> Vector:
    if turn is None:
        return vector
    x, y, z = map(float, turn @ np.array(vector))
    return x, y, z
