"""Parameters of an insertion for needles of SOFA and of iMSTK: threshold, friction, cutting.

Names are those of the programs' sources: `tests/export/plugins.toml` has file and commit of each. SI units.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import indent, wrap

import numpy as np
import xarray as xr

from epsmesh.arrays import FloatArray
from epsmesh.insertion.steps import CUTTING, PHASES
from epsmesh.study.insertion_stages import interfaces
from epsmesh.study.sweep import Study
from epsmesh_realtime.export.insertion import friction_per_depth, one_path, punctures_of, tool_of
from epsmesh_realtime.export.scope import ExportError

# What a scene cannot have from an insertion, or has no parameter for.
OF_SOFA = (
    "the force of cutting and the elastic force on the shaft have no key: after the puncture InsertionAlgorithm has no "
    "force at the tip. They are CUTTING and ELASTIC, to be applied to the tip while it advances",
    "the depth of the puncture follows from the scene's mesh and tissue: compare it with DEPTHS",
    "punctureForceThreshold is compared with the sum of the norms of all constraint forces of the tip's state: attach "
    "nothing else to that state",
    "frictionCoeff is no coefficient of friction, but a factor of the solver's steps: it is 1, and maxForce is the "
    "friction of one coupling point, an impulse",
    "friction depends on the number of coupling points: one each tipDistThreshold, and the point of the puncture",
    "the deformation of the tissue by the needle's thickness: the plug-in's shaft is a line",
    "rate effects, and tissues or needles other than the study's",
)
OF_IMSTK = (
    "the force of cutting and the elastic force on the shaft have no setter: they are constants here",
    "friction: setFriction is a factor from 0 to 1 of position-based dynamics, and no force: it is left alone. "
    "setStaticFrictionForceThreshold keeps a value that the example's NeedleEmbedder does not use: it is the friction "
    "at the last depth",
    "compliances: they belong to the scene's solver and time step",
    "the threshold is compared with the force of the device along the needle, in the scene's units: scale a device's "
    "force by 1, lengths in m",
    "a tissue of several layers: the example has one threshold for each pair of tissue and needle",
    "the depth of the puncture follows from the scene's mesh and tissue: compare it with the constants here",
    "rate effects, and tissues or needles other than the study's",
)


@dataclass(frozen=True)
class Number:
    """A value in SI units with its error bar."""

    value: float
    error: float

    def __str__(self) -> str:
        return f"{self.value:.6g}, {self.error:.3g}"


@dataclass(frozen=True)
class Pierced:
    """A layer: force before its puncture and depth, force of cutting, elastic force (N), friction per depth (N/m)."""

    name: str
    force: Number
    depth: Number
    cutting: Number
    elastic: Number
    friction: Number


@dataclass(frozen=True)
class NeedleNumbers:
    """What a scene needs of an insertion: its layers that are pierced, and the last depth (m) with its friction (N)."""

    title: str
    layers: tuple[Pierced, ...]
    deepest: float
    last: Number
    spacing: float

    def data(self) -> dict[str, object]:
        """Return it for JSON."""
        return {
            "layers": [
                {"name": layer.name}
                | {
                    key: [getattr(layer, key).value, getattr(layer, key).error]
                    for key in ("force", "depth", "cutting", "elastic", "friction")
                }
                for layer in self.layers
            ],
            "deepest": self.deepest,
            "friction_there": [self.last.value, self.last.error],
        }


def needle_numbers(study: Study, dataset: xr.Dataset) -> NeedleNumbers:
    """Return what a scene needs of a study's insertion.

    Raises:
        ExportError: if the study has several insertions, or the tissue is not pierced, or not cut at two depths.
    """
    tool_of(study)
    one = one_path(dataset)
    if not (pierced := punctures_of(one)):
        raise ExportError(f"{study.file}: the tissue is not pierced down to the last depth: there is no threshold")
    forward = one.isel(stroke=0) if "stroke" in one.dims else one
    known = np.isfinite(forward["force"].values)
    depths = forward["depth"].values
    deepest = float(depths[known][-1])
    case = next(study.cases())
    layered = [layer.name for layer in getattr(case.body, "layer", ())]
    names = [*layered, "tissue below" if layered else "tissue"]
    ends = (*interfaces([case.body]), np.inf)
    places = [float(found["puncture_depth"]) for found in pierced]
    layers = []
    for found, low, high in zip(pierced, places, (*places[1:], deepest), strict=True):
        slope, bar = friction_per_depth(forward, low, high)
        if not np.isfinite(slope):
            raise ExportError(
                f"{study.file}: the tissue is cut at fewer than two depths below {1e3 * low:.4g} mm: more steps are "
                "needed, or a deeper insertion"
            )
        cuts = known & (forward["phase"].values == PHASES.index(CUTTING)) & (depths > low) & (depths <= high)
        force, depth = (Number(*(float(found[f"puncture_{key}{end}"]) for end in ("", "_error"))) for key in _AT)
        cutting, elastic = (
            _mean(forward[f"force_{key}"].values[cuts], forward["force_error"].values[cuts])
            for key in ("cutting", "elastic")
        )
        name = _safe(names[min(int(np.searchsorted(ends, low, side="right")), len(names) - 1)])
        layers.append(Pierced(name, force, depth, cutting, elastic, Number(slope, bar)))
    last = np.flatnonzero(known)[-1]
    rubs = Number(float(forward["force_friction"].values[last]), float(forward["force_error"].values[last]))
    return NeedleNumbers(_safe(study.title or study.name), tuple(layers), deepest, rubs, float(depths[0]))


_AT = ("force", "depth")


def _mean(forces: FloatArray, errors: FloatArray) -> Number:
    """Return the mean of forces; its bar is that of the whole force, and half of their range."""
    return Number(float(np.mean(forces)), float(np.mean(errors) + np.ptp(forces) / 2))


def _safe(text: str) -> str:
    """Return a text on one line that ends neither a comment nor a string."""
    return " ".join(text.split()).replace("\\", "/").replace('"', "'")


def _comment(lines: Sequence[str], mark: str) -> str:
    return "\n".join(mark + line if number == 0 else " " * len(mark) + line for number, line in enumerate(lines))


def _listed(texts: Sequence[str], start: str) -> str:
    """Return a list of sentences, in lines that begin with ``start``."""
    return "\n".join(indent(_comment(wrap(text, 112 - len(start)), "- "), start) for text in texts)


def sofa_text(numbers: NeedleNumbers, study: str, version: str) -> str:
    """Return a module for a scene of SofaPython3, with the plug-ins CollisionAlgorithm and ConstraintGeometry."""
    rows = {
        key: "\n".join(f"    ({getattr(layer, key)}),  # {layer.name}" for layer in numbers.layers)
        for key in ("force", "depth", "friction", "cutting", "elastic")
    }
    return f'''"""A needle for a scene of SOFA, by epsmesh {version} from {_safe(study)}: {numbers.title}.

Plug-ins CollisionAlgorithm and ConstraintGeometry (github.com/InfinyTech3D). Pairs: value, error bar (95 %). The scene
must be in m, kg and s. This file was not run in SOFA: it was checked against the plug-ins' sources.

What it cannot know:

{_listed(OF_SOFA, "")}
"""

PLUGINS = ("CollisionAlgorithm", "ConstraintGeometry")

# N: force on the tip at which each layer is pierced, from the surface down.
THRESHOLDS = (
{rows["force"]}
)
# m: depths of the tip there.
DEPTHS = (
{rows["depth"]}
)
# N/m: friction on the shaft per depth in the layer.
FRICTION = (
{rows["friction"]}
)
# N: force of cutting, against the advance, while the tip advances in the layer.
CUTTING = (
{rows["cutting"]}
)
# N: elastic force of the opened tissue, outwards.
ELASTIC = (
{rows["elastic"]}
)
DEEPEST = {numbers.deepest:.6g}  # m: the last depth of the study


def add_insertion(
    root, *, tip, shaft, surface, volume, surface_normals, shaft_directions, layer=0, spacing={numbers.spacing:.6g}
):
    """Add puncture, contact and friction of one layer to a scene, after its needle and its tissue.

    `tip`, `shaft`, `surface` and `volume` are paths of geometries: PointGeometry, EdgeGeometry, TriangleGeometry,
    TetrahedronGeometry; `surface_normals` is that of a PhongTriangleNormalHandler, `shaft_directions` of an
    EdgeNormalHandler. `spacing` (m) is the distance of coupling points. The scene's time step must be set before.
    """
    step = float(getattr(root.dt, "value", root.dt))
    root.addObject(
        "InsertionAlgorithm",
        name=f"insertion{{layer}}",
        tipGeom=tip,
        shaftGeom=shaft,
        surfGeom=surface,
        volGeom=volume,
        enablePuncture=True,
        enableInsertion=True,
        punctureForceThreshold=THRESHOLDS[layer][0],
        tipDistThreshold=spacing,
    )
    root.addObject("SecondDirection", name=f"normals{{layer}}", handler=surface_normals)
    root.addObject(
        "ConstraintUnilateral",
        name=f"contact{{layer}}",
        input=f"@insertion{{layer}}.collisionOutput",
        directions=f"@normals{{layer}}",
        mu=0.0,
    )
    root.addObject("FirstDirection", name=f"along{{layer}}", handler=shaft_directions)
    root.addObject(
        "ConstraintInsertion",
        name=f"friction{{layer}}",
        input=f"@insertion{{layer}}.insertionOutput",
        directions=f"@along{{layer}}",
        frictionCoeff=1.0,
        maxForce=[FRICTION[layer][0] * spacing * step],
    )
'''


def imstk_text(numbers: NeedleNumbers, study: str, version: str) -> str:
    """Return a C++ header for the needle of iMSTK's example StraightNeedle."""
    rows = "\n".join(
        f"    {{{json.dumps(layer.name)}, {{{layer.force}}}, {{{layer.depth}}}, {{{layer.friction}}}, "
        f"{{{layer.cutting}}}, {{{layer.elastic}}}}},"
        for layer in numbers.layers
    )
    return f"""// A needle for iMSTK, by epsmesh {version} from {_safe(study)}: {numbers.title}.
//
// NeedleInteraction of Examples/Physics/StraightNeedle. Pairs: value, error bar (95 %). The scene must be in m, kg and
// s. This file was not run in iMSTK: it was checked against the example's source.
//
// What it cannot know:
//
{_listed(OF_IMSTK, "// ")}
#pragma once

namespace epsmesh
{{
struct Number
{{
    double value;
    double error;
}};
// Of a layer, from the surface down: N, m, N/m, N, N.
struct Pierced
{{
    const char* name;
    Number      threshold;
    Number      depth;
    Number      friction;
    Number      cutting;
    Number      elastic;
}};
static const Pierced layers[] = {{
{rows}
}};
static const Number frictionAtDeepest = {{{numbers.last}}}; // N
static const double deepest = {numbers.deepest:.6g}; // m

/// Set what an imstk::NeedleInteraction has a setter for.
template<class Interaction>
void
setNeedle(Interaction& interaction, const int layer = 0)
{{
    interaction.setPunctureForceThreshold(layers[layer].threshold.value);
    interaction.setStaticFrictionForceThreshold(frictionAtDeepest.value);
}}
}} // namespace epsmesh
"""
