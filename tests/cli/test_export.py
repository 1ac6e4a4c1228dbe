"""`epsmesh export` refuses what it has no model of, and says why, before anything is solved."""

import pytest

from tests.commands import epsmesh

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
        ("unilateral", (), '"unilateral" of a disc has no real-time model yet'),
        ("frictionless", ("--accuracy", "0.01%"), "must be between 0.2% and 20%"),
        ("frictionless", ("--accuracy", "fine"), "--accuracy fine"),
    ],
)
def test_what_cannot_be_exported_is_refused(tmp_path, contact, arguments, word):
    (tmp_path / "mine.toml").write_text(STUDY.format(contact=contact))
    ran = epsmesh("export", tmp_path / "mine.toml", "-o", tmp_path / "model.nc", *arguments)
    assert ran.exit_code == 2
    assert word in ran.stderr
    assert not list(tmp_path.rglob("*.nc"))
