"""Warnings of values that no tissue and no tool has, with what was probably meant."""

from collections.abc import Sequence

from epsmesh.shapes.body import Body
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import in_mm
from epsmesh.shapes.tissue import Tissue
from epsmesh.study.problems import Problems
from epsmesh.study.regions import tissues_of
from epsmesh.study.schema import Material
from epsmesh.units import parse_quantity

# Moduli (Pa) of soft tissue: brain and fat have some hundred pascals, skin up to a megapascal. Cortical bone has 20 GPa
# (Guimarães et al., Nat. Rev. Mater. 5, 351, 2020): a layer, an inclusion or a region may be one.
_SOFTEST, _STIFFEST, _BONE = 100.0, 1e6, 30e9
# A depth (m) that is seldom meant but for the tips of force microscopes, which are smaller than this (m).
_SHALLOW, _TIP = 1e-6, 50e-6
# Radius (m) of the thickest trocars. Largest extent (m) of a body.
_NEEDLE, LARGEST = 7.5e-3, 1.0
# The depth that stands for one which a study need not have: of it nobody is warned.
UNSAID = "1 nm"
_NOTHING = parse_quantity(UNSAID, "m")


def check_moduli(body: Body, material: Material, problems: Problems) -> None:
    """Warn of moduli that soft tissue does not have."""
    for key, tissue in tissues_of(body, material):
        young, most = tissue.young, _STIFFEST if key == "material" else _BONE
        if tissue.varying is not None and tissue.varying.kind == "function":  # no value of it is known here
            continue
        if young < _SOFTEST:
            why = "is softer than any tissue, of which brain and fat have some hundred pascals"
        elif young > most:
            why = "is stiffer than soft tissue, which has up to about 1 MPa"
            why = why if key == "material" else "is stiffer than bone, which has about 20 GPa"
        else:
            continue
        where, found, what = _found(f"{key}.young", tissue)
        problems.warn(where, found, f"{what}{why}. Is {_pressure(_like_tissue(young))} meant?")


def _found(key: str, tissue: Tissue) -> tuple[str, str | None, str]:
    """Return the key of a modulus, its value, and for a field what is known of it, before what is wrong with it."""
    field = tissue.varying
    if field is None:
        return key, _pressure(tissue.young), ""
    if field.kind == "file":
        low, high = map(_pressure, field.range)
        return f"{key}.unit", field.unit, f"gives the image {low} to {high}. The mean, {_pressure(field.young)}, "
    return f"{key}.formula", field.formula, f"is {_pressure(field.young)} at the origin, which "


def check_tools(placed: Sequence[tuple[Body, Probe]], problems: Problems) -> None:
    """Warn of depths and sizes of tools that hardly anyone has; many are those of one tool along a path."""
    tools = {(body, probe.depth, size_of(probe)): probe for body, probe in placed}
    for (body, _, size), probe in tools.items():
        with problems.about(body=body, probe=probe):
            _check_tool(body.extent, probe, size, problems)


def _check_tool(extent: float, probe: Probe, size: float, problems: Problems) -> None:
    if probe.depth < _SHALLOW < _TIP < size and probe.depth != _NOTHING:
        doubt = f"is less than a thousandth of a millimetre, with a tool of {in_mm(size)}"
        deeper = in_mm(1e3 * probe.depth)
        problems.warn("probe.depth", f"{probe.depth * 1e6:.4g} µm", f"{doubt}. Is {deeper} meant?")
    if getattr(probe, "insertion", None) and probe.revolved and size > _NEEDLE:
        doubt = f"is inserted; needles and trocars have radii up to {in_mm(_NEEDLE)}"
        key = "probe.shaft" if hasattr(probe, "shaft") else "probe.radius"
        problems.warn(key, in_mm(size), f"{doubt}. Is {in_mm(size / 10)} meant, or is it the diameter?")
    elif 2 * size > extent:
        problems.warn("probe", None, f"is {in_mm(2 * size)} wide, and the body {in_mm(extent)}: is a unit wrong?")


def check_extent(body: Body, problems: Problems) -> None:
    """Warn of a body larger than any patient's."""
    if body.extent > LARGEST:
        problems.warn("body", None, f"is {body.extent:.4g} m large. Are its lengths in mm?")


def size_of(probe: Probe) -> float:
    """Return half the width or length (m) of a tool, whatever its depth."""
    if probe.revolved:
        return probe.revolved.limit
    return probe.half_length or probe.half_width


def _like_tissue(young: float) -> float:
    """Return the modulus (Pa) with another prefix that soft tissue has, or the nearest."""
    while young < _SOFTEST:
        young *= 1e3
    while young > _STIFFEST:
        young /= 1e3
    return young


def _pressure(young: float) -> str:
    """Write a modulus (Pa) for people."""
    factor, unit = next(((f, u) for f, u in ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa")) if young >= f), (1.0, "Pa"))
    return f"{young / factor:.4g} {unit}"
