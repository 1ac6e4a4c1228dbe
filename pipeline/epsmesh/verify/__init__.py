"""Verification of F: closed forms, published tables, manufactured solutions, and other ways through the program."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from epsmesh.extensions import found
from epsmesh.verify.row import Row

if TYPE_CHECKING:
    from mpi4py import MPI


def rows(comm: "MPI.Comm", *, quick: bool = False) -> Iterator[Row]:
    """Yield the comparisons one by one, the same on every rank; ``quick`` yields a few of each kind; collective."""
    from epsmesh.solve.compiled import compiling  # noqa: PLC0415 (importing this package loads no solver)
    from epsmesh.verify.bodies import body_rows  # noqa: PLC0415
    from epsmesh.verify.contact import contact_rows  # noqa: PLC0415
    from epsmesh.verify.elements import element_rows  # noqa: PLC0415
    from epsmesh.verify.far_fields import far_field_rows  # noqa: PLC0415
    from epsmesh.verify.forces import scene_rows  # noqa: PLC0415
    from epsmesh.verify.friction import friction_rows  # noqa: PLC0415
    from epsmesh.verify.hyperelastic import hyperelastic_rows  # noqa: PLC0415
    from epsmesh.verify.insertions import insertion_rows  # noqa: PLC0415
    from epsmesh.verify.laws import law_rows  # noqa: PLC0415
    from epsmesh.verify.loads import load_rows  # noqa: PLC0415
    from epsmesh.verify.needles import needle_rows  # noqa: PLC0415
    from epsmesh.verify.paths import path_rows  # noqa: PLC0415
    from epsmesh.verify.regions import region_rows  # noqa: PLC0415
    from epsmesh.verify.relaxation import relaxation_rows  # noqa: PLC0415
    from epsmesh.verify.slits import slit_rows  # noqa: PLC0415
    from epsmesh.verify.wedges import wedge_rows  # noqa: PLC0415

    checked: list[Row] = []
    if comm.rank == 0:
        with compiling():
            checked = [*element_rows(), *law_rows()]
    yield from comm.bcast(checked)
    yield from scene_rows(comm, quick=quick)
    yield from region_rows(comm, quick=quick)
    yield from body_rows(comm, quick=quick)
    yield from contact_rows(comm, quick=quick)
    yield from friction_rows(comm, quick=quick)
    yield from wedge_rows(comm, quick=quick)
    yield from slit_rows(comm, quick=quick)
    yield from insertion_rows(comm, quick=quick)
    yield from needle_rows(comm, quick=quick)
    yield from far_field_rows(comm, quick=quick)
    yield from path_rows(comm, quick=quick)
    yield from load_rows(comm, quick=quick)
    yield from hyperelastic_rows(comm, quick=quick)
    yield from relaxation_rows(comm, quick=quick)
    for truth in found("truths").values():  # of other packages
        yield from truth.load()(comm, quick=quick)
