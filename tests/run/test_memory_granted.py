"""Memory: what a batch system grants is all there is, and a case that needs more is refused, not killed."""

import psutil
import pytest
from mpi4py import MPI

from pipeline.run.memory import FreeMemory
from tests.cases import solve


@pytest.fixture(autouse=True)
def outside_slurm(monkeypatch):
    for name in ("SLURM_MEM_PER_NODE", "SLURM_MEM_PER_CPU", "SLURM_CPUS_ON_NODE"):
        monkeypatch.delenv(name, raising=False)


def test_what_slurm_grants(monkeypatch):
    free = FreeMemory(MPI.COMM_SELF).available()
    resident = psutil.Process().memory_info().rss
    granted = resident / 1e6 + 100
    monkeypatch.setenv("SLURM_MEM_PER_NODE", str(granted))
    assert FreeMemory(MPI.COMM_SELF).available() == pytest.approx(100e6, rel=0.5)
    monkeypatch.setenv("SLURM_MEM_PER_NODE", "0")
    assert FreeMemory(MPI.COMM_SELF).available() > 0.5 * free
    monkeypatch.setenv("SLURM_MEM_PER_CPU", str(granted / 2))
    monkeypatch.setenv("SLURM_CPUS_ON_NODE", "2")
    assert FreeMemory(MPI.COMM_SELF).available() == pytest.approx(100e6, rel=0.5)
    monkeypatch.setenv("SLURM_MEM_PER_CPU", "1")
    assert FreeMemory(MPI.COMM_SELF).available() == 0.0
    for nothing in ("4G", "lots", "nan", "-1", "inf"):
        monkeypatch.setenv("SLURM_MEM_PER_CPU", nothing)
        assert FreeMemory(MPI.COMM_SELF).available() > 0.5 * free


def test_a_case_that_needs_more_than_granted_fails_with_its_reason(monkeypatch):
    monkeypatch.setenv("SLURM_MEM_PER_NODE", "50")
    (record,) = solve().values()
    assert record.status == "failed"
    assert "GB of memory" in record.message
