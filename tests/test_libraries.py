"""A library that is missing, or does not load, is told in one sentence with the way out on this system."""

from dataclasses import replace

import pytest

from epsmesh import libraries
from epsmesh.launcher import LauncherError, check_protocol, check_size
from epsmesh.libraries import System, sentence_on, solver_on

WHEELS = System("Linux", "x86_64", (3, 12), (2, 36), True, is_debian=False, is_root=False, is_checkout=False)
DEBIAN = replace(WHEELS, python=(3, 11), is_debian=True, is_root=True, is_checkout=True)


@pytest.mark.parametrize(
    ("system", "remedy"),
    [
        (WHEELS, "`pip install 'epsmesh[solver]'` installs it"),
        (replace(WHEELS, is_checkout=True), "`pip install '.[solver]'` in the project's folder"),
        (replace(WHEELS, python=(3, 11)), "need Python ≥ 3.12, and this is 3.11"),
        (replace(WHEELS, glibc=(2, 31)), "glibc ≥ 2.34"),
        (replace(WHEELS, glibc=None), "environment.yml"),
        (replace(WHEELS, machine="aarch64"), "environment.yml"),
        (replace(WHEELS, name="Darwin", glibc=None), "environment.yml` in the project's folder installs it on Darwin"),
        (replace(WHEELS, name="Windows", glibc=None), "on Windows"),
        (replace(WHEELS, is_64_bit=False), "none for 32 bits"),
        (DEBIAN, "`make setup` in the project's folder installs it"),
        (replace(DEBIAN, is_root=False), "administrator"),
        (replace(DEBIAN, python=(3, 13), is_root=False), "pip install '.[solver]'"),
        (replace(DEBIAN, python=(3, 13), is_checkout=False), "pip install 'epsmesh[solver]'"),
    ],
)
def test_each_system_has_its_line(system, remedy):
    said = solver_on(system)
    assert remedy in said and said.count(". ") == 0


@pytest.mark.parametrize(
    ("wrong", "remedy"),
    [
        (ImportError("/lib/libc.so.6: version `GLIBC_2.38' not found", name="gmsh"), "glibc or libstdc++ 2.38"),
        (ImportError("libmpi.so.12: cannot open shared object file", name="petsc4py"), "petsc4py does not load"),
        (ModuleNotFoundError("", name="dolfinx.fem"), "the Python library dolfinx is missing"),
        (ModuleNotFoundError("", name="pymeshfix"), "[repair]"),
        (ModuleNotFoundError("", name="epsmesh.nothing"), ""),
        (ImportError("cannot import name 'x'", name="numpy"), ""),
        (OSError("libGL.so.1: cannot open shared object file: No such file or directory"), "no libGL.so.1: "),
        (OSError("libepsmesh.so: cannot open shared object file: No such file or directory"), ""),
    ],
)
def test_each_fault_has_its_sentence(wrong, remedy):
    said = sentence_on(wrong)
    assert remedy in said and bool(said) == bool(remedy)


def test_a_second_petsc_beside_the_wheels_is_told_with_what_to_uninstall(monkeypatch):
    monkeypatch.setattr(libraries.importlib.util, "find_spec", lambda _: object())
    said = sentence_on(ImportError("petsc, petsc4py are installed in this environment. Uninstall petsc petsc4py"))
    assert "a second PETSc" in said and "pip uninstall petsc petsc4py slepc slepc4py" in said


@pytest.mark.parametrize("environment", [{"OMPI_COMM_WORLD_SIZE": "2", "PMIX_RANK": "0"}, {"PMIX_RANK": "1"}])
def test_a_launcher_that_aborts_the_mpi_of_the_wheels_is_refused_before_it_is_loaded(environment):
    with pytest.raises(LauncherError, match="have MPICH: use `"):
        check_protocol(environment)


@pytest.mark.parametrize("environment", [{"PMI_SIZE": "2", "PMI_RANK": "0"}, {"PMIX_RANK": "1"}])
def test_ranks_that_do_not_see_each_other_are_refused(environment):
    """MPICH's mpiexec with Debian's Open MPI: each process is alone, and would write the same files."""
    with pytest.raises(LauncherError, match="takes each for a run of its own"):
        check_size(1, "Open MPI", environment)


@pytest.mark.parametrize(
    ("size", "environment"),
    [
        (1, {}),
        (1, {"PMI_SIZE": "1", "PMI_RANK": "0"}),
        (2, {"PMI_SIZE": "2", "PMI_RANK": "1", "MPI_LOCALNRANKS": "2"}),
        (1, {"SLURM_NTASKS": "4", "SLURM_PROCID": "3"}),
    ],
)
def test_ranks_that_see_each_other_are_not(size, environment):
    check_protocol(environment)
    check_size(size, "MPICH", environment)
