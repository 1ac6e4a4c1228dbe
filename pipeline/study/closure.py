"""What a half ball, closed by the far field of a point force, can be cut out of, and for which tools."""

from math import inf
from typing import NamedTuple

from pipeline.shapes.body import Body, Layered
from pipeline.shapes.contact import is_level
from pipeline.shapes.probe import Probe
from pipeline.shapes.section import in_mm
from pipeline.study.problems import Problems
from pipeline.study.schema import Material, Mesh

# The regular part of a body's far field is found by displacement elements of degree 2; beyond this they lock.
_MOST = 0.49


class FarRegion(NamedTuple):
    """The part of a body's top on which one mesh gives the far fields of many places: a rectangle (m), and the radius
    (m) of the smallest half ball there.
    """

    low: tuple[float, float]
    high: tuple[float, float]
    radius: float


def check_closure(body: Body, probe: Probe, mesh: Mesh, problems: Problems) -> None:
    """Report a scene or a mesh of which no far field is known."""
    if not mesh.is_closed or mesh.epsilon >= body.farthest(probe.frame_on(body)):
        return
    if mesh.accuracy is not None:
        _refuse(mesh, "has an error of its own, which is not that of the mesh: leave accuracy out", problems)
    elif mesh.degree == 1:
        problems.error("mesh.degree", 1, "is too low for a half ball, which straight elements cut: use 2 or 3")
    elif reason := _no_far_field(body, probe):
        _refuse(mesh, f'{reason}: use outside = "coarse" here', problems)
    elif mesh.epsilon >= (most := room(body, probe)):
        problems.error(
            "mesh.epsilon", in_mm(mesh.epsilon),
            f"a half ball must lie inside the body: below {in_mm(most)}, or past all of it, which is the full order",
        )  # fmt: skip
    elif mesh.epsilon <= probe.circumradius:
        problems.error(
            "mesh.epsilon", in_mm(mesh.epsilon),
            f"a half ball must hold the footprint: above the probe's radius {in_mm(probe.circumradius)}",
        )  # fmt: skip


def check_far_field(material: Material, mesh: Mesh, problems: Problems) -> None:
    """Report a material whose far field in a body is not found."""
    if mesh.outside == "green" and mesh.epsilon < inf and material.poisson > _MOST:
        problems.error(
            "material.poisson", material.poisson,
            f'is too near to 0.5 for outside = "green": at most {_MOST}; "halfspace" takes all',
        )  # fmt: skip


def _refuse(mesh: Mesh, reason: str, problems: Problems) -> None:
    problems.error("mesh.outside", mesh.outside, reason)


def _no_far_field(body: Body, probe: Probe) -> str:
    """Return why the field far from the probe is not known, or nothing."""
    if not isinstance(body, Layered) or not is_level(body, probe.frame_on(body)):
        return "the far field is that of a probe that presses straight down on the top of a box or a cylinder"
    if body.regions:
        return "the far field is that of one material, without layers or inclusions"
    if probe.is_unilateral:
        return "the far field is found together with the force, and not where contact is found, too"
    if probe.action != "pierce" or probe.slit is not None or probe.motion == "all":
        return "the far field is that of a probe that presses, and neither slides nor turns nor cuts"
    return ""


def room(body: Body, probe: Probe) -> float:
    """Return the distance (m) from the contact to the nearest side of the body, or its bottom."""
    frame = probe.frame_on(body)
    return min(body.gap(frame.point), body.thickness(frame))
