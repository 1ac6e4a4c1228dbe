"""A hyperelastic body seen from the nodes that a tool may touch: the interface of :mod:`.deformed` on its elements.

Linear systems are solved in turned frames, in which the normal displacement of an active node is one unknown.
"""

from contextlib import ExitStack
from math import nan

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.contact.constraint import Constraint
from epsmesh.solve.contact.levels import Surface
from epsmesh.solve.contact.normals import deformed_normals
from epsmesh.solve.contact.numbering import Numbering, Pairs
from epsmesh.solve.contact.parts import TOOL, Part, part_of
from epsmesh.solve.contact.sliding import SlidingTissue
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.turned_tangent import FactorisedTangent, IteratedTangent, TurnedTangent
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.hyperelastic import HyperelasticBody
from epsmesh.solve.krylov import keep
from epsmesh.solve.loads import Applied
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import stage


class DeformedBody:
    """Elements of a hyperelastic ``law`` with ``candidates`` of contact: see :class:`.deformed.Tissue`.

    The state is one vector of owned dofs: displacement, and in mixed elements pressure. What is made is freed with the
    stack.
    """

    def __init__(
        self,
        elements: Elements,
        surface: Surface,
        law: MaterialLaw,
        method: str,
        stack: ExitStack,
        applied: Applied | None = None,
        *,
        prestressed: bool = False,
    ):
        """Set up; collective. ``method`` is the requested solver, ``applied`` are dead loads.

        ``prestressed``: the energy of ``hyperelastic`` may change; only iterations know that.

        Raises:
            SolveError: if the preconditioner cannot be set up.
        """
        self.elements, self.law, self.method = elements, law, method
        self.candidates: Candidates = surface.of(elements.degree)
        self._parts: dict[int, Part] = {}
        space = self._space = elements.displacements
        self.hyperelastic = self._body = HyperelasticBody(elements, law, prestressed=prestressed)
        stack.callback(self._body.close)
        self.applied = applied
        if applied is not None:
            self._body.carry(applied)
        self._unit = elements.unit(law)
        self._numbering, self._at_rest = Numbering(space.space, self.candidates.numbers), surface.pairs(elements.degree)
        self._sliding: SlidingTissue | None = None
        self._places = self.candidates.points
        if space.body.imaged is not None:
            self._places = self._numbering.gather_vectors(space.places)
        self._tangent: TurnedTangent
        if method == "direct":
            self._tangent = FactorisedTangent(elements, law, self._body, self._numbering, surface, stack)
        else:
            self._tangent = IteratedTangent(elements, law, self._body, self._numbering, surface, stack)
        elements.set_law(law)
        self._now, self._residual, self._change = (stack.enter_context(self._body.state()) for _ in range(3))
        self._from = self._now.array.copy()
        is_fixed = np.zeros(space.owned)
        is_fixed[space.prescribed_owned] = 1.0
        self.fixed = self._numbering.gather_vectors(is_fixed) > 0
        # Whether a support or terms hold it, besides contacts.
        self.is_held = bool(space.terms) or space.comm.allreduce(len(space.fixed_owned)) > 0
        self._is_current = False  # are the forces
        self._energy: float | None = None
        self.slope: float | None = None
        self.iterations = 0

    def slide(self, number: int) -> None:
        """Let loose tissue slide from now on, on the tissue below of the contact with this ``number``."""
        if self._sliding is None:
            assert self._at_rest is not None
            self._sliding = SlidingTissue(self._at_rest, self.part(number).candidates)

    @property
    def _pairs(self) -> Pairs | None:
        """The pairs of loose tissue, where it has slid in this state."""
        if self._sliding is None:
            return self._at_rest
        return self._sliding.pairs(self._now.array[: self._space.owned])

    # ---- the interface --------------------------------------------------------------------------------

    @property
    def state(self) -> FloatArray:
        """The unknowns of this rank."""
        return np.array(self._now.array)

    @state.setter
    def state(self, values: FloatArray) -> None:
        self._now.array[:] = values
        self._from, self._is_current, self._energy = values.copy(), False, None

    def positions(self) -> FloatArray:
        """Return the nodes' deformed positions (n, 3), in m; of loose tissue, as the tissue below sees them."""
        found = self.places + self._moved(self._now.array[: self._space.owned])
        if self._sliding is not None:
            assert self._pairs is not None
            found[self._pairs.nodes] += self._sliding.offset
        return found

    def displacements(self) -> FloatArray:
        """Return the nodes' displacements (n, 3), in m, of loose tissue relative to what is now below it."""
        return self._moved(self._now.array[: self._space.owned])

    def forces(self) -> FloatArray:
        """Return the nodal forces (n, 3), N; zero at prescribed components."""
        return np.where(self.fixed, 0.0, self._numbering.gather_vectors(self._forces()[: self._space.owned]))

    def elastic_forces(self) -> FloatArray:
        """Return the nodal forces (n, 3), N, of the law without relaxation, which the energy has from then on."""
        self._body.impose(None, (1.0,) * len(self.law.parameters))
        with self._body.state() as forces:
            self._body.forces(self._now, forces)
            found = self._numbering.gather_vectors(forces.array[: self._space.owned])
        return np.where(self.fixed, 0.0, found)

    def unbalanced(self) -> float:
        """Return the norm (N) of the residual at all other free dofs."""
        left = self._forces().copy()
        if self._pairs is not None:
            self._pairs.fold(left)
        left[self._space.prescribed_owned] = 0.0
        self._numbering.put_vectors(left, np.zeros(self.fixed.shape))
        return float(np.sqrt(global_sum(self._space.comm, np.array([left @ left]))[0]))

    @stage("tangent solves")
    def linearise(self, constraint: Constraint) -> FloatArray:
        """Find the increment under a ``constraint``; return the nodal forces (n, 3), N, that it predicts.

        Raises:
            SolveError: if the linear solver fails.
        """
        self._from = self.state
        self._tangent.pairs = pairs = self._pairs
        if self._sliding is not None and pairs is not None:
            pressing = np.einsum("ni,ni->n", self.forces()[pairs.nodes], pairs.normal)
            pressing = np.where(constraint.held[pairs.nodes, -1], np.maximum(pressing, 0.0), 0.0)
            self._tangent.slipping = self._sliding.slipping(pressing)
        self._tangent.update(self._now, constraint)
        self._prescribe(constraint)
        with self._body.state() as right:
            self._tangent.multiply(self._change, right)
            right.array[:] = -right.array - self._forces() / self._unit
            self._numbering.add_vectors(right.array, constraint.forces / self._unit)
            if self._pairs is not None:
                self._pairs.react(right.array, constraint.forces / self._unit)
            target = constraint.left * float(np.linalg.norm(self.forces())) / self._unit
            self._tangent.solve(constraint, right, self._change, target)
            self.slope = None if self._body.is_mixed or self._sliding is not None else -self._residual.dot(self._change)
            self._tangent.multiply(self._change, right)
            moved = self._moved(self._change.array[: self._space.owned])
            change = self._numbering.gather_vectors(self._unit * right.array[: self._space.owned])
        self.iterations += 1
        return self.forces() + change + np.einsum("nij,nj->ni", constraint.turning, moved)

    def advance(self, fraction: float) -> bool:
        """Set the state to the last one linearised plus a ``fraction`` of its increment; return whether J > 0."""
        self._now.array[:] = self._from + fraction * self._change.array
        self._is_current, self._energy = False, None
        return self.is_sound

    @property
    def is_sound(self) -> bool:
        """Whether J > 0 everywhere; collective."""
        return bool(np.isfinite(self.energy))

    @property
    def energy(self) -> float:
        """Energy (J) of the modelled part less the work of loads, NaN if tissue is inside out; collective."""
        if self._energy is None:
            self._energy = self._body.energy(self._now)
        return self._energy

    def part(self, number: int = TOOL) -> Part:
        """Return the candidates of the contact with this ``number``, 0 of the tool."""
        if number not in self._parts:
            self._parts[number] = part_of(self.candidates, number)
        return self._parts[number]

    def moduli(self, number: int = TOOL) -> tuple[float, ...]:
        """Return E / (1 - ν²) (Pa) of each region; in contact with a tool that deforms, of both in series."""
        found = self.law.plane_moduli
        if number != TOOL or not self._space.conditions.deforms:
            return found
        return tuple(1 / (1 / own + 1 / found[-1]) for own in found)

    @property
    def places(self) -> FloatArray:
        """The nodes' places (n, 3) at rest, in m."""
        return self._places

    def normals_on(self, number: int) -> FloatArray:
        """Return unit normals (n, 3) into loose tissue at the nodes of the contact with this ``number``; collective.

        With a linear law they are those at rest, else those of the tissue below in its state.
        """
        assert self._pairs is not None
        part, (at_rest, free) = self.part(number), np.zeros((2, *self.fixed.shape))
        at_rest[self._pairs.nodes], free[self._pairs.nodes] = self._pairs.normal, self._pairs.free
        if self.law.is_linear:
            return np.asarray(part.of(at_rest))
        if self._sliding is not None:
            return self._pairs.normal
        return deformed_normals(part.candidates, self.below(number), part.of(at_rest), part.of(free))

    def below(self, number: int) -> FloatArray:
        """Return where (n, 3), m, the tissue below is to which nodes of the contact with this ``number`` belong."""
        found = self.places.copy()
        if self._pairs is not None:
            found[self._pairs.nodes] += self._pairs.lower.gather_vectors(self._now.array[: self._space.owned])
        return np.asarray(self.part(number).of(found))

    def overhang(self, forces: FloatArray) -> float:
        """Return the part (N) of the ``forces`` (n, 3), N, with which loose tissue presses beyond the edge of that
        below.

        Raises:
            LargeError: if places of it have no tissue below.
        """
        if self._sliding is None or self._pairs is None:
            return 0.0
        if self._sliding.is_lost:
            raise LargeError("loose tissue has places without tissue below along its normals: use a smaller depth")
        return self._sliding.overhang(np.einsum("ni,ni->n", forces[self._pairs.nodes], self._pairs.normal))

    # ---- results ----------------------------------------------------------------------------------------

    def residual(self) -> FloatArray:
        """Return the nodal forces (N) of the displacement, owned dofs, reactions of the support included."""
        return self._forces()[: self._space.owned].copy()

    def on_support(self, forces: FloatArray) -> FloatArray:
        """Return the nodal forces (N), owned dofs, besides the ``forces`` (n, 3), N, on the candidates: those of the
        support, also where loose tissue presses next to it."""
        found = self.residual()
        if self._pairs is not None:
            self._pairs.react(found, -forces)
        return found

    def shortening(self, foot: tuple[float, float]) -> float:
        """Return how far (m) a tool that deforms gives way along its axis, at its ``foot`` (m); NaN of a rigid one."""
        if self._pairs is None or not self._space.conditions.deforms:
            return nan
        part, beside = self.part(), np.zeros(self.fixed.shape)
        beside[self._pairs.nodes] = self._pairs.lower.gather_vectors(self._now.array[: self._space.owned])
        return part.candidates.at(foot, part.of(beside)[:, 2])

    @property
    def mount_force(self) -> float:
        """The force (N) on the mount of a tool that deforms, against its advance; collective."""
        local = self.residual().reshape(-1, 3)[self._space.mount_owned, 2].sum()
        return -float(global_sum(self._space.comm, np.array([local]))[0])

    def split(self, state: FloatArray) -> list[FloatArray]:
        """Return a state by field."""
        with self.elements.fields() as parts:
            return self._body.split(state, parts)

    @property
    def on_terms(self) -> FloatArray:
        """The resultant (3), N, of all terms besides the law; collective."""
        return self._body.on_terms(self._now)[0]

    @property
    def size_on_terms(self) -> float:
        """The sum (N) of the sizes of their nodal forces; collective."""
        return self._body.on_terms(self._now)[1]

    def stiffness_of_terms(self) -> FloatArray:
        """Return the largest stiffness (n), N/m, that all terms besides the law give each node alone; collective."""
        found = np.zeros(self._space.owned)
        with ExitStack() as stack:
            for term in self._space.terms:
                if (made := term.operator()) is not None:
                    found += keep(stack, keep(stack, made).getDiagonal()).array
        return np.asarray(self._numbering.gather_vectors(found).max(axis=1))

    @property
    def work_of_loads(self) -> float:
        """The work (J) of the loads on the modelled part; collective."""
        own = 0.0 if self.applied is None else float(self.applied.forces @ self.state[: self._space.owned])
        return float(global_sum(self._space.comm, np.array([own]))[0])

    def show(self) -> None:
        """Set the fields of the forms."""
        self._body.show(self._now)

    def interpolate(self, coarse: Elements) -> None:
        """Set the state to the fields of the forms of ``coarse``."""
        self.elements.interpolate(coarse)
        self.state = self.elements.values

    def _moved(self, values: FloatArray) -> FloatArray:
        """Return the displacements (n, 3) of the nodes, of loose tissue relative to that below it."""
        found = self._numbering.gather_vectors(values)
        if self._pairs is not None:
            self._pairs.relative(found, values)
        return found

    # ---- the linear system ------------------------------------------------------------------------------

    def _forces(self) -> FloatArray:
        if not self._is_current:
            self._body.forces(self._now, self._residual)
            self._is_current = True
        return np.asarray(self._residual.array)

    def _prescribe(self, constraint: Constraint) -> None:
        """Write the prescribed increment into the change."""
        moved = np.einsum("nij,nj->ni", constraint.frames, np.where(constraint.held, constraint.values, 0.0))
        self._change.set(0.0)
        self._numbering.put_vectors(self._change.array, np.where(self.fixed, 0.0, moved))
