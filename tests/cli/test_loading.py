"""Each command loads what it needs: what another one, or another study, would need must not make it wait."""

import subprocess
import sys
from pathlib import Path

import pytest

from epsmesh.shapes.registry import BODIES, PROBES
from tests.commands import ENVIRONMENT, ROOT
from tests.studies import small_text

RUN = """
import sys
from epsmesh.__main__ import main
sys.argv = ["epsmesh", *sys.argv[1:]]
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""
# What nothing that answers at once needs: the figures' and the files' libraries, and the solvers.
_SLOW = {"dolfinx", "gmsh", "petsc4py", "mpi4py", "matplotlib", "xarray", "pandas", "netCDF4", "rich", "jinja2"}
# What a study of plain shapes, in units that people write, does without, too.
_ELSEWHERE = {"scipy", "pint", "sqlite3", "http", "asyncio"}


def loaded(*arguments: object, within: Path = ROOT) -> set[str]:
    """Return the modules that a command has loaded by its end, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", RUN, *map(str, arguments)], capture_output=True, text=True, check=True, cwd=within,
        env=ENVIRONMENT | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    return set(done.stderr.split())


def libraries(modules: set[str]) -> set[str]:
    return {module.partition(".")[0] for module in modules}


def shapes(modules: set[str]) -> set[str]:
    """Return the shapes of bodies and probes whose classes are among ``modules``."""
    of = {kind.__module__: shape for known in (BODIES, PROBES) for shape, kind in known.items()}
    return {of[module] for module in modules & set(of)}


@pytest.fixture
def study(tmp_path):
    file = tmp_path / "plain.toml"
    file.write_text(small_text())
    return file


def test_help_loads_no_study_no_plan_and_no_shape():
    modules = loaded("--help")
    assert not libraries(modules) & (_SLOW | _ELSEWHERE | {"pydantic", "psutil", "hashlib", "tomllib"})
    rooms = ("epsmesh.study.", "epsmesh.plan", "epsmesh.shapes", "epsmesh_identify.sections")
    assert {m for m in modules if m.startswith(rooms)} <= {
        "epsmesh.study.vocabulary", "epsmesh.study.named",
    }  # fmt: skip


@pytest.mark.parametrize("command", ["plan", "status"])
def test_a_study_loads_the_shapes_that_it_names_alone(command, study, tmp_path):
    modules = loaded(command, study, within=tmp_path)
    assert not libraries(modules) & (_SLOW | _ELSEWHERE - {"sqlite3"})
    # An export, which a plan tells the cost of, presses blades, too.
    assert shapes(modules) == {"box", "disc"} | ({"blade"} if command == "plan" else set())
    assert "epsmesh_identify" not in modules
    assert "psutil" not in modules or command == "plan"


def test_a_study_begun_like_another_computes_nothing(tmp_path):
    modules = loaded("new", "mine", "--like", ROOT / "studies" / "quick.toml", within=tmp_path)
    assert (tmp_path / "studies" / "mine.toml").exists()
    assert not libraries(modules) & (_SLOW | _ELSEWHERE)


def test_a_first_study_lists_every_shape_and_computes_nothing(tmp_path):
    modules = loaded("new", "mine", "--all", within=tmp_path)
    assert shapes(modules) == {*BODIES, *PROBES}
    assert not libraries(modules) & (_SLOW | _ELSEWHERE)
