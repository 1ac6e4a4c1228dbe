"""The reduction of paths: of their places some are solved, and F at the others is interpolated."""

from collections.abc import Sequence
from dataclasses import replace

from epsmesh.plan.key import mesh_key
from epsmesh.plan.place_path import FEWEST, PlacePath
from epsmesh.plan.steps import Solve
from epsmesh.plan.work import Plan, Skipped, reason_of
from epsmesh.study.capabilities.obstacles import obstacle


def interpolate_path(plan: Plan) -> Plan:
    """F is interpolated along a path: some places are solved, until the error bar at all others is at most path_error.

    Places that are solved are within the distance to the nearest other material, side or support of every place.
    """
    if plan.study.planning.path_error is None:
        return plan
    ways: dict[tuple[int, ...], list[Solve]] = {}
    for solve in plan.solves:
        case = solve.case
        ways.setdefault(tuple(i for i, axis in zip(case.index, case.axes, strict=True) if not axis.off), []).append(
            solve
        )
    reasons = {obstacle("path", solve.case) for found in ways.values() for solve in found} - {""}
    if reasons:
        reason = f"No interpolation along the path: {sorted(reasons)[0]}; each place is solved."
        return replace(plan, skipped=(*plan.skipped, Skipped("path", 0, reason)))
    found = tuple(PlacePath(tuple(solves)) for solves in ways.values() if len(solves) > FEWEST)
    first = {solve.key for solve in together(found, [solve for path in found for solve in path.first])}
    skipped = {solve.key for path in found for solve in path.solves} - first
    solves = tuple(solve for solve in plan.solves if solve.key not in skipped)
    plan = replace(plan, solves=solves, place_paths=found)
    return plan.skipping("path", len(skipped), reason_of(interpolate_path))


def together(paths: Sequence[PlacePath], wanted: Sequence[Solve]) -> list[Solve]:
    """Return the solves of all ``paths`` on the meshes of those ``wanted``: other materials share the mesh."""
    meshes = {mesh_key(solve.case) for solve in wanted}
    return [solve for path in paths for solve in path.solves if mesh_key(solve.case) in meshes]
