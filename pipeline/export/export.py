"""A study as a real-time model: tabulated, its bar fitted to full solves, and judged on others."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.export.checks import TOOLS, Check, check_touches, columns, needed, random_touches, told, with_bar
from pipeline.export.compliance import coarse_mesh, compliances, law_of
from pipeline.export.curved import curved_model
from pipeline.export.far import far_fields
from pipeline.export.file import write_model
from pipeline.export.full import Solver
from pipeline.export.pairs import tabulate_pairs
from pipeline.export.ranks import ALONE, Ranks
from pipeline.export.region import Region
from pipeline.export.scope import ExportError, Scope
from pipeline.export.seen import seen_body
from pipeline.export.surface import tabulate_surface
from pipeline.export.tabulate import Places, tabulate
from pipeline.realtime.model import Model
from pipeline.realtime.surface import SurfaceTable
from pipeline.shapes.body import Layered

# What is left out beside the sides, of the smaller of half the width and the thickness; how large contact may be, in
# units of the way to the nearest side or the bottom.
MARGIN, LARGEST = 0.15, 0.4
# The table may miss c by this share of what the asked accuracy leaves for the largest disc; full solves are as much
# more precise, those of two discs that make a curved body's table less. Bars before they are fitted: of c, of h's part,
# and of the fourth power of what a contact measures; besides, no bar is shorter than what full solves tell.
_SHARE, _PRECISE, _PRECISE_CURVED, _PRECISE_TABLE, _BARS = 0.4, 0.25, 0.5, 1.0, (1e-3, 0.03, 0.1)
_SEEDS = (1, 2)
# How far off a flat face a query may be, in units of the thickness.
_OFF = 1e-6


@dataclass(frozen=True)
class Exported:
    """A model with the touches that its bar was fitted to and those that it was judged on; places solved for.

    ``unseen`` says why it has no visible surface, where one was asked for.
    """

    model: Model
    fitted: list[Check]
    judged: list[Check]
    missed: float
    places: int
    surface: SurfaceTable | None = None
    unseen: str = ""

    @property
    def held(self) -> float:
        """The share of the judged touches whose error the bars hold."""
        return float(np.mean([check.is_held for check in self.judged]))

    def summary(self, accuracy: float) -> dict[str, float]:
        """Return what there is to say of it, with what share of its judged touches is as near as was asked for."""
        errors = np.abs([check.error for check in self.judged])
        return {
            "places": self.places,
            "coefficients": 2 * self.model.table.reciprocal.size,
            "judged": len(self.judged),
            "held": self.held,
            "largest_error": float(errors.max()),
            "as_asked": float(np.mean(errors <= accuracy)),
            "median_bar": float(np.median([check.bar for check in self.judged])),
            "table_missed": self.missed,
        }


def export(
    scope: Scope,
    accuracy: float,
    checks: int,
    *,
    margin: float = MARGIN,
    largest: float = LARGEST,
    surface: bool = False,
    ranks: Ranks = ALONE,
) -> Exported:
    """Return the model of a study to a relative ``accuracy``, with half of ``checks`` fitted to and half judged on.

    With ``surface`` it holds what is seen of the body, too. Collective: ``ranks`` share what there is to solve.

    Raises:
        ExportError: if the body leaves no region.
        MeshError, SolveError, RuntimeError: if a mesh, a regular part or a full solve fails.
    """
    precise = _PRECISE * accuracy if scope.is_flat else _PRECISE_CURVED * accuracy
    solver = Solver(scope.sections, scope.file, scope.young, precise)
    make = _flat if scope.is_flat else curved_model
    of_table = replace(solver, accuracy=_PRECISE_TABLE * accuracy)
    bare, missed, places = make(scope, of_table, accuracy, largest, (*_BARS, precise), margin, ranks)
    tools = range(len(TOOLS)) if len(bare.table.tensors) else (0,)
    halves = [checks - checks // 2, checks // 2]
    touches = [random_touches(bare, count, seed, tools) for count, seed in zip(halves, _SEEDS, strict=True)]
    checked = check_touches(bare, solver, [*touches[0], *touches[1]], ranks)
    fitted, judged = checked[: halves[0]], checked[halves[0] :]
    # What is beyond the bar of a bonded tool alone is no matter of the others.
    plain = [check for check in fitted if TOOLS[check.kind] != "bonded"]
    floor = precise if scope.is_flat else told(plain, bare.bar[3])
    factor = needed([with_bar(replace(bare, bar=(*_BARS, floor)), check) for check in plain], floor)
    first, second, third = _BARS
    model = replace(bare, bar=(factor * first, factor * second, factor * third, floor))
    fitted, judged = ([with_bar(model, check) for check in half] for half in (fitted, judged))
    seen, unseen = None, ""
    if surface or scope.is_flat:
        ranks.note("the visible surface")
        try:
            far = far_fields(seen_body(scope, model, margin, ranks), scope.poissons)
        except ExportError as reason:
            unseen = str(reason)
        else:
            seen = tabulate_surface(far, model.origin) if surface else None
            model = replace(model, pairs=tabulate_pairs(far)) if scope.is_flat else model
    return Exported(model, fitted, judged, missed, places, seen, unseen)


def _flat(
    scope: Scope,
    _: Solver,
    accuracy: float,
    largest: float,
    bar: tuple[float, float, float, float],
    margin: float,
    ranks: Ranks,
) -> tuple[Model, float, int]:
    """Return the model of a flat body, by how much its table missed, and the number of places solved; collective."""
    assert isinstance(scope.body, Layered)
    region = Region.of(scope.body, margin)
    if min(region.reach) <= 0:
        raise ExportError("the body leaves no region: ask for a smaller margin")
    ranks.note("meshing the body")
    mesh = coarse_mesh(scope.case, region, ranks=ranks)
    solved: list[tuple[float, float]] = []

    def counted(places: Places, poisson: float) -> FloatArray:
        solved.extend(places)
        ranks.note(f"places solved for: {len(solved)}, ν = {poisson:.3g}")
        law = law_of(scope, poisson)
        return np.array(ranks.together(places, lambda some: list(compliances(mesh, region, some, poisson, law))))

    table, missed = tabulate(region, scope.poissons, counted, _SHARE * accuracy)
    model = Model(
        table,
        np.array([0.0, 0.0, scope.body.heights[1]]),
        np.eye(3),
        region.sides,
        region.thickness,
        scope.young,
        scope.poisson,
        largest,
        bar,
        off=_OFF * region.thickness,
    )
    return model, missed, len(solved)


def write(exported: Exported, path: Path, scope: Scope, study: Path, version: str) -> None:
    """Write a model with its checks and where it comes from."""
    model, body = exported.model, scope.body
    height = body.heights[1] - body.heights[0]
    attributes = {
        "title": f"Real-time model of a {body.shape}",
        "source": f"epsmesh {version}, {study.name}",
        "body": f"{body.shape}, {body.face}, {1e3 * height:g} mm high, held at {body.fixed}",
        "tools": "disc, sphere, sharp cone: frictionless"
        + ("; blade; bonded disc" if len(model.table.tensors) else "")
        + f"; along the normal, contact up to {model.largest:g} of the way to a side, the bottom or other tissue",
        "held": f"{sum(check.is_held for check in exported.judged)} of {len(exported.judged)} judged touches",
    }
    write_model(path, model, columns(exported.fitted, exported.judged), attributes, exported.surface)
