"""The page for contributors names every room of the sources."""

import re

import pytest

from tests.docs.blocks import ROOT

PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ROOMS = dict(re.findall(r"^\| (`pipeline/.*?) \| (.*?) \|", PAGE, re.MULTILINE))


def rooms():
    folders = [path.parent for path in (ROOT / "pipeline").glob("*/*/__init__.py")]
    return sorted(folder.relative_to(ROOT / "pipeline").as_posix() for folder in folders)


@pytest.mark.parametrize("room", rooms())
def test_every_room_has_a_row(room):
    package, name = room.split("/")
    if package == "epsmesh_identify":  # its own table
        assert re.search(rf"^\| .*`{name}/`.* \|", PAGE, re.MULTILINE)
    else:
        assert any(f"`pipeline/{package}/" in row and f"{name}/`" in row for row in ROOMS)


def test_every_row_is_of_what_exists():
    for row in ROOMS:
        first, *others = re.findall(r"`(.*?)`", row)
        base = (ROOT / first).parent if first.endswith("/") and first.count("/") > 2 else ROOT / first
        for place in (first, *others):
            places = (ROOT, base, ROOT / "pipeline" / "epsmesh", ROOT / "pipeline" / "epsmesh_realtime")
            assert any([*folder.glob(place.rstrip("/"))] for folder in places), f"no {place}"
