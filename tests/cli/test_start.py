"""Ctrl-C ends the command quietly while it loads, and whoever starts it."""

import json
import signal
import subprocess
import sys
import time

import pytest

from epsmesh.libraries import SOLVER, System, solver_on
from tests.commands import ENVIRONMENT, MPIRUN, ROOT, epsmesh, spawn

# The command, which says when what answers Ctrl-C is in place: as it begins to load the rest.
COMMAND = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # who starts the tests may have it ignored
told = []
def tell(event, words):
    if event == "import" and words[0] == "epsmesh.cli" and not told:
        told.append(os.write(1, b"ready\\n"))
sys.addaudithook(tell)
from epsmesh.__main__ import main
main()
"""


def test_an_interrupt_ends_it_with_130_and_without_a_word():
    command = subprocess.Popen(
        [sys.executable, "-c", COMMAND, "plan", "studies/quick.toml"], cwd=ROOT, text=True,
        env=ENVIRONMENT | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert command.stdout is not None
    assert command.stdout.readline() == "ready\n"
    time.sleep(0.1)
    command.send_signal(signal.SIGINT)
    said, errors = command.communicate(timeout=60)
    assert errors == ""
    assert command.returncode in (130, -signal.SIGINT) or (command.returncode, bool(said)) == (0, True)


# A command that is interrupted where an exception would be lost, or another one be made of it.
LOSING = """
import os, signal, sys, time, weakref
signal.signal(signal.SIGINT, signal.default_int_handler)
import epsmesh.cli
class Thing: pass
def interrupt(*_):
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.2)
def run():
    if sys.argv[1] == "freed":
        thing = Thing()
        seen = weakref.ref(thing, interrupt)
        del thing
    else:
        import interrupted
    time.sleep(20)
    print("still here")
epsmesh.cli.main = run
sys.modules["__main__"].interrupt = interrupt
from epsmesh.__main__ import main
main()
"""
INTERRUPTED = """
import __main__
try:
    __main__.interrupt()
except BaseException as wrong:
    raise ImportError(f"not loaded: {wrong!r}") from None
"""


@pytest.mark.parametrize("where", ["freed", "loading"])
def test_an_interrupt_is_not_lost_while_an_object_is_freed_or_a_module_loaded(where, tmp_path):
    (tmp_path / "interrupted.py").write_text(INTERRUPTED)
    paths = {"PYTHONPATH": f"{ROOT}:{tmp_path}"}
    done = subprocess.run(
        [sys.executable, "-c", LOSING, where], cwd=ROOT, text=True, env=ENVIRONMENT | paths, capture_output=True,
        check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


@pytest.mark.parametrize("has_cause", [True, False])
def test_an_interrupt_of_which_a_library_made_another_exception_is_one(monkeypatch, has_cause):
    """As pybind11 does while dolfinx loads; and pydantic, which names no cause."""

    def interrupted(**_):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as interrupt:
            raise ImportError("initialization failed") from (interrupt if has_cause else None)

    if not has_cause:
        monkeypatch.setattr("epsmesh.interrupts._raised", [signal.SIGINT])
    monkeypatch.setattr("epsmesh.run.provenance.provenance", interrupted)
    done = epsmesh("--version", "--json")
    assert (done.exit_code, done.stderr) == (130, "")


# What an interrupt of the import of MPI leaves behind: no module, and an MPI that waits for all ranks as Python ends.
ONE_RANK_LEAVES = """
import sys
from mpi4py import MPI
from epsmesh.cli.group import _end_ranks
comm = MPI.COMM_WORLD
if comm.rank == 0:
    comm.barrier()
del sys.modules["mpi4py.MPI"]
_end_ranks()
"""


def test_a_rank_that_is_interrupted_while_mpi_loads_ends_the_others():
    words = [*MPIRUN, "2", sys.executable, "-c", ONE_RANK_LEAVES]
    done = subprocess.run(words, cwd=ROOT, env=ENVIRONMENT, capture_output=True, check=False, timeout=60)
    assert done.returncode == 130


WITHOUT = """
import sys
sys.modules |= dict.fromkeys(sys.argv.pop(1).split(","))  # as if they were not installed
from epsmesh.__main__ import main
main()
"""


def without(library, *words, **environment):
    return subprocess.run(
        [sys.executable, "-c", WITHOUT, library, *map(str, words)],
        cwd=ROOT,
        env=ENVIRONMENT | {"PYTHONPATH": str(ROOT)} | environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    ("library", "words", "remedy"),
    [
        ("gmsh", ("run", "STUDY"), solver_on(System.here())),
        ("pydantic", ("plan", "STUDY"), "`pip install '.'`"),
        ("nibabel", ("plan", "docs/scenes/image.toml"), "`pip install '.[organs]'`"),
    ],
)
def test_a_library_that_is_missing_is_named_with_what_installs_it(small, tmp_path, library, words, remedy):
    words = [small if word == "STUDY" else word for word in words]
    done = without(library, *words, "--output", tmp_path / "results", EPSMESH_CACHE=str(tmp_path / "cache"))
    assert done.returncode == 2, done.stderr
    assert f"the Python library {library} is missing" in done.stderr
    assert remedy in done.stderr
    assert "Traceback" not in done.stderr


def test_a_missing_library_is_data_for_a_script(small, tmp_path):
    done = without("gmsh", "run", small, "--json", "--output", tmp_path / "results")
    assert (done.returncode, json.loads(done.stdout)["status"]) == (2, 2)


def test_what_solves_nothing_needs_no_solver(small, tmp_path):
    folder, missing = tmp_path / "results", ",".join(SOLVER)
    solved = spawn("run", small, "--output", folder)
    assert solved.returncode == 0, solved.stderr
    stored = ("run", small, "--output", folder)
    for words in (("plan", small), stored, ("report", small, "--output", folder), ("--version", "--verbose")):
        done = without(missing, *words)
        assert done.returncode == 0, done.stderr
    assert "dolfinx" not in done.stdout
    done = without(missing, "run", small, "--output", tmp_path / "other")
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)
    assert solver_on(System.here()) in done.stderr
