"""The displacement spaces of one mesh, shared by all that solve on it."""

from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.mesh.distribute import BodyMesh
from pipeline.solve.conditions import Conditions, ConstrainedSpace
from pipeline.solve.dead_loads import Applied, DeadLoads, apply_loads
from pipeline.solve.forms import ElasticForms
from pipeline.solve.operator import Operators
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.vectors import add_from_ghosts, fill
from pipeline.stages import stage


class ElasticSpace:
    """Displacements of one degree: their dofs with conditions, their forms, and the operators made of both."""

    def __init__(self, body: BodyMesh, degree: int, conditions: Conditions):
        """Collective.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        self.dofs = ConstrainedSpace(body, degree, conditions)
        self.forms = ElasticForms(self.dofs.space, body.regions)
        self.operators = Operators(self.dofs, self.forms)

    @property
    def degree(self) -> int:
        """Polynomial degree."""
        return self.dofs.degree

    @stage("residuals")
    def apply(self, result: PETSc.Vec, law: MaterialLaw, *, checked: bool = True) -> None:
        """Add K u (N), with the unmodified operator and the forms' displacement, to ``result``; collective.

        ``checked``: never by the code that solves multiply with, so that each agrees with the other.
        """
        if not checked and self.operators.multiplies:
            result.array[:] += self.operators.whole_product(law, self.forms.displacement.x.array[: self.dofs.owned])
            return
        self.forms.set_law(law)
        fem_petsc.assemble_vector(result, self.forms.action)
        add_from_ghosts(result)

    def lift(self, rhs: PETSc.Vec, held: FloatArray, law: MaterialLaw, *, checked: bool = True) -> None:
        """Put the loads of the prescribed displacements ``held`` into ``rhs``; collective.

        What is left to find is zero on the prescribed dofs, and so is its load: the solver's norms then measure the
        energy of the error and nothing else, in any unit of length.
        """
        self.forms.displacement.x.array[:] = held
        self.apply(rhs, law, checked=checked)
        rhs.scale(-1.0)
        rhs.array[self.dofs.prescribed_owned] = 0.0

    @stage("loads")
    def applied(self, loads: DeadLoads) -> Applied:
        """Return dead loads on the dofs of the space; collective.

        Raises:
            SolveError: if no facet carries a traction.
        """
        return apply_loads(loads, self.dofs.body, self.dofs.space)

    def put(self, rhs: PETSc.Vec, applied: Applied, factor: float = 1.0) -> None:
        """Add ``factor`` times loads to ``rhs``, but for the prescribed dofs."""
        rhs.array[:] += factor * applied.forces
        rhs.array[self.dofs.prescribed_owned] = 0.0

    def set_displacement(self, values: PETSc.Vec, factor: float = 1.0) -> None:
        """Make ``factor`` times ``values`` the displacement of the forms; collective."""
        fill(self.forms.displacement, values, factor)


class Spaces:
    """Displacement spaces of a mesh, one a degree, each made when first asked for; a context manager."""

    def __init__(self, body: BodyMesh):
        self.body = body
        self._conditions: Conditions | None = None
        self._made: dict[int, ElasticSpace] = {}

    def __enter__(self) -> "Spaces":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def get(self, degree: int, conditions: Conditions) -> ElasticSpace:
        """Return the space of ``degree`` with ``conditions``; collective. Those of other conditions are closed.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        if conditions != self._conditions:
            self.close()
            self._conditions = conditions
        if degree not in self._made:
            self._made[degree] = ElasticSpace(self.body, degree, conditions)
        return self._made[degree]

    def close(self) -> None:
        """Free the operators that all spaces keep."""
        while self._made:
            self._made.popitem()
