"""How much memory there is: the tightest limit counts, and a case that needs more is refused, not killed."""

import platform
import resource
from math import inf

import numpy as np
import psutil
import pytest
from mpi4py import MPI

from epsmesh.run.memory import FreeMemory, return_large_arrays
from epsmesh.run.room import container_room, process_room
from tests.cases import solve

V2 = ("memory.max", "memory.current", "inactive_file", "")
V1 = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file", "memory")


def group(folder, names, limit, usage, cached):
    folder.mkdir(parents=True, exist_ok=True)
    for name, value in zip(names, (limit, usage), strict=False):
        (folder / name).write_text(f"{value}\n")
    (folder / "memory.stat").write_text(f"anon 1\n{names[2]} {cached}\n")


def room(tmp_path, names, path="/job/step"):
    table = tmp_path / "table"
    table.write_text(f"9:name=systemd:/\n4:{names[3]}:{path}\n" if names[3] else f"0::{path}\n")
    return container_room(table, tmp_path)


@pytest.mark.parametrize("names", [V1, V2])
def test_the_tightest_group_counts(tmp_path, names):
    base = tmp_path / names[3]
    no_limit = "max" if names is V2 else 2**63 - 4096
    assert room(tmp_path, names) == inf
    group(base / "job" / "step", names, no_limit, 700, 0)
    assert room(tmp_path, names) == inf
    group(base / "job", names, 1000, 700, 50)
    assert room(tmp_path, names) == 350
    group(base / "job" / "step", names, 800, 700, 0)
    assert room(tmp_path, names) == 100


@pytest.mark.parametrize("names", [V1, V2])
def test_in_a_container_its_own_group_is_what_is_mounted(tmp_path, names):
    group(tmp_path / names[3], names, 1000, 400, 0)
    assert room(tmp_path, names, "/docker/0123") == 600


def test_limit_of_the_process():
    before, limit = resource.getrlimit(resource.RLIMIT_AS), psutil.Process().memory_info().vms + 10**9
    resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
    try:
        assert 0.5e9 < process_room() <= 1e9
        assert FreeMemory(MPI.COMM_SELF).available() <= 1e9
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.mark.mpi
def test_ranks_agree():
    found = MPI.COMM_WORLD.allgather(FreeMemory(MPI.COMM_WORLD).available())
    assert len(set(found)) == 1
    assert found[0] > 0


@pytest.fixture
def outside_slurm(monkeypatch):
    for name in ("SLURM_MEM_PER_NODE", "SLURM_MEM_PER_CPU", "SLURM_CPUS_ON_NODE"):
        monkeypatch.delenv(name, raising=False)


def test_what_slurm_grants(outside_slurm, monkeypatch):
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


def test_a_case_that_needs_more_than_granted_fails_with_its_reason(outside_slurm, monkeypatch):
    monkeypatch.setenv("SLURM_MEM_PER_NODE", "50")
    (record,) = solve().values()
    assert record.status == "failed"
    assert "GB of memory" in record.message


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries have no such setting")
def test_freed_arrays_go_back_to_the_system():
    """Although a library that MPI loads keeps the memory of every array with the process."""
    return_large_arrays()
    before = psutil.Process().memory_info().rss
    array = np.ones(2**24)  # 128 MiB
    assert psutil.Process().memory_info().rss > before + array.nbytes / 2
    del array
    assert psutil.Process().memory_info().rss < before + 2**26
