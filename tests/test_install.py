"""What is installed: every library that is imported is declared, and the roads to an installation agree."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
# These come with Debian's or conda-forge's FEniCSx, and PyPI has no builds of them that fit.
FENICS = {"basix", "dolfinx", "ffcx", "gmsh", "petsc4py", "ufl"}
# Libraries that must match the system's MPI or numpy: conda installs them, not pip.
COMPILED = {"numpy", "scipy", "pandas", "xarray", "netcdf4", "matplotlib", "mpi4py"}


def name_of(requirement):
    return re.split(r"[<>=!~\[; ]", requirement, maxsplit=1)[0].lower().replace("_", "-")


REQUIRED = {name_of(one) for one in PROJECT["dependencies"]}
OPTIONAL = {name_of(one) for extra in ("images", "organs", "view", "repair") for one in EXTRAS[extra]}


def imported():
    """Return the top-level names that the package imports, with a file that does."""
    found = {}
    for path in (ROOT / "pipeline").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and node.module and not node.level else []
            found |= {name.partition(".")[0]: path for name in names}
    return {name: path for name, path in found.items() if name not in sys.stdlib_module_names | {"epsmesh"}}


def test_every_library_that_is_imported_is_declared():
    owners = packages_distributions()
    for name, path in imported().items():
        if name not in FENICS:
            known = {owner.lower().replace("_", "-") for owner in owners.get(name, [name])}
            # cffi and jinja2's markupsafe come with what needs them.
            assert known & (REQUIRED | OPTIONAL | {"markupsafe", "pydantic-core", "cffi"}), f"{path} imports {name}"


def conda():
    """Return the names of conda's packages and of the extras that pip installs, in environment.yml."""
    lines = [line.split("#")[0].strip() for line in (ROOT / "environment.yml").read_text().splitlines()]
    names = {name_of(line[2:]) for line in lines if line.startswith("- ") and not line.endswith(":")}
    (extras,) = re.findall(r"-e \.\[(.*)\]", "\n".join(lines))
    return names, set(extras.split(","))


def test_the_environment_of_conda_agrees_with_the_project():
    names, extras = conda()
    assert names >= COMPILED | {"fenics-dolfinx", "petsc4py", "python-gmsh"}
    assert REQUIRED >= COMPILED
    assert extras <= EXTRAS.keys() and "organs" in extras


def test_the_setup_of_debian_agrees_with_the_project():
    script = (ROOT / "scripts" / "setup.sh").read_text()
    for extras in re.findall(r"^ *extras=(\S+)$", script, re.MULTILINE):
        assert set(extras.split(",")) <= EXTRAS.keys()
    (remesher,) = re.findall(r"^mmg=(\S+)$", script, re.MULTILINE)
    assert remesher in EXTRAS["organs"]


def test_the_image_is_made_by_the_setup_of_debian():
    text = (ROOT / "Dockerfile").read_text()
    assert "FROM debian:12\n" in text
    assert [line for line in text.splitlines() if line.startswith("RUN")][-1] == "RUN make setup"
    # `make docker-steps` runs the RUN lines in a root of the same Debian.
    assert "DEBIAN_SUITE=bookworm STEPS=Dockerfile" in (ROOT / "Makefile").read_text()


@pytest.mark.parametrize("suite", ["12", "13", "sid"])
def test_the_hosted_ci_has_each_debian(suite):
    assert f'"{suite}"' in (ROOT / ".github" / "workflows" / "tests.yml").read_text()
