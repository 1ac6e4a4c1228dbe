"""Which mesh gives the accuracy that was asked for: elements, rim and growth, cheapest first.

The error of F comes from the probe's edge and from what the elements can follow between there and the support: both
scale with the probe, hardly with the body. What an error bar costs and leaves was measured on cylinders
(docs/accuracy.md); the bar of the case itself decides whether its mesh was good enough, or the next one is tried.
"""

from dataclasses import dataclass
from typing import Any

from pipeline.study.check import held_gaps
from pipeline.study.schema import Mesh
from pipeline.study.sweep import Case


@dataclass(frozen=True)
class Recipe:
    """``rim`` is in units of the probe's half width, ``bar`` the relative error bar to expect at ν = 0.3."""

    degree: int
    rim: float
    growth: float
    bar: float


LADDER = (
    Recipe(2, 0.2, 0.5, 3.0e-3),
    Recipe(2, 0.1, 0.4, 1.4e-3),
    Recipe(3, 0.2, 0.5, 7.7e-4),
    Recipe(3, 0.1, 0.4, 3.2e-4),
    Recipe(3, 0.05, 0.35, 1.6e-4),
    Recipe(3, 0.025, 0.3, 8.0e-5),
)
# Bars of displacement elements grow like (1 - 2 ν)^-0.35 on the way to locking; measured from ν = 0.3 to 0.49.
_LOCKING = 0.35
# A bar is expected to be met if the mesh should give this share of it.
_MARGIN = 0.8
# Elements between the probe's edge and a held face beside it.
_ACROSS_GAP = 3
# Elements through the thickness of a layer, near the probe.
_THROUGH = 2


def meshes_for(case: Case, accuracy: float) -> tuple[Mesh, ...]:
    """Return the mesh settings to try, in turn, for a relative error of F below ``accuracy``.

    What the study file gives of rim, growth, degree and sizes is kept.
    """
    expected = [recipe.bar * _growth_with_poisson(case) for recipe in LADDER]
    first = next((i for i, bar in enumerate(expected) if bar <= _MARGIN * accuracy), len(LADDER) - 1)
    meshes = [_mesh(case, recipe) for recipe in LADDER[first:]]
    return tuple(dict.fromkeys(meshes))


def _growth_with_poisson(case: Case) -> float:
    if case.element == "mixed":
        return 1.0
    return float(((1 - 2 * case.material.poisson) / 0.4) ** -_LOCKING)


def _mesh(case: Case, recipe: Recipe) -> Mesh:
    """Return the mesh section of a recipe for the body and probe of ``case``."""
    given, probe, thickness = case.mesh, case.probe, case.body.height
    reach = case.body.reach(probe.at) + thickness
    gaps = held_gaps(case.body, probe, given).values()
    sizes = {
        "fine": min(thickness / _THROUGH, reach),
        "coarse": reach,
        "rim": min([recipe.rim * probe.half_width, *(gap / _ACROSS_GAP for gap in gaps)]),
        "growth": recipe.growth,
        "degree": recipe.degree,
    }
    chosen: dict[str, Any] = {key: value for key, value in sizes.items() if key not in given.model_fields_set}
    chosen.setdefault("fine", given.fine)
    if "rim" in chosen:
        chosen["rim"] = min(chosen["rim"], chosen["fine"])
    if not case.is_truncated:
        chosen["epsilon"] = probe.circumradius + thickness
        chosen["outside"] = "coarse"
    return given.model_copy(update=chosen | {"accuracy": None})
