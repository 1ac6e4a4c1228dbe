"""What tests of the command line share: `epsmesh` in this process, `spawn` in one of its own, and a small study."""

import pytest

from tests import commands

SMALL = """
title = "small"
[body]
shape = "box"
size = ["20 mm", "20 mm", "10 mm"]
[material]
young = "10 kPa"
poisson = [0.3, 0.4]
[probe]
shape = "disc"
radius = "2 mm"
depth = "0.1 mm"
[mesh]
epsilon = ["4 mm", "6 mm", "full"]
fine = "2 mm"
coarse = "4 mm"
rim = "0.5 mm"
outside = ["coarse", "free"]
"""


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
