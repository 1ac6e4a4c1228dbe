"""Every command and every piece of Python in README and docs runs, in a folder laid out like a checkout."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from itertools import groupby
from pathlib import Path

import pytest

from epsmesh.report.dataset import write
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from epsmesh.study.starter import starter
from tests.docs.blocks import PYTHON, ROOT, blocks, missing, pages
from tests.report.synthetic import FIGURE, dataset
from tests.test_cli import ENVIRONMENT

# Most of the blocks of a page may not be exceptions.
_MOST_NOT_RUN = 0.5
_LONGEST = 240
# Of what figure3.toml sweeps, what the pages ask of its dataset.
_FEW = {
    "material": {"poisson": [0.30, 0.45]},
    "mesh": {"epsilon": ["5 mm", "10 mm", "full"], "outside": ["coarse", "free"]},
}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A folder like a checkout after ``make setup`` and a run of the quick study; nothing in it is the real one."""
    root = tmp_path_factory.mktemp("checkout")
    for name in ("studies", "notebooks", "meshes"):
        shutil.copytree(ROOT / name, root / name)
    (root / "Makefile").symlink_to(ROOT / "Makefile")
    commands = {
        ".venv/bin/epsmesh": f'exec "{sys.executable}" -m epsmesh "$@"',
        ".venv/bin/python": f'exec "{sys.executable}" "$@"',
        "scripts/setup.sh": ":",  # what runs the tests is set up
    }
    for name, text in commands.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"#!/bin/bash\n{text}\n")
        path.chmod(0o755)
    write(dataset(**FIGURE | _FEW), root / "results" / "figure3.nc")
    ran = shell(root, "epsmesh run studies/quick.toml --quiet")
    assert ran.returncode == 0, ran.stderr
    return root


def environment(root: Path) -> dict[str, str]:
    cache = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
    forms = os.environ.get("EPSMESH_CACHE", f"{cache}/epsmesh")
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return ENVIRONMENT | {
        "HOME": str(root), "XDG_CACHE_HOME": cache, "EPSMESH_CACHE": forms,
        "PATH": f"{root / '.venv' / 'bin'}:{os.environ['PATH']}", "PYTHONPATH": ":".join(paths), "MPLBACKEND": "Agg",
        "OMP_NUM_THREADS": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
    }  # fmt: skip


def shell(root: Path, text: str) -> subprocess.CompletedProcess[str]:
    command = ["/bin/bash", "-euo", "pipefail", "-c", text]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=root, env=environment(root),
                          stdin=subprocess.DEVNULL, timeout=_LONGEST)  # fmt: skip


def python(root: Path, text: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=False, cwd=root,
                          env=environment(root), stdin=subprocess.DEVNULL, timeout=_LONGEST)  # fmt: skip


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_blocks_of_a_page_run(page, checkout):
    """Python blocks without a command between them run in one process."""
    run = [block for block in blocks(page) if not block.why_not]
    session = ""  # what a reader has typed into Python so far
    for is_python, group in groupby(run, lambda block: block.language == PYTHON):
        together = list(group)
        if is_python:
            session += "".join(block.text for block in together)
            done = python(checkout, session)
            assert done.returncode == 0, f"{together[0]} and after\n{done.stdout}\n{done.stderr}"
            continue
        for block in together:
            done = shell(checkout, block.text)
            assert done.returncode == block.status, f"{block}\n{block.text}\n{done.stdout}\n{done.stderr}"
            absent = missing(block.expected, done.stdout + done.stderr)
            assert not absent, f"{block}: no line {absent!r} in\n{done.stdout}\n{done.stderr}"


_PIECES = [block for page in pages() for block in blocks(page, ("toml",))]


@pytest.mark.parametrize("block", _PIECES, ids=str)
def test_each_toml_block_is_a_study_or_says_which_study_it_is_a_part_of(block):
    """It is read in the folder of the project's own studies."""
    given = tomllib.loads(block.text)
    study = tomllib.loads(starter(block.part_of)) if block.part_of else {}
    for name, piece in given.items():
        whole = not isinstance(piece, dict) or "shape" in piece or "accuracy" in piece  # in place of sizes
        study[name] = piece if whole else {**study.get(name, {}), **piece}
    assert parse(study, file=str(ROOT / "studies" / "mine.toml")).shape
    if block.part_of:
        with pytest.raises(StudyError):
            parse(given, file=str(ROOT / "studies" / "mine.toml"))


def test_few_blocks_are_not_run_and_all_say_why():
    found = [block for page in pages() for block in blocks(page)]
    not_run = [block for block in found if block.why_not]
    assert len(found) > 20
    assert len(not_run) < _MOST_NOT_RUN * len(found)
    assert all(len(block.why_not) > 10 for block in not_run)


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_no_marker_is_lost(page):
    """A marker that stands above no block would be a block that runs otherwise than it seems."""
    text = page.read_text(encoding="utf-8")
    used = [line for line in text.splitlines() if line.startswith("<!-- test: ")]
    assert text.count("<!-- test: ") == len(used)
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if line.startswith("<!-- test: "):
            below = next(other for other in lines[number + 1 :] if not other.startswith("<!-- test: "))
            assert below.startswith("```"), f"{page}:{number + 1}: no block below"


def test_output_is_compared_in_order_with_room_for_what_varies():
    shown = "first 3 s\nsecond 4 s\n"
    assert missing(("first … s", "…", "second…"), shown) == ""
    assert missing(("second…", "first…"), shown) == "first…"
    assert missing(("third",), shown) == "third"


@pytest.mark.parametrize(
    "page", [*pages(), ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"], ids=lambda page: page.name
)
def test_links_lead_to_files_that_a_clone_has(page):
    """The reference is not among them: ``make docs`` writes it."""
    ignored = (ROOT / "docs" / "reference", ROOT / "docs" / "_build", ROOT / "results")
    for link in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
        if not link.startswith(("https://", "http://")):
            target = (page.parent / link).resolve()
            assert target.exists(), f"{page.name}: {link}"
            assert not any(target.is_relative_to(folder) for folder in ignored), f"{page.name}: {link}"
