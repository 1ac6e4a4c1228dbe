"""The compiled evaluator in the page is that of the C sources."""

import runpy
import shutil
import subprocess
from pathlib import Path

import pytest

from epsmesh_realtime.page.page import EVALUATOR

BUILD = runpy.run_path(str(Path(__file__).parents[2] / "pipeline" / "epsmesh_realtime" / "wasm" / "build.py"))


def test_the_page_has_the_evaluator_of_these_sources():
    made = EVALUATOR.read_bytes()
    assert BUILD["MADE"] == EVALUATOR
    assert made[:4] == b"\0asm"
    assert BUILD["hash_in"](made) == BUILD["hash_of_sources"](), "the C sources have changed: run `make wasm`"


def test_the_compiler_that_made_it_makes_it_again():
    clang = shutil.which("clang-14")
    if clang is None or shutil.which("wasm-ld-14") is None:
        pytest.skip("clang-14 and lld-14 are not installed")
    assert "version 14." in subprocess.run([clang, "--version"], capture_output=True, text=True, check=True).stdout
    assert BUILD["build"](clang) == EVALUATOR.read_bytes()
