"""The whole table, as ``make verify`` prints it: what the tests of ``tests/solve`` do not compare with already."""

from collections.abc import Iterator

from mpi4py import MPI

from epsmesh.solve.compiled import compiling
from epsmesh.verify import Row
from tests.verification.bodies import body_rows
from tests.verification.capsules import capsule_rows
from tests.verification.compliance import compliance_rows
from tests.verification.contact import contact_rows
from tests.verification.contacts import contacts_rows
from tests.verification.elements import element_rows
from tests.verification.far_fields import far_field_rows
from tests.verification.forces import scene_rows
from tests.verification.hyperelastic import hyperelastic_rows
from tests.verification.insertions import insertion_rows
from tests.verification.layered import layer_rows
from tests.verification.loads import load_rows
from tests.verification.needles import needle_rows
from tests.verification.paths import path_rows
from tests.verification.regions import region_rows
from tests.verification.relaxation import relaxation_rows
from tests.verification.rollers import roller_rows
from tests.verification.slits import slit_rows
from tests.verification.wedges import wedge_rows

_OF_SCENES = (
    scene_rows, region_rows, body_rows, contact_rows, wedge_rows, slit_rows, insertion_rows, needle_rows,
    far_field_rows, path_rows, load_rows, hyperelastic_rows, relaxation_rows, layer_rows, capsule_rows,
    compliance_rows, contacts_rows, roller_rows,
)  # fmt: skip


def groups(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Iterator[Row]]:
    """Yield the comparisons of each kind; ``quick`` yields a few of each; collective."""
    yield _elements(comm)
    for of_scenes in _OF_SCENES:
        yield of_scenes(comm, quick=quick)


def rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the comparisons one by one, the same on every rank; ``quick`` yields a few of each kind; collective."""
    for group in groups(comm, quick=quick):
        yield from group


def _elements(comm: MPI.Comm) -> Iterator[Row]:
    checked: list[Row] = []
    if comm.rank == 0:
        with compiling():
            checked = list(element_rows())
    yield from comm.bcast(checked)
