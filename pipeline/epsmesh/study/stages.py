"""Stages of a history: depths at which unilateral contact is solved; its force is not proportional to the depth."""

from itertools import pairwise, product
from math import cos, pi, sqrt
from types import SimpleNamespace
from typing import Any, cast

from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import Section, in_mm
from epsmesh.study.axis import Axis
from epsmesh.study.capabilities.features import Scene, needs_time_steps
from epsmesh.study.problems import Problems
from epsmesh.study.schema import Mesh
from epsmesh.units import canonical

# Depths of the elastic curve: F is a power of the depth times a smooth function of its root, which five Chebyshev
# points give to some 1e-4. Contact at the smallest depth is this share of the widest, but no deeper than that one.
_COUNT, _NARROWEST = 5, 0.32
_LEAST, _BISECTIONS = 0.1, 20


def shares_of(probe: Probe, *, is_shared: bool) -> tuple[float, ...]:
    """Return the depths of the stages, as shares of the probe's depth, from the smallest on.

    ``is_shared``: on one mesh, whose elements are chosen for the widest contact.
    """
    first = sqrt(_least(probe) if is_shared else _LEAST)
    roots = (first + (1 - first) * (1 - cos(pi * number / (_COUNT - 1))) / 2 for number in range(_COUNT))
    return tuple(canonical(root**2) for root in roots)


def _least(probe: Probe) -> float:
    """Return the smallest share of the depth on one mesh."""
    low, high = _LEAST, 0.5
    widest = probe.contact_width

    def is_narrow(share: float) -> bool:
        return probe.model_copy(update={"depth": share * probe.depth}).contact_width < _NARROWEST * widest

    if not is_narrow(low):
        return low
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if is_narrow(middle) else (low, middle)
    return round(high, 3)


def with_stages(
    sections: dict[str, tuple[Section, ...]], axes: tuple[Axis, ...]
) -> tuple[dict[str, tuple[Section, ...]], tuple[Axis, ...]]:
    """Return sections and axes in which each probe has its stages, if contact is found in a history.

    Where all histories are computed in time steps, which find contact at each time, there are none.
    """
    probes = cast("tuple[Probe, ...]", sections["probe"])
    found = [probe for probe in probes if probe.history and probe.is_unilateral]
    parts = product(found, sections["body"], sections["material"], sections["load"])
    scenes = (SimpleNamespace(probe=p, body=b, material=m, load=load) for p, b, m, load in parts)
    if all(needs_time_steps(cast(Scene, scene)) for scene in scenes):
        return sections, axes
    meshes = cast("tuple[Mesh, ...]", sections["mesh"])
    is_shared = all(mesh.accuracy is None for mesh in meshes)
    staged = tuple(
        _at(probe, share, is_shared=is_shared) for probe in probes for share in shares_of(probe, is_shared=is_shared)
    )
    return sections | {"probe": staged}, (
        *axes,
        Axis("probe", "step", tuple(range(1, _COUNT + 1)), "1", piece="history", is_stage=True),
    )


def _at(probe: Probe, share: float, *, is_shared: bool) -> Probe:
    """Return the probe at a share of its depth; one whose force is proportional to the depth is not changed."""
    if not (probe.history and probe.is_unilateral):
        return probe
    changes: dict[str, Any] = {"depth": canonical(share * probe.depth)}
    if is_shared and not probe.is_flat:
        least, largest = probe.depths
        changes["mesh_depths"] = (
            min(canonical(shares_of(probe, is_shared=True)[0] * probe.depth), least),
            max(probe.depth, largest),
        )
    return probe.model_copy(update=changes)


def check_history(probe: Probe, problems: Problems) -> None:
    """Report a history in which unilateral contact grows again after it has shrunk, and one that pulls."""
    if probe.history is None or not probe.is_unilateral:
        return
    motion = probe.history.motion(probe.depth)
    if motion.amplitude:
        problems.error(
            "probe.history.sine",
            None,
            "unilateral contact grows again after it has shrunk, which is not computed: use ramp and hold, a table "
            'that rises once, or contact = "frictionless"',
        )
        return
    if min(motion.values) < 0:
        problems.error(
            "probe.history.table", in_mm(min(motion.values)), "a tool with unilateral contact does not pull: >= 0 mm"
        )
    steps = [after - before for before, after in pairwise(motion.values) if after != before]
    if any(before < 0 < after for before, after in pairwise(steps)):
        problems.error(
            "probe.history.table",
            None,
            "unilateral contact grows again after it has shrunk, which is not computed: the depth may rise to its "
            "largest value once, then fall",
        )
