"""The compiled evaluator in the page is that of the C sources."""

import runpy
from pathlib import Path

from epsmesh_realtime.page.page import EVALUATOR

BUILD = runpy.run_path(str(Path(__file__).parents[2] / "pipeline" / "epsmesh_realtime" / "wasm" / "build.py"))


def test_the_page_has_the_evaluator_of_these_sources():
    made = EVALUATOR.read_bytes()
    assert BUILD["MADE"] == EVALUATOR
    assert made[:4] == b"\0asm"
    assert BUILD["hash_in"](made) == BUILD["hash_of_sources"](), "the C sources have changed: run `make wasm`"
