"""What is installed: every library that is imported is declared, and the roads to an installation agree."""

import ast
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
# These come with Debian's or conda-forge's FEniCSx, or with the wheels of the extra `solver`.
FENICS = {"basix", "dolfinx", "dolfinx_solver", "ffcx", "gmsh", "petsc4py", "ufl"}
# Libraries that must match the system's MPI or numpy: conda installs them, not pip.
COMPILED = {"numpy", "scipy", "pandas", "xarray", "netcdf4", "matplotlib", "mpi4py"}


def name_of(requirement):
    return re.split(r"[<>=!~\[; ]", requirement, maxsplit=1)[0].lower().replace("_", "-")


REQUIRED = {name_of(one) for one in PROJECT["dependencies"]}
OPTIONAL = {name_of(one) for extra in ("solver", "images", "organs", "repair", "torch", "jax") for one in EXTRAS[extra]}
OPTIONAL -= {PROJECT["name"]}
# Distributions whose modules have other names.
MODULES = {
    "dolfinx-solver-real": {"dolfinx", "dolfinx_solver"},
    "libigl": {"igl"},
    "pillow": {"PIL"},
    "pynrrd": {"nrrd"},
}
# What builds the package, examples for other programs, and hints for what is missing.
ASIDE = ("epsmesh_realtime/setup.py", "epsmesh_realtime/wasm/", "epsmesh_realtime/c/examples/", "epsmesh/libraries.py")


def owner(name):
    """Return the distribution that has the module ``name``."""
    return next((one for one, modules in MODULES.items() if name in modules), name_of(name))


def named(node):
    """Return the modules that a statement imports, and texts that may name one for importlib."""
    if isinstance(node, ast.Import):
        return [alias.name.partition(".")[0] for alias in node.names], []
    if isinstance(node, ast.ImportFrom) and node.module and not node.level:
        return [node.module.partition(".")[0]], []
    return [], [node.value] if isinstance(node, ast.Constant) and isinstance(node.value, str) else []


def used(folder="."):
    """Return the modules that the sources import, each with a file that does, and all texts in them."""
    modules, texts = {}, set()
    for path in (ROOT / "pipeline" / folder).rglob("*.py"):
        if not path.relative_to(ROOT / "pipeline").as_posix().startswith(ASIDE):
            for node in ast.walk(ast.parse(path.read_text())):
                imported, said = named(node)
                modules |= dict.fromkeys(imported, path)
                texts |= set(said)
    own = {path.name for path in (ROOT / "pipeline").iterdir()}
    return {name: path for name, path in modules.items() if name not in sys.stdlib_module_names | own}, texts


def test_every_library_that_is_imported_is_declared():
    for name, path in used()[0].items():
        assert name in FENICS or owner(name) in REQUIRED | OPTIONAL, f"{path} imports {name}"


def test_every_library_that_is_declared_is_used():
    """Imported, or opened by its name: a program or a script that its distribution has."""
    modules, texts = used()
    assert {owner(name) for name in modules} | {name.lower() for name in texts} >= REQUIRED | OPTIONAL


def test_the_evaluator_needs_what_its_own_distribution_declares():
    project = tomllib.loads((ROOT / "pipeline" / "epsmesh_realtime" / "pyproject.toml").read_text())["project"]
    files = (ROOT / "pipeline" / "epsmesh_realtime").glob("*.py")
    # What builds it, and what it adds to the study program.
    files = [path for path in files if path.name not in ("setup.py", "extension.py")]
    nodes = [node for path in files for node in ast.walk(ast.parse(path.read_text()))]
    names = {name for node in nodes for name in named(node)[0]} - sys.stdlib_module_names - {"epsmesh_realtime"}
    optional = [one for listed in project["optional-dependencies"].values() for one in listed]
    assert names == {name_of(one) for one in [*project["dependencies"], *optional]}


def test_who_made_it_and_on_which_terms_is_told_alike():
    author = re.search(r"Copyright \(c\) \d+ (.*)", (ROOT / "LICENSE").read_text())[1]
    assert f'name: "{author}"' in (ROOT / "CITATION.cff").read_text()
    for folder in (ROOT, ROOT / "pipeline" / "epsmesh_realtime"):
        project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
        assert [one["name"] for one in project["authors"]] == [author]
        assert project["license"]["text"] == "MIT"
        assert "License :: OSI Approved :: MIT License" in project["classifiers"]
        assert (folder / "LICENSE").read_text() == (ROOT / "LICENSE").read_text()


def conda():
    """Return the names of conda's packages and of the extras that pip installs, in environment.yml."""
    lines = [line.split("#")[0].strip() for line in (ROOT / "environment.yml").read_text().splitlines()]
    names = {name_of(line[2:]) for line in lines if line.startswith("- ") and not line.endswith(":")}
    (extras,) = re.findall(r"-e \.\[(.*)\]", "\n".join(lines))
    return names, set(extras.split(","))


def test_the_environment_of_conda_agrees_with_the_project():
    names, extras = conda()
    assert names >= COMPILED | {"fenics-dolfinx", "petsc4py", "python-gmsh"}
    assert REQUIRED | {"mpi4py"} >= COMPILED
    assert "mpi4py" not in REQUIRED  # what solves nothing needs no MPI
    assert extras <= EXTRAS.keys() and "organs" in extras


def test_the_setup_of_debian_agrees_with_the_project():
    script = (ROOT / "scripts" / "setup.sh").read_text()
    for extras in re.findall(r"^ *extras=(\S+)$", script, re.MULTILINE):
        assert set(extras.split(",")) <= EXTRAS.keys()
    (remesher,) = re.findall(r"^mmg=(\S+)$", script, re.MULTILINE)
    assert remesher in EXTRAS["organs"]
