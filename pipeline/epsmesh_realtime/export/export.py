"""A study as a real-time model: tables, an error bar calibrated on full solves, and a test on others."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.run.loads import terms_of
from epsmesh.shapes.body import Layered
from epsmesh_realtime.export.checks import TOOLS, Check, check_touches, columns, narrowest, random_touches, with_bar
from epsmesh_realtime.export.compliance import coarse_mesh, each_compliance, law_of
from epsmesh_realtime.export.curved import curved_model
from epsmesh_realtime.export.far import far_fields
from epsmesh_realtime.export.file import write_model
from epsmesh_realtime.export.forecast import LARGEST, Export, too_large
from epsmesh_realtime.export.full import Solver
from epsmesh_realtime.export.near import near_field, with_near
from epsmesh_realtime.export.pairs import tabulate_pairs
from epsmesh_realtime.export.ranks import ALONE, Ranks
from epsmesh_realtime.export.region import MARGIN, Region
from epsmesh_realtime.export.scope import ExportError, Scope
from epsmesh_realtime.export.surface import tabulate_surface
from epsmesh_realtime.export.surface_body import inclusions, surface_body
from epsmesh_realtime.export.tabulate import Places, tabulate
from epsmesh_realtime.model import Model
from epsmesh_realtime.surface import SurfaceTable

# Share of the accuracy: the table's error in c for the largest disc. Error bars before calibration: of c, of h, and of
# the contact size to the fourth power.
_SHARE, _BARS = 0.4, (1e-3, 0.03, 0.1)
_SEEDS = (1, 2)
_UNSEEN = "at large displacements there is only a force"
# Largest distance of a query from a flat face, in units of the thickness.
_OFF = 1e-6


@dataclass(frozen=True)
class Exported:
    """A model, the touches of its calibration (``fitted``) and of its test (``judged``), the number of places solved.

    ``table_error`` is that of its table. ``unseen`` is why it has no deforming surface, and answers for one tool at a
    time; "" if it has both.
    """

    model: Model
    fitted: list[Check]
    judged: list[Check]
    table_error: float
    places: int
    surface: SurfaceTable | None = None
    unseen: str = ""

    @property
    def covered(self) -> float:
        """The share of the test touches whose error the error bar covers."""
        return float(np.mean([check.is_covered for check in self.judged]))

    @property
    def tools(self) -> str:
        """The tools that the model answers for, in words."""
        more = "; blade; bonded disc" if len(self.model.table.tensors) else ""
        known = f"disc, sphere, sharp cone: frictionless{more}"
        return (
            f"{'sphere: frictionless, at large displacements' if self.model.near else known}; "
            f"along the normal, contact up to {self.model.largest:g} of the distance to a side, the bottom or other "
            "tissue"
        )

    def summary(self, accuracy: float) -> dict[str, float]:
        """Return the model's quality; ``within_accuracy`` is the share of test touches within the ``accuracy``."""
        errors = np.abs([check.error for check in self.judged])
        forces = [check.full for check in (*self.fitted, *self.judged)]
        return {
            "places": self.places,
            "coefficients": 2 * self.model.table.reciprocal.size,
            "tested": len(self.judged),
            "covered": self.covered,
            "largest_error": float(errors.max()),
            "within_accuracy": float(np.mean(errors <= accuracy)),
            "median_bar": float(np.median([check.bar for check in self.judged])),
            "table_error": self.table_error,
            "smallest_force": min(forces),
            "largest_force": max(forces),
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
    """Return the model of a study to a relative ``accuracy``; half of the ``checks`` calibrate it, half test it.

    ``surface`` includes the deforming surface. Collective: ``ranks`` share the solves.

    Raises:
        ExportError: if no region of the body remains.
        MeshError, SolveError, RuntimeError: if a mesh, a Green's function or a full solve fails.
    """
    planned = Export(scope, accuracy, checks, margin, largest, ranks.kept)
    solver = planned.solver
    ranks.note(f"the export needs {planned.forecast().text(ranks.comm.size)}, less what is kept")
    make = _flat if scope.is_flat else curved_model
    of_table = planned.solver_of_table
    bare, error, places = make(scope, of_table, accuracy, largest, (*_BARS, solver.accuracy), margin, ranks)
    bare = replace(bare, tool=scope.tool)
    tools = range(len(TOOLS)) if len(bare.table.tensors) and not scope.law else (0,)
    halves = [checks - checks // 2, checks // 2]
    # Discs calibrate the linear part of a law; balls test the whole.
    of_linear = [halves[0], 0] if scope.law else halves
    touches = [random_touches(bare, count, seed, tools) for count, seed in zip(of_linear, _SEEDS, strict=True)]
    fitted, judged = check_touches(bare, solver, touches, ranks)
    # Bonded tools have further errors, and would enlarge the error bars of the others.
    plain = [check for check in fitted if TOOLS[check.kind] != "bonded"]
    model = replace(bare, bar=narrowest(replace(bare, bar=(*_BARS, 0.0)), plain))
    fitted, judged = ([with_bar(model, check) for check in half] for half in (fitted, judged))
    if scope.law:
        nonlinear = planned.solver_of_law
        near = near_field(scope, nonlinear, ranks)
        model, fitted, judged = with_near(model, near, nonlinear, halves, ranks)
        return Exported(model, fitted, judged, error, places, None, _UNSEEN if surface else "")
    seen, unseen = None, ""
    ranks.note("solving for the deforming surface")
    try:
        far = far_fields(surface_body(scope, model, margin, ranks), scope.poissons)
    except ExportError as reason:
        unseen = str(reason)
    else:
        if surface:
            table = tabulate_surface(far, model.axes @ model.origin)
            seen = replace(table, inside=inclusions(scope.body, model))
        model = replace(model, pairs=tabulate_pairs(far))
    return Exported(model, fitted, judged, error, places, seen, unseen)


def _flat(
    scope: Scope,
    _: Solver,
    accuracy: float,
    largest: float,
    bar: tuple[float, float, float, float],
    margin: float,
    ranks: Ranks,
) -> tuple[Model, float, int]:
    """Return the model of a flat body, the error of its table, and the number of places solved; collective."""
    assert isinstance(scope.body, Layered)
    region = Region.of(scope.body, margin)
    if min(region.reach) <= 0:
        raise ExportError("the body leaves no region: make it wider")
    if doubt := too_large(scope, largest * region.room(0.0, 0.0)):
        ranks.note(f"warning: {doubt}")
    ranks.note("meshing the body")
    mesh = coarse_mesh(scope.case, region, ranks=ranks)
    solved: list[tuple[float, float]] = []
    terms = terms_of(scope.case)

    def found(places: Places, poisson: float) -> FloatArray:
        solved.extend(places)
        law, what = law_of(scope, poisson), f"places solved for ν = {poisson:.3g}"
        given = (region, poisson)
        return np.array(
            ranks.keeping(places, lambda some: each_compliance(mesh, region, some, poisson, law, terms), what, given)
        )

    table, error = tabulate(region, scope.poissons, found, _SHARE * accuracy)
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
        relaxation=scope.relaxation,
    )
    return model, error, len(solved)


def write(exported: Exported, path: Path, scope: Scope, study: Path, version: str) -> None:
    """Write a model with its checks and its origin."""
    model, body = exported.model, scope.body
    height = body.heights[1] - body.heights[0]
    attributes = {
        "title": f"Real-time model of a {body.shape}",
        "source": f"epsmesh {version}, {study.name}",
        "body": f"{body.shape}, {body.face}, {1e3 * height:g} mm high, fixed at {body.fixed}",
        "tools": exported.tools,
        "covered": f"{sum(check.is_covered for check in exported.judged)} of {len(exported.judged)} test touches",
    }
    write_model(path, model, columns(exported.fitted, exported.judged), attributes, exported.surface)
