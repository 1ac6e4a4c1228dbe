"""Estimates before a case starts: number of tetrahedra, and memory."""

from math import inf, log, pi

from epsmesh.shapes.closed import FarSizes
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.scanned import FINE, Scanned
from epsmesh.study.case import Case
from epsmesh.study.way import PLAIN, Way

# Mean volume of gmsh's tetrahedra, in units of the cube of the element size: measured, benchmarks/results/solvers.md.
_TETRAHEDRON = 0.21
# Peak bytes per dof, without and with Newton's method, by element and degree: of a multigrid solve; of an error bar,
# which needs little accuracy; of a factorisation with 50,000 dofs. Measured: benchmarks/results/solvers.md.
_BYTES_PER_DOF = {
    (False, "displacement"): {1: 3000, 2: 620, 3: 400, 4: 400},
    (False, "mixed"): {2: 900, 3: 800, 4: 800},
    (True, "displacement"): {1: 3000, 2: 1900, 3: 2000, 4: 2800},
    (True, "mixed"): {2: 3600, 3: 3600, 4: 4400},
}
_OF_BAR = {
    (False, "displacement"): {2: 620, 3: 315, 4: 315},
    (False, "mixed"): {3: 440, 4: 440},
    (True, "displacement"): {2: 600, 3: 600, 4: 600},
    (True, "mixed"): {3: 1000, 4: 1000},
}
# Factor on these without a matrix of degree 1 (benchmarks/results/huge.md).
_MATRIX_FREE = 0.65
# The same of an error bar for which large contact is found again, in units of that with the area known; and of the
# stresses, strains and history at the points of large displacements in time steps, for each point of a cell.
_FOUND_AGAIN, _OF_POINT, _POINTS = 2.3, 1400, {1: 4, 2: 14, 3: 24, 4: 45}
_OF_FACTOR = {1: 9000, 2: 9000, 3: 10_000}
# Further bytes per dof of a reduced basis: a multigrid hierarchy for its bound, and five vectors for each of some eight
# solutions.
_BYTES_OF_BASIS = {1: 1000, 2: 1100, 3: 1800, 4: 2500}
_BASE = 200e6
# Further memory of a process after meshing and solving (libraries, compiled forms), and of each further rank.
_LOADED, _RANK = 60e6, 180e6
# Dofs per tetrahedron on large meshes, with three components.
_DOFS_PER_CELL = {1: 0.55, 2: 4.4, 3: 15.0, 4: 35.0}
# Bytes per tetrahedron of gmsh and the arrays while meshing.
_BYTES_PER_CELL = 1000
# Curved sides: far element size in units of the radius; additional tetrahedra per boundary triangle; additional
# tetrahedra per unit of a surface's curvature, for elements of unit size whose facets deviate least.
_OF_BEND, _ON_BOUNDARY, _FOLLOW = 0.5, 1.4, 30.0
_TRIANGLE = 0.43
# Element size in a layer below the probe in units of its thickness. With elements of degree 2, F is then within .4 % of
# its value for half this size (benchmarks/results/organs.md), and the error bar accounts for the rest.
IN_LAYER = 0.5
# Largest element size in a layer, in its thickness. In a film of 10 µm on a box of 20 mm, elements as long as 700
# thicknesses (no limit), 20 and 8 take 163, 39 and 25 iterations at ν = .3, and .45 fails without a limit, which takes
# 82 with 40 and 64 with 20. Without a limit F is 4 % too large, with 20 .2 %.
FLATTEST = 20.0
# Distance from the tool beyond which this grows in proportion, in units of what is below the tool: elements there count
# for little, and a body as large as a half-space would be full of them.
FAR = 20.0
# Factor on the number of elements of regions, because element faces follow the interfaces; tetrahedra per triangle of a
# film.
_MEETING, _IN_FILM = 1.75, 3


def cells(case: Case) -> float:
    """Return the estimated number of tetrahedra of a case, within about a factor of two."""
    mesh, body, thickness = case.mesh, case.body, case.body.thickness(case.frame)
    # A tool that deforms has above the contact the elements that tissue has below it.
    growth, total = mesh.growth, _at_contact(case, case.expected) * (1 if case.probe.elastic is None else 2)
    if case.expected_jaw is not None:
        total += _at_contact(case, case.expected_jaw)
    total += _of_bend(case) + _MEETING * sum(_of_regions(case))
    epsilon = min(mesh.epsilon, (3 * body.volume / (2 * pi)) ** (1 / 3))
    if case.is_full or mesh.epsilon == inf:
        return (total + body.volume / mesh.fine**3) / _TETRAHEDRON
    inside = min(2 / 3 * pi * epsilon**3, body.volume)
    if case.is_truncated and not case.is_closed:
        inside = min(inside, pi * mesh.epsilon**2 * thickness)
        # In a column, elements are at most half its radius.
        total += min(pi * mesh.epsilon**2 * thickness, body.volume) / (mesh.epsilon / 2) ** 3
    total += inside / mesh.fine**3
    if case.is_closed:
        return total / _TETRAHEDRON
    # Shells of size fine + growth (r - ε) round the contact, then coarse.
    total += 2 * pi * epsilon**2 / (2 * growth * mesh.fine**2) + 4 * pi * epsilon / (growth**2 * mesh.fine)
    total += 2 * pi / growth**3 * log(max(mesh.coarse / mesh.fine, 1.0))
    if not case.is_truncated:
        total += max(body.volume - inside, 0.0) / mesh.coarse**3
    return total / _TETRAHEDRON


def _at_contact(case: Case, probe: Probe) -> float:
    """Return the number of elements (as cubes of their size) where a ``probe`` touches tissue."""
    mesh, growth, rim = case.mesh, case.mesh.growth, case.mesh.rim_size(probe.half_width)
    length, area = probe.rim_size
    # Half discs round the rim: ∫ π s / (rim + growth s)³ ds up to the distance where the size is fine.
    total = length * pi * (1 / rim - 1 / mesh.fine) ** 2 * rim / (2 * growth**2) if rim < mesh.fine else 0.0
    # Below the area where contact may end: ∫ 1 / (rim + growth s)³ ds.
    total += area / (2 * growth * rim**2)
    if not probe.is_flat:  # small elements down to the depth of the tool, and beside it
        _, depth = probe.depths
        total += area * depth / rim**3 + length * depth / (growth * rim**2)
    return total


def _of_bend(case: Case) -> float:
    """Return the number of elements (as cubes of their size) for curved sides, far from the contact."""
    body, far = case.body, _OF_BEND * case.body.bend
    if case.column < inf or far == inf:
        return 0.0
    triangles = 6 * body.volume ** (2 / 3) / (_TRIANGLE * far**2)
    follow = _FOLLOW * body.curvature / far
    if isinstance(body, Scanned):
        follow *= FINE / body.deviation(_far_sizes(case), straight=case.mesh.degree == 1)
    return body.volume / far**3 + _TETRAHEDRON * (_ON_BOUNDARY * triangles + follow)


def cells_of_regions(case: Case) -> list[float]:
    """Return the estimated number of tetrahedra that each layer and region of a body asks for, in their order."""
    return [_MEETING * share / _TETRAHEDRON for share in _of_regions(case)]


def _of_regions(case: Case) -> list[float]:
    """Return the number of elements (as cubes of their size) of each layer and region, but for :data:`_MEETING`."""
    body = case.body
    found, high = [], body.heights[1]
    for low in body.interfaces:
        found.append(_of_layer(case, high, low) + _of_film(case, high, low))
        high = low
    far = _far_sizes(case)
    found += [0.0] * (len(body.regions) - len(body.embedded) - len(found))  # the last of layers that fill the body
    for piece in body.embedded:
        # Both sides of its surface: ∫ 1 / (size + growth s)³ ds.
        _, sizes, areas = piece.surface.sizes(far)
        found.append(float((areas / (far.of_regions * sizes**2)).sum()))
    return found


def _far_sizes(case: Case) -> FarSizes:
    return case.expected.far_sizes(case.frame, case.mesh.growth, case.mesh.coarseness)


def _of_layer(case: Case, high: float, low: float) -> float:
    """Return the same of a layer between two heights (m), near the tool."""
    size, radius = IN_LAYER * (high - low), _below(case, low)
    if size >= case.mesh.fine:
        return 0.0
    within = pi * radius**2 * (high - low) / size**3
    rings = 2 * pi * radius * (high - low) + pi * radius**2  # beside and below
    return within + rings / (2 * case.mesh.growth * size**2)


def _below(case: Case, low: float) -> float:
    """Return the radius (m) of what is below the tool, down to a height (m)."""
    return case.probe.circumradius + case.body.heights[1] - low


def _of_film(case: Case, high: float, low: float) -> float:
    """Return the same of a layer and what is below it, far from the tool, where its largest element size counts."""
    size, largest = FLATTEST * (high - low), case.mesh.fine if case.is_full else case.mesh.coarse
    if size >= largest:
        return 0.0
    area = case.body.volume / (case.body.heights[1] - case.body.heights[0])
    if case.is_truncated:
        area = min(area, pi * case.mesh.epsilon**2)
    # Beyond a distance sizes grow in proportion to it: ∫ 2πr / size² dr, up to the side or the largest size.
    far = (1 + FAR) * _below(case, low)
    ratio = min((area / pi) ** 0.5 / far, largest / size)
    counted = min(area, pi * far**2) + (2 * pi * far**2 * log(ratio) if ratio > 1 else 0.0)
    flat = _IN_FILM * _TETRAHEDRON / (_MEETING * _TRIANGLE)
    return counted / size**2 * (flat + 1 / (2 * case.mesh.growth))


def dofs(count: float, degree: int) -> float:
    """Return the estimated number of unknowns on ``count`` tetrahedra."""
    return _DOFS_PER_CELL[degree] * count


def solving_memory(dofs: float, degree: int, way: Way = PLAIN, *, direct: bool, matrix_free: bool = False) -> float:
    """Return the estimated bytes of a solve, all ranks together; ``direct``: by a factorisation.

    ``matrix_free``: without a matrix of degree 1, see :func:`.is_matrix_free`.
    """
    if direct or way.is_factorised:
        # The fill of a 3D factorisation grows like dofs^(4/3); _OF_FACTOR is for 50,000 dofs.
        return _BASE + _OF_FACTOR[degree] * (dofs / 50_000) ** (1 / 3) * dofs
    followed = _OF_POINT * _POINTS[degree] / _DOFS_PER_CELL[degree] if way.in_time and way.is_nonlinear else 0.0
    factor = _MATRIX_FREE if matrix_free else 1.0
    return _BASE + (factor * _BYTES_PER_DOF[way.is_nonlinear, way.element][degree] + followed) * dofs


def error_bar_memory(dofs: float, degree: int, way: Way = PLAIN, *, matrix_free: bool = False) -> float:
    """Return the estimated bytes of an error bar: a solve of one degree more than that of ``dofs`` unknowns."""
    growth = _DOFS_PER_CELL[degree + 1] / _DOFS_PER_CELL[degree]
    growth *= _FOUND_AGAIN if way.is_found and way.is_nonlinear else 1.0
    growth *= _MATRIX_FREE if matrix_free else 1.0
    return _BASE + _OF_BAR[way.is_nonlinear, way.element][degree + 1] * growth * dofs


def peak_memory(
    case: Case,
    share: float = 1.0,
    of_bar: float | None = None,
    *,
    reduced: bool = False,
    matrix_free: bool = False,
) -> float:
    """Return the estimated bytes of a case with its error bar, within a factor of 1.5; see :func:`case_memory`.

    ``of_bar`` is the part of the body for the error bar, if it differs; ``reduced`` cases have a reduced basis.
    """
    degree = case.mesh.degree
    count = dofs((share if of_bar is None else of_bar) * cells(case), degree)
    enriched = error_bar_memory(count, degree, case.way, matrix_free=matrix_free)
    basis = basis_memory(dofs(share * cells(case), degree), degree) if reduced else 0.0
    return _LOADED + max(case_memory(case, share, matrix_free=matrix_free), enriched) + basis


def basis_memory(dofs: float, degree: int) -> float:
    """Return the estimated bytes of a reduced basis, without its solves and their error bars."""
    return _BYTES_OF_BASIS[degree] * dofs


def on_ranks(memory: float, ranks: int) -> float:
    """Return the estimated bytes of all ``ranks`` together, for a task of ``memory`` bytes on one."""
    return memory + (ranks - 1) * _RANK


def case_memory(case: Case, share: float = 1.0, *, matrix_free: bool = False) -> float:
    """Return the estimated bytes of meshing and solving a case, within about a factor of two.

    ``share`` is the modelled part of the body; ``matrix_free``: see :func:`solving_memory`.
    """
    count, degree = share * cells(case), case.mesh.degree
    direct = case.solve.method == "direct"
    solving = solving_memory(dofs(count, degree), degree, case.way, direct=direct, matrix_free=matrix_free)
    return max(_BASE + _BYTES_PER_CELL * count, solving)
