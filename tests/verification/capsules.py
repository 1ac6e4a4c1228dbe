"""A capsule against a thin layer, and that of a ball within tissue against closed forms."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from scipy import sparse
from scipy.sparse.linalg import splu

from epsmesh.arrays import FloatArray
from epsmesh.mesh.curve import EDGES, interfaces
from epsmesh.mesh.distribute import distribute, exterior_facets
from epsmesh.mesh.generate import MeshArrays
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.run.loads import terms_of
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of
from epsmesh.shapes.rounded import Rounded
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.physics import MaterialLaw, Parameters
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from epsmesh.study.read import parse
from epsmesh.verify import Row, Section, force_row, solved
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer
from epsmesh_identify.layered.contact import Profile
from tests.verification import known
from tests.verification.sections import box, cylinder, disc, mesh, mm, tissue

# The tissue's modulus (Pa), and Poisson's ratio of both.
_YOUNG, _POISSON = 10e3, 0.3
# What a membrane leaves out of a layer of a / 50: bending. Measured; it falls with the thickness.
_BENDING = 6e-3
# Of the energy of balls on the coarsest mesh, and of F with a solid shell on the same mesh.
_OF_BALL, _OF_SHELL = 8e-3, 4e-3
# Of quick rows: the body's radius in units of its height, and a mesh in units of the radius of contact.
_NARROW, _QUICK = 5, {"epsilon": 3, "fine": 0.5, "coarse": 4, "rim": 0.12}


@dataclass(frozen=True)
class Ball:
    """A ball on a capsule: its ``radius`` and ``depth``, the ``height`` of the tissue, and ``width``, about the radius
    of contact, all in mm; the ``stiffness`` of the capsule (N/m).
    """

    radius: float
    depth: float
    height: float
    width: float
    stiffness: float

    def layer_force(self, thinner: float = 50) -> float:
        """Return the force (N) on a layer as stiff as the capsule, ``thinner`` than the contact by that factor."""
        thickness = 1e-3 * self.width / thinner
        layers = Layer(self.stiffness / thickness, _POISSON, thickness), Layer(_YOUNG, _POISSON, 1e-3 * self.height)
        ball = Profile(Rounded(0.0, 1e-3 * self.radius).slope, limit=1e-3 * self.radius)
        return float(LayeredBody(layers).force(ball, np.array([1e-3 * self.depth]))[0])

    def scene(self, relative_width: float = 13) -> dict[str, dict[str, object]]:
        """Return the scene with a capsule on a cylinder of a radius in units of its height."""
        capsule = {"young": f"{1e4 * self.stiffness} Pa", "thickness": "0.1 mm", "poisson": _POISSON, "on": "top"}
        return {
            "body": cylinder(relative_width * self.height, self.height) | {"capsule": capsule},
            "material": tissue(_POISSON, 1e-3 * _YOUNG),
            "probe": {"shape": "sphere", "radius": mm(self.radius), "depth": mm(self.depth), "contact": "unilateral"},
        }


BALLS = {"thin": Ball(10.0, 0.1, 2.5, 1.12, 2.0), "thick": Ball(4.0, 0.16, 5.0, 0.85, 8.0)}


@dataclass(frozen=True)
class Encapsulated:
    """A ball with a capsule in the middle of a larger ball: radii (mm), moduli (kPa) and ν of both tissues.

    The capsule has a stiffness E t (N/m). On the outer surface the displacement is linear in the place.
    """

    inner: float = 10.0
    outer: float = 20.0
    moduli: tuple[tuple[float, float], tuple[float, float]] = ((5.0, 0.3), (10.0, 0.45))
    stiffness: float = 200.0

    def energy(self, degree: int) -> float:
        """Return the energy (J) per square of the strain: of swelling, ``degree`` 0, or of diag(1, -1, 0), degree 2.

        Displacements are u_r = U(r) Y and, along the sphere, V(r) ∇Y, with a surface harmonic Y of that degree: 1, or
        sin² θ cos 2φ. Those of elastic balls are in R. M. Christensen and K. H. Lo, J. Mech. Phys. Solids 27, 315
        (1979). The capsule's energy follows from ∮ |∇∇Y|² = (L² - L) ∮ Y², L = n (n + 1).
        """
        a, b = 1e-3 * self.inner, 1e-3 * self.outer
        within, around = (self._modes(degree, young * 1e3, nu) for young, nu in self.moduli)
        product = degree * (degree + 1)
        sheet = self.stiffness * _POISSON / (1 - _POISSON**2), self.stiffness / (2 * (1 + _POISSON))
        # Derivatives of the capsule's energy by U and V, per ∮ Y².
        trace, both = np.array([2.0, -product]), np.array([[2.0, -product], [-product, product**2 - product]])
        skin = sheet[0] * np.outer(trace, trace) + 2 * sheet[1] * both
        regular = len(within) // 2
        columns = [("in", mode) for mode in within[:regular]] + [("out", mode) for mode in around]
        size = 1 if degree == 0 else 2
        weights = np.array([1.0, product])[:size]
        rows = []
        for side, mode in columns:
            (u, t), (at_end, _) = mode(a), mode(b)
            sign = -1.0 if side == "in" else 1.0
            pull = sign * a**2 * weights * t - (skin[:size, :size] @ u if side == "in" else 0.0)
            rows.append(np.concatenate([sign * u, pull, at_end if side == "out" else np.zeros(size)]))
        given = np.concatenate([np.zeros(2 * size), np.array([b, b / 2])[:size]])
        shares = np.linalg.solve(np.array(rows).T, given)[regular:]
        traction = sum(share * mode(b)[1] for share, mode in zip(shares, around, strict=True))
        square = 4 * np.pi if degree == 0 else 16 / 15 * np.pi  # ∮ Y²
        return float(square * b**2 / 2 * (weights * traction) @ given[2 * size :])

    @staticmethod
    def _modes(degree: int, young: float, nu: float) -> list[Any]:
        """Return the displacements of tissue, those finite at the centre first: r to (U, V) and (σ_rr/Y, σ_rθ/|∇Y|)."""
        mu, even = young / (2 * (1 + nu)), 1 - 2 * nu
        lame = 2 * mu * nu / even
        # Powers of r, with the factors of U and V.
        powers = (
            [(1, 1.0, 0.0), (-2, 1.0, 0.0)]
            if degree == 0
            else [
                (1, 1.0, 0.5),
                (3, -6 * nu / even, -(7 - 4 * nu) / (2 * even)),
                (-4, 3.0, -1.0),
                (-2, (5 - 4 * nu) / even, 1.0),
            ]
        )

        def mode(power: int, u: float, v: float) -> Any:
            def at(r: float) -> tuple[FloatArray, FloatArray]:
                slope = r ** (power - 1)
                swelling = (power + 2) * u - degree * (degree + 1) * v
                normal, shear = lame * swelling + 2 * mu * power * u, mu * ((power - 1) * v + u)
                size = 1 if degree == 0 else 2
                return r**power * np.array([u, v])[:size], slope * np.array([normal, shear])[:size]

            return at

        return [mode(*each) for each in powers]

    def scene(self) -> dict[str, dict[str, object]]:
        """Return a scene with that body; its tool and its support are without effect."""
        (inner, nu), (young, poisson) = self.moduli
        capsule = {"young": f"{1e4 * self.stiffness} Pa", "thickness": "0.1 mm", "poisson": _POISSON}
        ball = {"name": "ball", "at": ["0 mm"] * 3, "radius": mm(self.inner), **tissue(nu, inner), "capsule": capsule}
        outer = {"shape": "ellipsoid", "axes": [mm(self.outer)] * 3, "fixed": {"below": mm(-0.99 * self.outer)}}
        return {
            "body": outer | {"inclusion": [ball]},
            "material": tissue(poisson, young),
            "probe": disc(self.outer / 8),
        }

    def solved(self, degree: int, size: float) -> float:
        """Return the energy of :meth:`energy` on a mesh with elements of a ``size`` (mm), on this process."""
        sizes = mesh(rim=size, growth=1.0, fine=size, coarse=size) | {"model": "3d"}
        case = parse(self.scene() | {"mesh": sizes}).case(())
        with Spaces(mesh_case(case, (), MPI.COMM_SELF)) as spaces:
            space = spaces.get(2, Conditions(bonded=False, terms=terms_of(case)))
            strain = np.eye(3) if degree == 0 else np.diag([1.0, -1.0, 0.0])
            state = (space.places.reshape(-1, 3) @ strain).reshape(-1)
            law = law_of(case)
            with space.lend(law, whole=True) as matrix:
                offsets, columns, values = matrix.getValuesCSR()
            stiff = law.unit * sparse.csr_matrix((values, columns, offsets))
            ends = fem.locate_dofs_topological(space.space, 2, exterior_facets(space.body.mesh)[0])
            free = np.setdiff1d(np.arange(len(state)), (3 * ends[:, None] + np.arange(3)).reshape(-1))
            state[free] -= splu(stiff[free][:, free].tocsc()).solve((stiff @ state)[free])
            return float(state @ (stiff @ state)) / 2


@dataclass(frozen=True)
class Buried:
    """A ball with a capsule of E t = ``stiffness`` (N/m) below a disc, in a box of its own tissue; sizes in mm."""

    radius: float = 4.0
    depth: float = 6.0
    stiffness: float = 200.0
    sizes: tuple[float, float] = (0.15, 2.0)

    def scene(self, *, capsule: bool = True, larger: float = 0.0) -> Section:
        """Return the scene, with or without the capsule, of a ball that is ``larger`` than it."""
        skin = {"young": f"{1e4 * self.stiffness} Pa", "thickness": "0.1 mm", "poisson": _POISSON}
        own = tissue(_POISSON, 1e-3 * _YOUNG) | ({"capsule": skin} if capsule else {})
        ball = {"name": "ball", "at": ["0 mm", "0 mm", mm(-self.depth)], "radius": mm(self.radius + larger), **own}
        return {
            "body": box(40, 40, 20) | {"inclusion": [ball]},
            "material": tissue(_POISSON, 1e-3 * _YOUNG),
            "probe": disc(3, 0.2),
        }

    @property
    def mesh(self) -> Section:
        """The sizes of elements; around the ball they are half of the coarser one."""
        rim, fine = self.sizes
        return mesh(rim=rim, growth=0.5, fine=fine, coarse=8)

    def shell_force(self, thickness: float, *, is_stiff: bool = True) -> tuple[float, float]:
        """Return F (N) and its bar with a solid shell of a ``thickness`` (mm) as stiff as the capsule, or as tissue."""
        scene = self.scene(capsule=False, larger=thickness / 2) | {"mesh": self.mesh | {"model": "3d"}}
        case = parse(scene).case(())
        centre = np.array([0.0, 0.0, -1e-3 * self.depth])
        arrays = with_shell(mesh_arrays(case, ()), centre, 1e-3 * thickness)
        young = 1e3 * self.stiffness / thickness if is_stiff else _YOUNG
        law = MaterialLaw(tuple(Parameters.of_moduli(modulus, _POISSON) for modulus in (_YOUNG, _YOUNG, young)))
        with (
            Spaces(distribute(MPI.COMM_SELF, arrays)) as spaces,
            QuasiStaticProblem(spaces, case.mesh.degree, Conditions()) as problem,
        ):
            found = problem.solve(law, movement_of(case), estimate=True)
        return float(found.reaction[2]), float(found.reaction_bars[2])


def with_shell(arrays: MeshArrays, centre: FloatArray, thickness: float) -> MeshArrays:
    """Return a mesh whose region 1, a ball round a ``centre``, has a shell of a ``thickness`` (m): region 2.

    Cells of the ball shrink; each triangle of its surface is the base of a prism, which is cut into three cells.
    """
    assert arrays.regions is not None
    triangles, inside = interfaces(arrays), arrays.cells[arrays.regions == 1]
    moved = np.unique(inside)
    radius = np.linalg.norm(arrays.points[triangles[0, 0]] - centre)
    shrunk = np.arange(len(arrays.points))
    shrunk[moved] = len(arrays.points) + np.arange(len(moved))
    points = [*arrays.points, *(centre + (arrays.points[moved] - centre) * (1 - thickness / radius))]
    known: dict[tuple[int, int], int] = {}
    for cell in arrays.cells:
        for number, (one, other) in enumerate(EDGES):
            middle = cell[4 + number]
            known[min(cell[one], cell[other]), max(cell[one], cell[other])] = middle
            known[shrunk[min(cell[one], cell[other])], shrunk[max(cell[one], cell[other])]] = shrunk[middle]

    def middle_of(one: int, other: int) -> int:
        key = min(one, other), max(one, other)
        if key not in known:
            ends = points[one] - centre, points[other] - centre
            place = (ends[0] + ends[1]) / 2
            known[key] = len(points)
            points.append(centre + place * np.mean([np.linalg.norm(end) for end in ends]) / np.linalg.norm(place))
        return known[key]

    prisms = []
    for a, b, c in triangles:
        for corners in ((a, b, c, shrunk[c]), (a, b, shrunk[b], shrunk[c]), (a, *shrunk[[a, b, c]])):
            x = np.array([points[corner] for corner in corners])
            turned = np.linalg.det(x[1:] - x[0]) < 0
            cell = [corners[n] for n in ((0, 1, 3, 2) if turned else range(4))]
            prisms.append([*cell, *(middle_of(cell[one], cell[other]) for one, other in EDGES)])
    cells = np.where((arrays.regions == 1)[:, None], shrunk[arrays.cells], arrays.cells)
    regions = np.append(arrays.regions, np.full(len(prisms), 2))
    return replace(arrays, points=np.array(points), cells=np.vstack([cells, prisms]), regions=regions, interfaces=None)


def capsule_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield a row for each ball; collective."""
    for name, ball in BALLS.items():
        mesh = {key: mm(size * ball.width) for key, size in _QUICK.items()} | {"outside": "coarse"} if quick else None
        scene = ball.scene(_NARROW) if quick else ball.scene()
        row = f"capsule on a {name} layer on a rigid base, sphere, against a layer of a / 50"
        yield force_row(row, "3D", (ball.layer_force(), known.LAYERED, _BENDING), solved(comm, "3D", scene, mesh))
    for kind, degree in (("swelling", 0), ("shear", 2)):
        of_ball = Encapsulated()
        row = f"ball with a capsule in a ball, {kind}: energy (J)"
        source = "spherical harmonics (R. M. Christensen and K. H. Lo 1979)"
        value = comm.bcast(of_ball.solved(degree, 8.0 if quick else 4.0) if comm.rank == 0 else None)
        yield Row(row, "3D", of_ball.energy(degree), source, value, _OF_BALL if quick else _OF_BALL / 2)
    if not quick:
        buried = Buried(stiffness=20.0)
        found = solved(comm, "3D", buried.scene(), buried.mesh)
        thick, thin = (buried.shell_force(thickness)[0] for thickness in (0.2, 0.1))
        # The mesh's error is on both sides.
        row, source = "ball with a capsule below a disc", "solid shells, to no thickness"
        yield Row(row, "3D", 2 * thin - thick, source, found.force, _OF_SHELL, 0.0, found.message)
