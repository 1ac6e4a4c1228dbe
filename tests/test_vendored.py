"""JavaScript of others is that of the packages on record, with its licence, and unchanged."""

import hashlib
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
RECORD = tomllib.loads((ROOT / "scripts" / "vendored.toml").read_text(encoding="utf-8"))
FOLDERS = sorted({entry["folder"] for entry in RECORD["vendored"]})


@pytest.mark.parametrize("folder", FOLDERS)
def test_vendored_files_are_those_on_record_and_name_their_origin(folder):
    own = {"README.md", *(name for entry in RECORD["vendored"] for name in entry.get("bundle", {}))}
    sums = {path: value for path, value in RECORD["sha256"].items() if Path(path).parent == Path(folder)}
    assert {Path(path).name for path in sums} == {path.name for path in (ROOT / folder).iterdir()} - own
    for path, value in sums.items():
        assert hashlib.sha256((ROOT / path).read_bytes()).hexdigest() == value, f"{path}: run `make vendored`"
    origin = (ROOT / folder / "README.md").read_text()
    for entry in RECORD["vendored"]:
        assert re.fullmatch(r"sha512-[A-Za-z0-9+/]{86}==", entry["integrity"])
        if entry["folder"] == folder:
            assert entry["package"] in origin
            assert entry["licence"] == "MIT"
    assert [path for path in sums if Path(path).name.startswith("LICENSE-")]


def test_no_minified_script_is_elsewhere():
    kept = subprocess.run(["git", "ls-files", "*.js", "*.css"], cwd=ROOT, capture_output=True, text=True, check=False)
    if kept.returncode:
        pytest.skip("not a checkout")
    for name in kept.stdout.split():
        if name not in RECORD["sha256"]:
            assert max(map(len, (ROOT / name).read_text(encoding="utf-8").splitlines())) < 400, name
