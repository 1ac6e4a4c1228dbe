"""What a release is called, everywhere."""

import re
import tomllib
from pathlib import Path

from epsmesh import __version__


def test_one_version_everywhere(epsmesh):
    done = epsmesh("--version")
    assert (done.exit_code, done.stdout.strip()) == (0, f"epsmesh {__version__}")
    assert re.fullmatch(r"\d+\.\d+\.\d+", __version__)
    for folder in (Path(), Path("pipeline/epsmesh_realtime")):
        assert tomllib.loads((folder / "pyproject.toml").read_text())["project"]["version"] == __version__
    assert f"\nversion: {__version__}\n" in Path("CITATION.cff").read_text()
    headings = re.findall(r"^## (.*)$", Path("CHANGELOG.md").read_text(), re.MULTILINE)
    released = [heading for heading in headings if heading != "Unreleased"]
    assert re.fullmatch(rf"{re.escape(__version__)} \((unreleased|20\d\d-\d\d-\d\d)\)", released[0])
