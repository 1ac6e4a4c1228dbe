"""Which meshes are refined, once or twice: gmsh makes one of larger elements, which are then cut into eight each."""

from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from math import inf

from epsmesh.plan import estimate
from epsmesh.plan.symmetry import mirror_planes
from epsmesh.shapes.body import Body, Drawn
from epsmesh.shapes.probe import Probe
from epsmesh.study.case import Case
from epsmesh.study.schema import Mesh

# Estimated numbers of tetrahedra of the modelled part from which on meshes are refined once, and twice.
LEAST: tuple[float, float] = (40_000, 200_000)
# Tetrahedra of a mesh in units of the estimate, by refinements: once .71 to .86 on four scenes, twice .56 to .77 on
# three of 0.9 to 10 million unknowns.
_FEWER = (1.0, 0.8, 0.66)
# Least thickness of a layer, in units of the area with its element size, for a refined mesh. The coarse elements are
# larger than a layer; of .04 and less gmsh's first meshes were flat or failed, and the next ones did not resolve it.
_FILM = 0.06
_MANY = 200_000  # scenes of a large study


@dataclass(frozen=True, slots=True)
class _Scene:
    """What the mesh of a ``case`` depends on."""

    body: Body
    probe: Probe
    mesh: Mesh
    case: Case = field(compare=False)


def is_refined(case: Case) -> bool:
    """Return whether the mesh of a case is refined: see :func:`refinements`."""
    return refinements(case) > 0


def refinements(case: Case) -> int:
    """Return how many times the mesh of a case is refined: 0, 1 or 2.

    Points of a refined mesh are placed on surfaces that a formula gives. Bodies from files are therefore not refined,
    nor are curved bodies cut at ε, because two such surfaces meet there, nor slits, nor loose layers, nor tools that
    deform. Nor are inclusions: some of their elements would fold. Layered bodies are refined once: gmsh's elements
    would be too large for a layer. For a film they are so at once: bodies with one are not refined.
    """
    return _refinements(_Scene(case.body, case.probe, case.mesh, case)) if case.mesh.degree > 1 else 0


def is_matrix_free(case: Case) -> bool:
    """Return whether multigrid has coarser meshes as levels, and therefore assembles no matrix of degree 1.

    Of nonlinear tissue other vectors and tangents set the peak of memory.
    """
    return is_refined(case) and not (case.terms or case.way.is_found or case.way.is_nonlinear)


def cells(case: Case) -> float:
    """Return the estimated number of tetrahedra of a case, of which a refined mesh has fewer."""
    return estimate.cells(case) * _FEWER[refinements(case)]


@lru_cache(_MANY)
def _refinements(scene: _Scene) -> int:
    body, case = scene.body, scene.case
    probe = scene.probe
    if not isinstance(body, Drawn) or body.embedded or probe.slit is not None or probe.crack:
        return 0
    if body.loose or probe.elastic:
        return 0
    if case.column < inf and any(surface.is_curved for group in body.surfaces().values() for surface in group):
        return 0
    if _thinnest(body, scene.probe) < _FILM:
        return 0
    count = estimate.cells(case) * 0.5 ** len(mirror_planes(case))
    return sum(count >= least for least in (LEAST[:1] if body.regions else LEAST))


def _thinnest(body: Body, probe: Probe) -> float:
    """Return the least thickness of a layer, in units of the radius within which elements have its size."""
    top, heights = body.heights[1], (body.heights[1], *body.interfaces)
    return min(((high - low) / (probe.circumradius + top - low) for high, low in pairwise(heights)), default=inf)
