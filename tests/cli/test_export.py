"""`epsmesh export` refuses what it has no model of, and says why, before anything is solved."""

import signal
import subprocess
import time
from pathlib import Path

import psutil
import pytest

from tests.commands import ENVIRONMENT, ROOT, command, epsmesh

STUDY = """
[body]
shape = "cylinder"
radius = "20 mm"
height = "20 mm"
[material]
young = "10 kPa"
poisson = 0.45
[probe]
shape = "disc"
radius = "2 mm"
depth = "0.1 mm"
contact = "{contact}"
[mesh]
accuracy = "1 %"
"""


@pytest.mark.parametrize(
    ("contact", "arguments", "word"),
    [
        ("unilateral", (), '"unilateral" has no real-time model for a disc'),
        ("frictionless", ("--accuracy", "0.01%"), "must be between 0.2% and 20%"),
        ("frictionless", ("--accuracy", "fine"), "--accuracy fine"),
    ],
)
def test_what_cannot_be_exported_is_refused(tmp_path, contact, arguments, word):
    (tmp_path / "mine.toml").write_text(STUDY.format(contact=contact))
    ran = epsmesh("export", tmp_path / "mine.toml", "--model", tmp_path / "model.nc", *arguments)
    assert ran.exit_code == 2
    assert word in ran.stderr
    assert not list(tmp_path.rglob("*.nc"))


# Seconds within which all processes are gone, as benchmarks/results/reliability.md has it.
LONGEST = 30


def children(process):
    """Return the ranks that a launcher has started, itself or by a helper."""
    found = psutil.Process(process).children(recursive=True)
    return [child.pid for child in found if child.name().startswith("python")]


def loads_mpi(process):
    return "libmpi" in Path(f"/proc/{process}/maps").read_text()


def lives(process):
    """Tell whether a process runs: one that has ended may stay in the list where nobody asks for its status."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGKILL, marks=pytest.mark.nightly)])
def test_an_export_ends_with_any_of_its_ranks(tmp_path, number):
    """The others wait for it in a call that would never be answered."""
    (tmp_path / "mine.toml").write_text(STUDY.format(contact="frictionless"))
    arguments = ("export", tmp_path / "mine.toml", "--model", tmp_path / "model.nc")
    export = subprocess.Popen(
        command(*arguments, ranks=2), cwd=ROOT, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        end = time.monotonic() + 120
        while len(ranks := children(export.pid)) < 2 or not all(map(loads_mpi, ranks)):
            assert time.monotonic() < end
            time.sleep(0.1)
        time.sleep(3)  # until it meshes or solves
        signal_one = subprocess.run(["kill", f"-{number}", str(ranks[1])], check=False)
        assert signal_one.returncode == 0
        export.communicate(timeout=60)
    finally:
        export.kill()
    assert export.returncode in (130, 128 + signal.SIGTERM, 128 + signal.SIGKILL)
    end = time.monotonic() + LONGEST  # mpirun does not wait for those that it kills
    while any(map(lives, ranks)):
        assert time.monotonic() < end
        time.sleep(0.1)
    left = {file.name.partition("-")[0] for file in tmp_path.iterdir()}
    assert left <= {"mine.toml", ".model.nc"}  # the latter for the next export
