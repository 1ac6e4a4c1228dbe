"""The displacement spaces of one mesh, shared by all that solve on it."""

from pipeline.mesh.distribute import BodyMesh
from pipeline.solve.space import ConstrainedSpace, Contact


class Spaces:
    """Displacement spaces of a mesh, one a degree, each made when first asked for; a context manager.

    A space has one operator: who asks for another one takes it from those before.
    """

    def __init__(self, body: BodyMesh):
        self.body = body
        self._contact: Contact | None = None
        self._made: dict[int, ConstrainedSpace] = {}

    def __enter__(self) -> "Spaces":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def get(self, degree: int, contact: Contact) -> ConstrainedSpace:
        """Return the space of ``degree`` with the conditions of ``contact``; collective.

        Those of another contact are closed.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        if contact != self._contact:
            self.close()
            self._contact = contact
        if degree not in self._made:
            self._made[degree] = ConstrainedSpace(self.body, degree, contact)
        return self._made[degree]

    def close(self) -> None:
        """Free the operators of all spaces."""
        while self._made:
            self._made.popitem()[1].close()
