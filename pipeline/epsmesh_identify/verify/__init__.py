"""Rows for `epsmesh verify`: forces of finite elements against integral equations of layered bodies."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpi4py import MPI

    from epsmesh.verify.row import Row


def rows(comm: "MPI.Comm", *, quick: bool = False) -> "Iterator[Row]":
    """Yield the rows; ``quick`` yields a few of each kind; collective."""
    from epsmesh_identify.verify.compliance import compliance_rows  # noqa: PLC0415 (importing this loads no solver)
    from epsmesh_identify.verify.layers import layer_rows  # noqa: PLC0415

    yield from layer_rows(comm, quick=quick)
    yield from compliance_rows(comm, quick=quick)
