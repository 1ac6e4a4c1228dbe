"""Ctrl-C ends the command quietly at any moment of its start: also while Python itself starts."""

import json
import os
import pwd
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipeline.__main__ import _have_a_home
from tests.commands import ENVIRONMENT, ROOT, epsmesh

LAUNCHER = ROOT / "scripts" / "epsmesh"
PATHS = {"PYTHONPATH": str(ROOT), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
# Seconds after which Ctrl-C comes: in the shell's part of the command, in Python's start, in ours, and later.
MOMENTS = (0.0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.3)


@pytest.mark.parametrize("after", MOMENTS)
def test_an_interrupt_ends_it_with_130_and_without_a_word(after):
    command = subprocess.Popen(
        [LAUNCHER, "plan", "studies/quick.toml"], cwd=ROOT, env=ENVIRONMENT | PATHS, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    time.sleep(after)
    command.send_signal(signal.SIGINT)
    said, errors = command.communicate(timeout=60)
    assert errors == ""
    assert command.returncode in (130, -signal.SIGINT) or (command.returncode, bool(said)) == (0, True)


def test_the_launcher_hands_on_arguments_and_status():
    done = subprocess.run(
        [LAUNCHER, "validate", "a b'c.toml"], cwd=ROOT, env=ENVIRONMENT | PATHS, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "a b'c.toml" in done.stderr


def test_an_interrupt_of_which_an_import_made_another_exception_is_one(monkeypatch):
    """As pybind11 does while dolfinx loads."""

    def interrupted(**_):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as interrupt:
            raise ImportError("initialization failed") from interrupt

    monkeypatch.setattr("pipeline.run.provenance.provenance", interrupted)
    done = epsmesh("version", "--json")
    assert (done.exit_code, done.stderr) == (130, "")
    assert json.loads(done.stdout)["status"] == 130


# What an interrupt of the import of MPI leaves behind: no module, and an MPI that waits for all ranks as Python ends.
ONE_RANK_LEAVES = """
import sys
from mpi4py import MPI
from pipeline.cli.group import _end_ranks
comm = MPI.COMM_WORLD
if comm.rank == 0:
    comm.barrier()
del sys.modules["mpi4py.MPI"]
_end_ranks()
"""


def test_a_rank_that_is_interrupted_while_mpi_loads_ends_the_others():
    words = ["mpirun", "--oversubscribe", "-n", "2", sys.executable, "-c", ONE_RANK_LEAVES]
    done = subprocess.run(words, cwd=ROOT, env=ENVIRONMENT, capture_output=True, check=False, timeout=60)
    assert done.returncode == 130


def test_a_user_without_a_name_and_a_home_has_that_of_a_container(monkeypatch):
    """MPI ends with a fault of memory where there is none."""
    monkeypatch.delenv("HOME")
    _have_a_home()
    assert "HOME" not in os.environ  # the system knows
    monkeypatch.setattr(pwd, "getpwuid", {}.__getitem__)
    _have_a_home()
    assert os.environ["HOME"] == "/"
