"""What is swept, measured and reported: unit, meaning and symbol of each quantity, in one table.

The long names and units of a dataset, the labels of the command line, the words of guide, figures and pages: all of
them are from here. Values are SI; people read mm, kPa, mN and per cent.
"""

from dataclasses import dataclass, replace
from math import inf, isnan, pi
from typing import Literal

Value = float | int | str

# Strain goes like r^-½ at an edge: ``max_strain`` is read no nearer to one than this, in half widths of the probe.
CLEAR = 0.1


@dataclass(frozen=True)
class Quantity:
    """A dimension or a variable of a dataset.

    ``unit`` is SI's, "1" for plain numbers and "" for words; ``meaning`` is the long name in a dataset. ``symbol``
    stands for it where room is short (without one, its name does), ``axis`` at the axis of a figure (without one, its
    meaning). ``finest`` says at which end of its values the mesh is the finest.
    """

    name: str
    unit: str
    meaning: str
    symbol: str = ""
    axis: str = ""
    in_per_cent: bool = False
    finest: Literal["smallest", "largest", ""] = ""


# The dimensions that say how a scene is meshed ("mesh": an array of tables); every other one belongs to the scene.
_MESH = (
    Quantity("epsilon", "m", "radius of the fine mesh round the contact (infinite: full order)", "ε",
             "ε-mesh radius ε", finest="largest"),
    Quantity("rim", "m", "element size at the probe's edge", axis="element size at the rim", finest="smallest"),
    Quantity("fine", "m", "element size within epsilon of the contact", axis="element size within ε",
             finest="smallest"),
    Quantity("coarse", "m", "element size far from the contact", axis="element size far away", finest="smallest"),
    Quantity("growth", "1", "growth of the element size with distance", axis="growth of the element size",
             finest="smallest"),
    Quantity("mesh_accuracy", "1", "accuracy asked for", "accuracy", in_per_cent=True, finest="smallest"),
    Quantity("degree", "1", "polynomial degree of the displacement", axis="degree of the elements", finest="largest"),
    Quantity("outside", "", "what becomes of the body beyond epsilon", axis="outside of ε"),
    Quantity("element", "", "kind of element"),
    Quantity("model", "", "whether symmetry may be used"),
    Quantity("mesh", "", "mesh"),
)  # fmt: skip
_SCENE = (
    Quantity("young", "Pa", "Young's modulus", "E", "Young's modulus E"),
    Quantity("poisson", "1", "Poisson's ratio", "ν", "Poisson's ratio ν"),
    Quantity("density", "kg/m^3", "density", "ρ", "density ρ"),
    Quantity("gravity", "", "acceleration of gravity"),
    Quantity("load", "", "loads"),
    Quantity("law", "", "law of the material"),
    Quantity("probe", "", "probe"),
    Quantity("body", "", "body"),
    Quantity("at", "", "where the probe's axis meets the body, as it is given", "at", "place of the probe"),
    Quantity("path", "m", "length along the path of the probe, as it is given", axis="length along the path"),
    Quantity("x", "m", "x of the raster's places", axis="x"),
    Quantity("y", "m", "y of the raster's places", axis="y"),
    Quantity("depth", "m", "depth to which the probe is pushed", "d", "depth d"),
    Quantity("contact", "", "contact between probe and tissue"),
    Quantity("slice", "m", "travel along the blade"),
    Quantity("incision", "m", "depth of the slit that the blade stands in", axis="depth of the incision"),
    Quantity("ahead", "m", "how far the slit runs ahead of the blade"),
    Quantity("ends", "", "where the slit ends"),
    Quantity("height", "m", "height of the body"),
    Quantity("length", "m", "length of the probe"),
    Quantity("width", "m", "width of the probe"),
    Quantity("tip", "m", "radius of the rounding at the tip"),
    Quantity("angle", "rad", "half angle of the probe to its axis"),
    Quantity("body_radius", "m", "radius of the body"),
    Quantity("probe_radius", "m", "radius of the probe"),
    Quantity("body_shape", "", "shape of the body"),
    Quantity("probe_shape", "", "shape of the probe"),
)
# Largest values of all cells of a solution (pipeline/solve/cell_values.py), each a field of a record.
_LARGEST = (
    Quantity("max_strain", "1", "largest principal strain of a cell's mean strain, a tenth of the probe's half width "
             "or farther from its edge and from those of what is held",
             "largest strain", in_per_cent=True),
)  # fmt: skip
_RESULTS = (
    Quantity("force", "N", "reaction force along the probe's axis, positive against its advance", "F",
             "reaction force F"),
    Quantity("force_vector", "N", "force of the tissue on the probe"),
    Quantity("force_vector_error", "N",
             "error bar (95 %) on force_vector; not a number across the movements that were solved for"),
    Quantity("stiffness", "",
             "force (x, y, z) and torque about the point of contact (rx, ry, rz) on the tissue for a unit of each "
             "rigid motion of the probe; the unit of each entry is in stiffness_unit"),
    Quantity("stiffness_error", "", "error bar (95 %) on stiffness, in the units of stiffness_unit"),
    Quantity("stiffness_unit", "", "unit of each entry of stiffness"),
    Quantity("movement", "", "rigid motion of the probe: translation (m) or rotation (rad) about the point of contact"),
    Quantity("conjugate", "", "component of what the tissue bears: force (N) or torque (N m)"),
    Quantity("component", "", "component of a vector"),
    Quantity("at_x", "m", "x of the point where the probe's axis meets the body"),
    Quantity("at_y", "m", "y of the point where the probe's axis meets the body"),
    Quantity("at_z", "m", "z of the point where the probe's axis meets the body"),
    Quantity("axis", "1", "unit vector along which the probe advances"),
    Quantity("force_error", "1", "relative error bar (95 %) on force, against the exact solution of the case's scene",
             "± F", in_per_cent=True),
    Quantity("force_max", "N", "force of the full-order mesh of the same study (F_max)", "F_max"),
    Quantity("force_ratio", "1", "F / F_max", "F/F_max", "F / $F_{max}$"),
    Quantity("force_exact", "N", "force converged well below every error in the study, whole body (F_exact)",
             "F_exact"),
    Quantity("force_exact_error", "1", "relative error bar (95 %) on force_exact", "± F_exact", in_per_cent=True),
    Quantity("accuracy", "1", "F / F_exact", "F/F_exact", "F / $F_{exact}$"),
    Quantity("compliance", "m-1", "what the mesh adds to the compliance E d / F of the body: 1/F = 1/F_exact + c/(E d)",
             "c", "added compliance c"),
    Quantity("compliance_error", "m-1", "error bar on compliance, of the bars of both forces", "± c"),
    Quantity("compliance_message", "", "why compliances do not add"),
    Quantity("speedup", "1", "time of the full-order case over time of this case", "speed-up",
             "speed-up over full order"),
    Quantity("contact_area", "m2", "area in contact, of unilateral contact, projected along the probe's axis", "area",
             "area in contact"),
    Quantity("contact_area_error", "1", "relative error bar (95 %) on contact_area", "± area", in_per_cent=True),
    Quantity("contact_radius", "m", "radius in contact, of unilateral contact; if it is not round, of the circle of "
             "that area", "a", "radius in contact a"),
    Quantity("contact_radius_error", "1", "relative error bar (95 %) on contact_radius", "± a", in_per_cent=True),
    Quantity("energy", "J", "strain energy", "energy"),
    Quantity("energy_release", "J/m^2",
             "energy that the front of the slit ahead of the blade releases for each area that it opens, mean along it",
             "G", "energy release G"),
    Quantity("energy_release_error", "1", "relative error bar (95 %) on energy_release", "± G", in_per_cent=True),
    Quantity("energy_release_ratio", "1", "energy_release over that of the full-order mesh of the same study",
             "G/G_max", "energy release G / $G_{max}$"),
    Quantity("energy_release_exact", "J/m^2", "energy_release converged as force_exact is (G_exact)", "G_exact"),
    Quantity("load_force", "N",
             "what loads add to force while the probe is held; with the depth measured from the unloaded surface, the "
             "probe bears force + load_force", "F_load", "force of the loads F_load"),
    Quantity("load_force_error", "N", "error bar (95 %) on load_force"),
    Quantity("load_force_vector", "N", "what loads add to force_vector while the probe is held"),
    Quantity("load_force_ratio", "1", "load_force over that of the full-order mesh of the same study",
             "F_load/F_load,max"),
    Quantity("load_energy", "J", "strain energy of the loads while the probe is held; energy is what the depth adds"),
    Quantity("sag", "m", "how far along its axis loads take a probe that is free to follow: the depth, from the "
             "unloaded surface, at which it bears no force", "sag", "sag of the surface under the probe"),
    Quantity("linear_ratio", "1", "force over that of linear elasticity in the same study", "F/F_linear",
             "F / $F_{linear}$"),
    *_LARGEST,
    Quantity("balance", "1", "relative error of F d = 2 U and of the balance of forces", "imbalance"),
    Quantity("time_mesh", "s", "time to generate and distribute the mesh", "mesh"),
    Quantity("time_assemble", "s", "time to assemble operator and load", "assembly"),
    Quantity("time_setup", "s", "time to factorise, or to set up the preconditioner", "set-up"),
    Quantity("time_solve", "s", "time to solve and to evaluate the force", "solve"),
    Quantity("time_error", "s", "time spent on the error bar, not in time_total", "error bar"),
    Quantity("time_total", "s", "time that this case costs alone", "time", "run time of the case"),
    Quantity("time_spread", "1", "largest less smallest time_total of the repeats of a timed case, over their median",
             "spread of the repeats", in_per_cent=True),
    Quantity("machine_load", "1", "processes that ran or wanted to, a core, when the record was made (mean of a "
             "minute, the program's own included): above 1 times are too long", "load of the machine"),
    Quantity("memory", "bytes", "peak memory of all ranks", "memory"),
    Quantity("dofs", "1", "unknowns of the whole body", "unknowns", "unknowns"),
    Quantity("cells", "1", "elements of the whole body", "cells"),
    Quantity("iterations", "1", "iterations of the linear solver; of unilateral contact, linear solves until the "
             "area in contact was found", "iterations"),
    Quantity("status", "", "ok, failed, skipped, lost where a path leaves the body, or pending where not yet run",
             "status"),
    Quantity("message", "", "why a case failed or was skipped", "message"),
    Quantity("origin", "", 'how the force was obtained; "stored" follows where that was in an earlier run', "origin"),
    Quantity("force_exact_message", "", "why there is no force_exact"),
    Quantity("body_message", "", "what was done to the file of the body: repaired, smoothed, left out"),
)  # fmt: skip
# Those of a layer or an inclusion, whose name comes before: skin_young.
_OF_PIECES = (
    Quantity("young", "Pa", "Young's modulus", "E", "Young's modulus E"),
    Quantity("poisson", "1", "Poisson's ratio", "ν", "Poisson's ratio ν"),
    Quantity("density", "kg/m^3", "density", "ρ", "density ρ"),
    Quantity("pressure", "Pa", "pressure", "p", "pressure p"),
    Quantity("traction", "", "traction"),
    Quantity("on", "", "place", "place"),
    Quantity("thickness", "m", "thickness"),
    Quantity("radius", "m", "radius"),
    Quantity("at", "", "centre", "centre", "centre"),
    Quantity("axes", "", "semi-axes"),
)


def _table(*quantities: Quantity) -> dict[str, Quantity]:
    """Return quantities by name: a dataset has one namespace, so that no two may share a name."""
    table: dict[str, Quantity] = {}
    for quantity in quantities:
        if quantity.name in table:
            raise ValueError(f"two quantities of a dataset are called {quantity.name}")
        table[quantity.name] = quantity
    return table


QUANTITIES = _table(*_MESH, *_SCENE, *_RESULTS)
# Names of the dataset's own variables and coordinates: no swept input may have them as its dimension.
RESERVED = frozenset(quantity.name for quantity in _RESULTS)
LARGEST = tuple(quantity.name for quantity in _LARGEST)
MESH_DIMENSIONS = tuple(quantity.name for quantity in _MESH)

# Factor and unit of what people do not read in SI.
_READ = {
    "m": (1e3, "mm"), "Pa": (1e-3, "kPa"), "N": (1e3, "mN"), "J": (1e6, "µJ"), "bytes": (1e-6, "MB"),
    "m2": (1e6, "mm²"), "m-1": (1.0, "1/m"), "rad": (180 / pi, "°"), "1": (1.0, ""),
}  # fmt: skip


def quantity_of(name: str) -> Quantity | None:
    """Return the quantity of that name, those of layers and inclusions, too; None if there is none."""
    owner, _, key = name.rpartition("_")
    if name in QUANTITIES or not owner:
        return QUANTITIES.get(name)
    found = next((quantity for quantity in _OF_PIECES if quantity.name == key), None)
    if found is None:
        return None
    symbol, axis = (f"{text} of {owner}" if text else "" for text in (found.symbol or key, found.axis))
    return replace(found, name=name, meaning=f"{found.meaning} of {owner}", symbol=symbol, axis=axis)


def attributes(name: str) -> dict[str, str]:
    """Return the attributes of a variable in a dataset: long name and, of numbers, units."""
    quantity = QUANTITIES[name]
    units = {"units": quantity.unit} if quantity.unit else {}
    return {**units, "long_name": quantity.meaning}


def readable(name: str, unit: str | None = None) -> tuple[float, str]:
    """Return the factor from a quantity's unit to the one that people read, and that one's name ("": none).

    ``unit`` is for a quantity that the table may not hold; without either, a value is written as it is.
    """
    quantity = quantity_of(name)
    if quantity and quantity.in_per_cent:
        return 100.0, "%"
    if unit is None:
        unit = quantity.unit if quantity else ""
    return _READ.get(unit, (1.0, unit))


def write(name: str, value: Value, unit: str | None = None) -> str:
    """Write a value as people read it: ``10 mm``, ``12 kPa``, ``5 %``, ``full``, ``coarse``; "" for what is unknown."""
    if isinstance(value, str):
        return value
    if value == inf:
        return "full"
    factor, word = readable(name, unit)
    return "" if isnan(value) else f"{value * factor:.6g} {word}".rstrip()


def counted(number: int, noun: str) -> str:
    """Write a number with its noun: ``1 case``, ``2 meshes``."""
    plural = f"{noun}es" if noun.endswith("sh") else f"{noun}s"
    return f"{number} {noun if number == 1 else plural}"


def symbol(name: str) -> str:
    """Return the letter or the word for a quantity."""
    quantity = quantity_of(name)
    return (quantity.symbol if quantity else "") or name.replace("_", " ")
