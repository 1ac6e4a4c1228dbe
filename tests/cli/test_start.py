"""Ctrl-C ends the command quietly while it loads, and whoever starts it."""

import json
import os
import pwd
import signal
import subprocess
import sys
import time

import pytest

from pipeline.__main__ import _have_a_home
from tests.commands import ENVIRONMENT, ROOT, epsmesh

# The command, which says when what answers Ctrl-C is in place: as it begins to load the rest.
COMMAND = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # who starts the tests may have it ignored
told = []
def tell(event, words):
    if event == "import" and words[0] == "pipeline.cli" and not told:
        told.append(os.write(1, b"ready\\n"))
sys.addaudithook(tell)
from pipeline.__main__ import main
main()
"""


@pytest.mark.parametrize("after", [0.0, 0.2])
def test_an_interrupt_ends_it_with_130_and_without_a_word(after):
    command = subprocess.Popen(
        [sys.executable, "-c", COMMAND, "plan", "studies/quick.toml"], cwd=ROOT, text=True,
        env=ENVIRONMENT | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert command.stdout is not None
    assert command.stdout.readline() == "ready\n"
    time.sleep(after)
    command.send_signal(signal.SIGINT)
    said, errors = command.communicate(timeout=60)
    assert errors == ""
    assert command.returncode in (130, -signal.SIGINT) or (command.returncode, bool(said)) == (0, True)


def test_an_interrupt_of_which_an_import_made_another_exception_is_one(monkeypatch):
    """As pybind11 does while dolfinx loads."""

    def interrupted(**_):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as interrupt:
            raise ImportError("initialization failed") from interrupt

    monkeypatch.setattr("pipeline.run.provenance.provenance", interrupted)
    done = epsmesh("--version", "--json")
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


WITHOUT = """
import sys
sys.modules[sys.argv.pop(1)] = None  # as if it were not installed
from pipeline.__main__ import main
main()
"""


@pytest.mark.parametrize(
    ("library", "remedy"), [("dolfinx", "environment.yml"), ("gmsh", "make setup"), ("mpi4py", "make setup")]
)
def test_a_library_that_is_missing_is_named_with_what_installs_it(library, remedy, small, tmp_path):
    words = ["run", str(small), "--output", str(tmp_path / "results")]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT, library, *words],
        cwd=ROOT,
        env=ENVIRONMENT | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert f"the library {library} is missing" in done.stderr
    assert remedy in done.stderr
    assert "Traceback" not in done.stderr
