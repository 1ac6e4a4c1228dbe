"""The tangent of a hyperelastic body with its entries, for a factorisation."""

from contextlib import ExitStack

from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.elements.mixed import MixedElements
from epsmesh.solve.krylov import keep
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import stage


class AssembledTangent:
    """The tangent at the fields of the forms, in the unit of the law, without conditions; freed with the stack.

    ``blocks`` are K, and in mixed elements the coupling B and the block of pressures. ``matrix`` is K, or a nest.
    """

    def __init__(self, elements: Elements, law: MaterialLaw, stack: ExitStack):
        """Set up; :meth:`update` must be called before any product; collective."""
        self._forms = elements.large_forms(law).tangents
        self._terms, self._of_law = elements.displacements.terms, elements.unit(law)
        self._unit = elements.pressures.unit if isinstance(elements, MixedElements) else 1.0
        self.blocks = [keep(stack, fem_petsc.create_matrix(form)) for form in self._forms]
        self.matrix, *others = self.blocks
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        if others:
            coupling, of_pressures = others
            transpose = keep(stack, PETSc.Mat().createTranspose(coupling))
            blocks = [[self.matrix, transpose], [coupling, of_pressures]]
            self.matrix = keep(stack, PETSc.Mat().createNest(blocks, comm=elements.displacements.comm))

    @stage("assembly")
    def update(self) -> None:
        """Assemble at the fields of the forms; collective."""
        for power, (form, block) in enumerate(zip(self._forms, self.blocks, strict=True)):
            compat.assemble_matrix(form, [], 1.0, block)
            block.scale(self._unit**power)
        for term in self._terms:
            if (added := term.operator()) is not None:
                self.blocks[0].axpy(1 / self._of_law, added, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
                added.destroy()
        self.matrix.assemble()
