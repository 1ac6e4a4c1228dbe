"""What tests of the command line share: `epsmesh` in this process, `spawn` in one of its own, and a small study."""

import importlib.util
import os
from math import inf

import pytest

from epsmesh.run import store
from epsmesh.shapes.files import checked
from epsmesh.study import case
from tests import commands, suites
from tests.studies import small_text

if importlib.util.find_spec("dolfinx_solver") is not None:  # the wheels' dolfinx loads only after MPI
    from epsmesh import mpi  # noqa: F401

SMALL = small_text(material={"poisson": [0.3, 0.4]}, mesh={"outside": ["coarse", "free"]})


def pytest_ignore_collect(collection_path):
    """On several ranks, load only files with tests for several: those with the mark ``mpi``.

    MPI is not started for this: processes that start later would take themselves for ranks.
    """
    ranks = int(os.environ.get("OMPI_COMM_WORLD_SIZE") or os.environ.get("PMI_SIZE") or 1)
    is_test = collection_path.name.startswith("test_") and collection_path.suffix == ".py"
    return True if is_test and ranks > 1 and "mark.mpi" not in collection_path.read_text() else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark what runs by night (:mod:`tests.suites`), and put slow files first, so that workers end together."""
    cost = suites.costs()
    for item in items:
        if suites.is_nightly(item.nodeid, getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.nightly)
    items.sort(key=lambda item: -cost.get(item.nodeid.partition("::")[0], 0))


@pytest.fixture(scope="session", autouse=True)
def state(tmp_path_factory):
    """Runs of the tests are not registered among the user's."""
    folder = tmp_path_factory.mktemp("state")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(folder))
        patch.setitem(commands.ENVIRONMENT, "XDG_STATE_HOME", str(folder))
        yield


@pytest.fixture(scope="session", autouse=True)
def written():
    """Wait for no disk: what this avoids, a loss of power, no test has. A write takes up to 30 ms on virtual disks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store, "SYNCHRONOUS", "OFF")
        patch.setattr(os, "fsync", lambda _: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def surfaces(tmp_path_factory):
    """Surfaces that earlier code kept are not taken for those of this one."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checked, "cache_folder", lambda: folder)
        yield


@pytest.fixture(scope="session")
def epsmesh():
    """Call a command in this process: returns its exit code and what it wrote."""
    return commands.epsmesh


@pytest.fixture(scope="session")
def spawn():
    """Call a command in a process of its own, on ``ranks`` ranks: what a person at a prompt gets."""
    return commands.spawn


@pytest.fixture
def small(tmp_path):
    """A study of twelve small cases, in a folder of its own."""
    file = tmp_path / "small.toml"
    file.write_text(SMALL)
    return file


@pytest.fixture
def folding(monkeypatch):
    """Give deep probes the quarter-point elements of shallow ones, which fold."""
    monkeypatch.setattr(case, "_SHALLOW", inf)
