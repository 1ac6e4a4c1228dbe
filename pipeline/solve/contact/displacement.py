"""Displacement elements whose nodes below the probe are held where they touch it."""

from contextlib import ExitStack

import numpy as np

from pipeline.arrays import BoolArray, FloatArray, Int32Array
from pipeline.solve.contact.active_set import State
from pipeline.solve.contact.candidates import CONDITIONS, Candidates, Numbering, Surface
from pipeline.solve.contact.elements import ContactElements, Unknowns
from pipeline.solve.contact.levels import Hierarchy
from pipeline.solve.krylov import Level, LinearSolver, is_direct
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.spaces import ElasticSpace, Spaces
from pipeline.solve.vectors import vector
from pipeline.stages import stage


class DisplacementElements(ContactElements):
    """Displacements of one degree; what they make is freed with the stack."""

    def __init__(self, spaces: Spaces, degree: int, law: MaterialLaw, surface: Surface, method: str, stack: ExitStack):
        """Assemble; collective."""
        super().__init__()
        self.space: ElasticSpace = spaces.get(degree, CONDITIONS)
        self._spaces, self._law, self._surface = spaces, law, surface
        self.candidates: Candidates = surface.of(degree)
        self._direct = is_direct(method, self.space.dofs.dofs, degree)
        self.hierarchy = Hierarchy(spaces, degree, law, surface, stack, direct=self._direct)
        self.numbering: Numbering = self.hierarchy.numbering
        self.displacement = stack.enter_context(vector(self.space.dofs.space))
        self._held: Int32Array = np.empty(0, dtype=np.int32)
        self._solver: LinearSolver | None = None
        stack.callback(self.close)

    def close(self) -> None:
        """Free the solver."""
        if self._solver is not None:
            self._solver.close()
            self._solver = None

    @stage("set-up")
    def hold(self, active: BoolArray) -> None:
        """Hold the ``active`` candidates (n) from now on; collective.

        Raises:
            SolveError: if the solver cannot be set up.
        """
        self._active, self._held = active, self.numbering.normal_dofs(active, owned=True)
        levels = self.hierarchy.hold(active)
        if self._solver is not None and self._solver.cycle is not None:
            self._solver.hold(levels)
        else:
            self.close()
            self._solver = LinearSolver(levels, direct=self._direct, tolerance=_ANY)

    def approach(self, bounds: FloatArray, tolerance: float, energy: float | None) -> int:
        """Move what is held to ``bounds`` (n, m), and then the rest; return the iterations.

        Raises:
            SolveError: if the solver does not converge.
        """
        assert self._solver is not None
        space = self.space.dofs
        self.numbering.put(self.displacement.array, bounds, self._active)
        with vector(space.space) as residual, vector(space.space) as correction:
            self.hierarchy.finest.mult(self.displacement, residual)
            residual.scale(-1.0)
            if self.load is not None:
                residual.array[:] += self.load[0]
            residual.array[space.prescribed_owned] = 0.0
            residual.array[self._held] = 0.0
            target = None if energy is None else tolerance * energy**0.5
            iterations = self._solver.solve(residual, correction, tolerance, target)
            self.displacement.axpy(1.0, correction)
        return iterations

    def near_state(self) -> State:
        """Return what the candidates do, far field aside; collective."""
        with vector(self.space.dofs.space) as forces:
            self.hierarchy.finest.mult(self.displacement, forces)
            energy = float(self.displacement.dot(forces))
            gather = self.numbering.gather
            return State(gather(self.displacement.array), gather(forces.array), energy)

    def held_levels(self, facets: Int32Array, stack: ExitStack) -> list[Level]:
        """Return the levels of multigrid with the local ``facets`` held, in the place of any set; collective."""
        self.close()
        if self._direct:
            hierarchy = Hierarchy(self._spaces, self.space.degree, self._law, self._surface, stack, direct=False)
            return hierarchy.hold_facets(facets)
        return self.hierarchy.hold_facets(facets)

    def put_fields(self, unknowns: Unknowns) -> None:
        """Make ``unknowns`` the displacement of the space's forms; collective."""
        with vector(self.space.dofs.space) as displacement:
            (displacement.array[:],) = unknowns
            self.space.set_displacement(displacement)

    def residual(self) -> FloatArray:
        """Return K u (N) with the unmodified operator, owned dofs, for the forms' displacement; collective."""
        with vector(self.space.dofs.space) as forces:
            self.space.apply(forces, self._law)
            return np.array(forces.array)

    def lift(self, held: FloatArray) -> Unknowns:
        """Return the right-hand side of prescribed displacements ``held`` (m, with ghosts); collective."""
        with vector(self.space.dofs.space) as rhs:
            self.space.lift(rhs, held, self._law)
            return (np.array(rhs.array),)

    def pulled(self, forces: FloatArray) -> Unknowns:
        """Return the right-hand side of ``forces`` (N), owned dofs."""
        return (forces,)

    def unknowns(self) -> Unknowns:
        """Return a copy of the displacement (m), owned dofs."""
        return (np.array(self.displacement.array),)

    def start_at(self, unknowns: Unknowns) -> None:
        """Take over a displacement (m), owned dofs."""
        (self.displacement.array[:],) = unknowns

    def start_from(self, coarse: ContactElements) -> None:
        """Take over the displacement of the forms of elements of a lower degree; collective."""
        self.space.forms.displacement.interpolate(coarse.space.forms.displacement)
        self.displacement.array[:] = self.space.forms.displacement.x.array[: self.space.dofs.owned]
        if coarse.far is not None:
            self.hold_prescribed()


# The solver is made for any tolerance: each solve has its own.
_ANY = 0.5
