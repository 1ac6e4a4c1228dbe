"""How much memory there is: the tightest limit of the control groups counts, in both of their versions."""

import subprocess
import sys
from math import inf

import pytest
from mpi4py import MPI

from pipeline.run.memory import FreeMemory
from pipeline.run.room import container_room

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
    limit = 3_000_000_000
    code = (
        f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}));"
        "from mpi4py import MPI; from pipeline.run.memory import FreeMemory;"
        "print(FreeMemory(MPI.COMM_SELF).available())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 0 < float(done.stdout) < min(limit, FreeMemory(MPI.COMM_SELF).available() + 1e9)


@pytest.mark.mpi
def test_ranks_agree():
    found = MPI.COMM_WORLD.allgather(FreeMemory(MPI.COMM_WORLD).available())
    assert len(set(found)) == 1
    assert found[0] > 0
