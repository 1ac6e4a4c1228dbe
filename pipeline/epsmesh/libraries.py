"""A sentence for a library that is missing or does not load, with the way out on this system. Imports no library."""

import importlib.util
import os
import platform
import re
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

# What meshes and solves: Debian's packages, conda-forge's, or the wheels of the extra `solver`.
SOLVER = ("dolfinx", "dolfinx_solver", "ufl", "basix", "ffcx", "petsc4py", "mpi4py", "gmsh")
_ORGANS = ("igl", "nibabel", "nrrd", "pydicom", "mmgpy")
_EXTRAS = dict.fromkeys(SOLVER, "solver") | dict.fromkeys(_ORGANS, "organs") | {"pymeshfix": "repair"}
# What the wheels were built for.
_PYTHON, _GLIBC, _MACHINE = (3, 12), (2, 34), "x86_64"
_BITS = 2**32
_CONDA = "`conda env create -f environment.yml`"
_DEBIAN = "`make setup` in the project's folder"
_NEEDS = "glibc ≥ {}.{}, Python ≥ {}.{}, {}".format(*_GLIBC, *_PYTHON, _MACHINE)
# Without these in one environment, the wheel's PETSc is the only one.
_SECOND = ("petsc", "petsc4py", "slepc", "slepc4py")
_WHEEL = "dolfinx-solver-real"
# What the wheel of gmsh links to, in Debian's and Ubuntu's names.
_DRAWING = "libgl1 libglu1-mesa libgomp1 libxcursor1 libxft2 libxinerama1"


@dataclass(frozen=True)
class System:
    """What decides how libraries can be installed."""

    name: str
    machine: str
    python: tuple[int, int]
    glibc: tuple[int, int] | None
    is_64_bit: bool
    is_debian: bool  # with this Python being Debian's own, which its packages are for
    is_root: bool  # or could be
    is_checkout: bool  # the program is run from its project's folder

    @staticmethod
    def here() -> "System":
        """Return that of this process."""
        library, version = platform.libc_ver()
        numbers = [int(part) for part in re.findall(r"\d+", version)[:2]]
        return System(
            name=platform.system(),
            machine=platform.machine(),
            python=(sys.version_info.major, sys.version_info.minor),
            glibc=(numbers[0], numbers[1]) if library == "glibc" and len(numbers) > 1 else None,
            is_64_bit=sys.maxsize > _BITS,
            is_debian=Path("/etc/debian_version").exists() and sys.base_prefix == "/usr",
            is_root=getattr(os, "geteuid", lambda: 1)() == 0 or shutil.which("sudo") is not None,
            is_checkout=Path(__file__).parents[2].joinpath("pyproject.toml").exists(),
        )

    @property
    def has_wheels(self) -> bool:
        """Whether the solver's wheels run here."""
        is_linux = self.name == "Linux" and self.machine == _MACHINE and self.is_64_bit
        return is_linux and self.python >= _PYTHON and self.glibc is not None and self.glibc >= _GLIBC

    def pip(self, extra: str = "") -> str:
        """Return pip's command for an extra: of the project's folder, or of what is installed."""
        extra = f"[{extra}]" if extra else ""
        if self.is_checkout:
            return f"`pip install '.{extra}'` in the project's folder"
        return f"`pip install 'epsmesh{extra}'`"


def solver_on(system: System) -> str:
    """Return how the solver is installed on a system: one sentence, without its beginning."""
    if not system.is_64_bit:
        return f"there is none for 32 bits: install a 64-bit Python, then {_CONDA}"
    if system.name != "Linux":
        return f"{_CONDA} in the project's folder installs it on {system.name or 'this system'}"
    # A program in a venv of its own does not see Debian's packages.
    if system.is_debian and system.is_root and (system.is_checkout or not system.has_wheels):
        return f"{_DEBIAN} installs it"
    if system.has_wheels:
        return f"{system.pip('solver')} installs it"
    if system.machine != _MACHINE or system.glibc is None or system.glibc < _GLIBC:
        return f"its wheels need {_NEEDS}: here {_CONDA} in the project's folder installs it"
    found = "{}.{}".format(*system.python)
    other = f"ask an administrator for {_DEBIAN}" if system.is_debian else f"use {_CONDA}"
    return f"its wheels need Python ≥ 3.12, and this is {found}: make a virtual environment of a newer one, or {other}"


def sentence_on(wrong: ImportError | OSError) -> str:
    """Return a sentence on a library that is missing or does not load, "" if it is none, or no fault of one."""
    if isinstance(wrong, OSError):
        return _on_drawing(str(wrong))
    library, _, _ = (wrong.name or "").partition(".")
    if library == "epsmesh" or (not library and isinstance(wrong, ModuleNotFoundError)):
        return ""
    system = System.here()
    if isinstance(wrong, ModuleNotFoundError):
        extra = _EXTRAS.get(library, "")
        if extra == "solver":
            return f"the Python library {library} is missing: {solver_on(system)}"
        return f"the Python library {library} is missing: {system.pip(extra)} installs it"
    return _on_unloaded(str(wrong), library, system)


def _on_drawing(message: str) -> str:
    """Return a sentence on a system's library that gmsh links to, and that is missing; "" if it is none."""
    missing = re.match(r"(lib(?:GL|X|OpenGL|fontconfig|freetype|gomp)\S*): cannot open shared object file", message)
    if missing is None:
        return ""
    debian = f"an administrator installs it and others by `apt-get install {_DRAWING}`"
    other = f"install it, or use {_CONDA} in the project's folder, without root"
    return f"gmsh does not load, since the system has no {missing[1]}: {debian if shutil.which('apt-get') else other}"


def _on_unloaded(message: str, library: str, system: System) -> str:
    """Return a sentence on a library that is installed and does not load, "" if that has another reason."""
    if newer := re.search(r"GLIBC(?:XX)?_([\d.]+)'? not found", message):
        return (
            f"{library or 'a library'} needs a newer system (glibc or libstdc++ {newer[1]}): use a newer Linux, "
            f"or {_CONDA} in the project's folder"
        )
    if importlib.util.find_spec("dolfinx_solver") is not None and "petsc4py" in message and "ninstall" in message:
        names = " ".join(_SECOND)
        return (
            "a second PETSc is in this environment, beside that of the wheels: "
            f"`pip uninstall {names}`, then `pip install --force-reinstall --no-deps {_WHEEL}`"
        )
    if "cannot open shared object file" in message and (library in SOLVER or "mpi" in message or "petsc" in message):
        return f"{library or 'the solver'} does not load ({message.splitlines()[0]}): {solver_on(system)}"
    return ""
