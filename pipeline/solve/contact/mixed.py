"""Taylor–Hood elements whose nodes below the probe are held where they touch it: up to ν = ½.

Equations and solver are those of :mod:`pipeline.solve.elements`; reactions are those of K₀ u + Bᵀ p.
"""

from contextlib import ExitStack

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import BoolArray, FloatArray, Int32Array
from pipeline.solve.contact.active_set import State
from pipeline.solve.contact.candidates import CONDITIONS, Candidates, Surface
from pipeline.solve.contact.elements import ContactElements, Unknowns
from pipeline.solve.contact.levels import Hierarchy, normal_dofs
from pipeline.solve.elements import DIRECT_LIMIT
from pipeline.solve.krylov import Level
from pipeline.solve.mixed_space import MixedSpace
from pipeline.solve.physics import MaterialLaw, SplitLaw
from pipeline.solve.saddle import Pair, Saddle, SaddleSolver
from pipeline.solve.spaces import ElasticSpace, Spaces
from pipeline.stages import stage


class MixedElements(ContactElements):
    """Displacements of degree 2 or more and pressures of one less.

    What they make is freed with the stack. Moduli are in the law's unit, energies and forces in J and N.
    """

    def __init__(self, spaces: Spaces, degree: int, law: MaterialLaw, surface: Surface, method: str, stack: ExitStack):
        """Assemble; collective."""
        super().__init__()
        self.space: ElasticSpace = spaces.get(degree, CONDITIONS)
        self.mixed = MixedSpace(spaces.body, self.space)
        stack.callback(self.mixed.close)
        self._split = SplitLaw.of(law)
        self._direct = method == "direct" or (method == "auto" and self.mixed.dofs <= DIRECT_LIMIT)
        # The residual of held displacements must vanish: it is part of the norm that is made small.
        self.hierarchy = Hierarchy(
            spaces, degree, self._split.elastic, surface, stack, direct=self._direct, masks=False
        )
        self.candidates: Candidates = surface.of(degree)
        self.numbering = self.hierarchy.numbering
        self.unknown: Pair = stack.enter_context(self.mixed.pair())
        self.compliance = self.mixed.by_region(self._split.compliance)
        self._coupling, self._mass = self.mixed.blocks(entries=self._direct)
        self._held: Int32Array = np.empty(0, dtype=np.int32)
        self._solving: ExitStack | None = None
        self.first_energy = 0.0
        stack.callback(self.close)

    def close(self) -> None:
        """Free the solver."""
        if self._solving is not None:
            self._solving.close()
            self._solving = None

    def hold(self, active: BoolArray) -> None:
        """Hold the ``active`` candidates (n) from now on; collective.

        Raises:
            SolveError: if the solver cannot be set up.
        """
        self._active = active
        self._set_up(self.hierarchy.hold(active), self.numbering.normal_dofs(active, owned=True))

    def hold_facets(self, facets: Int32Array) -> None:
        """Hold all of the local ``facets`` where they are, in the place of any set; collective.

        Raises:
            SolveError: if the solver cannot be set up.
        """
        dofs = normal_dofs(self.space, facets)
        self._active = np.zeros(len(self.candidates), dtype=bool)
        self._set_up(self.hierarchy.hold_facets(facets), dofs[dofs < self.space.dofs.owned])

    @stage("set-up")
    def _set_up(self, levels: list[Level], held: Int32Array) -> None:
        self.close()
        with ExitStack() as stack:
            self._held = held
            coupling = self._holding(stack)
            moduli = zip(self._split.elastic.lame_lambda, self._split.elastic.lame_mu, strict=True)
            stiffness = self.mixed.by_region(tuple(lame + 2 * mu for lame, mu in moduli))
            saddle = Saddle(levels, coupling, self._mass, stiffness, self.space.degree - 1)
            self._solver = stack.enter_context(SaddleSolver(saddle, direct=self._direct))
            self._solving = stack.pop_all()

    def _holding(self, stack: ExitStack) -> PETSc.Mat:
        """Return B with columns of zeros for what is held."""
        if self._coupling.getType() == "python":
            coupling = self._coupling.getPythonContext().holding(self._held).matrix()
            stack.callback(coupling.destroy)
            return coupling
        coupling = self._coupling.copy()
        stack.callback(coupling.destroy)
        free = coupling.createVecRight()
        free.set(1.0)
        free.array[self._held] = 0.0
        coupling.diagonalScale(None, free)
        free.destroy()
        return coupling

    def approach(self, bounds: FloatArray, tolerance: float, energy: float | None) -> int:
        """Move what is held to ``bounds`` (n, m), and then the rest; return the iterations.

        Raises:
            SolveError: if the solver does not converge.
        """
        displacement, pressure = self.unknown
        self.numbering.put(displacement.array, bounds, self._active)
        with self.mixed.pair() as rest, self.mixed.pair() as correction:
            self._product(rest)
            for part in rest:
                part.scale(-1.0)
            if self.load is not None:
                for part, values in zip(rest, self.load, strict=True):
                    part.array[:] += values
            rest[0].array[self.space.dofs.prescribed_owned] = 0.0
            rest[0].array[self._held] = 0.0
            target = None if energy is None else tolerance * (energy / self._split.unit) ** 0.5
            iterations = self._solver.solve(self.compliance, [rest], [correction], tolerance, target)
            self.first_energy = self._split.unit * self._solver.first_energies[0]
            displacement.axpy(1.0, correction[0])
            pressure.axpy(1.0, correction[1])
        return iterations

    def near_state(self) -> State:
        """Return what the candidates do, far field aside; collective."""
        displacement, _ = self.unknown
        with self.mixed.pair() as forces:
            self._product(forces)
            moved, reactions = (self.numbering.gather(v.array) for v in (displacement, forces[0]))
        return State(moved, self._split.unit * reactions, self.energy())

    def energy(self) -> float:
        """Return twice the energy (J) of the part that is modelled, stationary at the solution, less a constant.

        The constant is that of what is prescribed, if that is not nothing; collective.
        """
        with self.mixed.pair() as result:
            self._product(result)
            if self.load is not None:
                for part, values in zip(result, self.load, strict=True):
                    part.array[:] -= 2 * values
            displacement, pressure = self.unknown
            return self._split.unit * float(displacement.dot(result[0]) + pressure.dot(result[1]))

    def _product(self, result: Pair) -> None:
        """Write K₀ u + Bᵀ p and B u − c M p into the two vectors; collective."""
        displacement, pressure = self.unknown
        with self.mixed.pair() as (pull, dilation):
            self.hierarchy.finest.mult(displacement, result[0])
            self._coupling.multTranspose(pressure, pull)
            result[0].axpy(1.0, pull)
            self._coupling.mult(displacement, dilation)
            self._mass.mult(pressure, result[1])
            result[1].array[:] *= -self.compliance
            result[1].axpy(1.0, dilation)

    def put_fields(self, unknowns: Unknowns) -> None:
        """Make ``unknowns`` displacement and pressure of the forms; collective."""
        with self.mixed.pair() as fields:
            for part, values in zip(fields, unknowns, strict=True):
                part.array[:] = values
            self.mixed.set_fields(fields)

    def residual(self) -> FloatArray:
        """Return K₀ u + Bᵀ p (N) with the unmodified operator, owned dofs, for the forms' fields; collective."""
        with self.mixed.pair() as (residual, dilation), self.mixed.pair() as (pull, _):
            self.mixed.apply(residual, pull, dilation, self._split.elastic)
            return np.asarray(self._split.unit * (residual.array + pull.array))

    def lift(self, held: FloatArray) -> Unknowns:
        """Return the right-hand side of prescribed displacements ``held`` (m, with ghosts); collective."""
        with self.mixed.pair() as rhs:
            self.mixed.lift(rhs, held, self._split.elastic)
            return tuple(np.array(part.array) for part in rhs)

    def pulled(self, forces: FloatArray) -> Unknowns:
        """Return the right-hand side of ``forces`` (N), owned dofs."""
        return forces / self._split.unit, np.zeros_like(self.unknown[1].array)

    def unknowns(self) -> Unknowns:
        """Return a copy of displacement (m) and pressure (in the law's unit), owned dofs."""
        return tuple(np.array(part.array) for part in self.unknown)

    def start_at(self, unknowns: Unknowns) -> None:
        """Take over displacement and pressure, owned dofs."""
        for part, values in zip(self.unknown, unknowns, strict=True):
            part.array[:] = values

    def start_from(self, coarse: ContactElements) -> None:
        """Take over the fields of the forms of elements of a lower degree; collective.

        Of displacement elements there is no pressure.
        """
        if not isinstance(coarse, MixedElements):
            self.space.forms.displacement.interpolate(coarse.space.forms.displacement)
            self.unknown[0].array[:] = self.space.forms.displacement.x.array[: self.space.dofs.owned]
            return
        nothing = np.zeros_like(self.space.forms.displacement.x.array)
        self.mixed.start_from(coarse.mixed, self.unknown, nothing)
        if coarse.far is not None:
            self.hold_prescribed()
