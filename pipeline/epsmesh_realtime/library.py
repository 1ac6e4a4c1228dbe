"""The evaluator in C as a shared library: the installed one, or one compiled from the sources of a checkout.

Its derivatives are a library of their own, in C++.
"""

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sysconfig
from contextlib import suppress
from ctypes import c_char_p, c_double, c_int, c_size_t, c_void_p
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import time
from typing import Any

_PACKAGE = Path(__file__).resolve().parent
_SOURCES = _PACKAGE / "c"
_COMPILERS = {"C": ("cc", "gcc", "clang"), "C++": ("c++", "g++", "clang++")}
# s: another process may be about to load a younger library of other sources.
_KEPT = 86400.0
# Sizes (bytes) of a query and of a touch, as `query.py` and `evaluator.py` pack them.
QUERY_SIZE, TOUCH_SIZE = 136, 56
_PLACE = (c_double, c_double)


class TouchInC(ctypes.Structure):
    """epsmesh_touch."""

    _fields_ = (("status", c_int), ("numbers", c_double * 6))


# Result and arguments of each function of epsmesh*.h.
_FUNCTIONS = {
    "epsmesh_load": (c_int, c_void_p, c_void_p, c_size_t),
    "epsmesh_flaw_of": (c_int, c_void_p, ctypes.POINTER(c_char_p)),
    "epsmesh_sizes": (None, ctypes.POINTER(c_size_t)),
    "epsmesh_word": (c_char_p, c_int),
    "epsmesh_foot": (c_int, c_void_p, c_void_p, c_void_p, c_void_p),
    "epsmesh_touch_each": (None, c_void_p, c_size_t, c_void_p, c_void_p),
    "epsmesh_touch_all": (None, c_void_p, c_int, c_void_p, c_void_p),
    "epsmesh_spot_at": (None, c_void_p, *_PLACE, c_void_p, c_void_p),
    "epsmesh_factors": (None, c_void_p, *_PLACE, c_void_p),
    "epsmesh_room_at": (c_double, c_void_p, *_PLACE),
    "epsmesh_place_at": (c_int, c_void_p, *_PLACE, c_double, c_void_p),
    "epsmesh_between": (None, c_void_p, c_double, c_size_t, c_void_p, c_size_t, c_void_p, c_void_p),
    "epsmesh_memory_begin": (None, c_void_p, c_void_p, c_size_t),
    "epsmesh_touch_after": (TouchInC, c_void_p, c_void_p, c_double, c_void_p),
    "epsmesh_touch_each_after": (None, c_void_p, c_size_t, c_void_p, c_void_p, c_void_p, c_void_p),
    "epsmesh_surface_far": (None, c_void_p, *_PLACE, c_double, c_void_p),
    "epsmesh_surface_press": (TouchInC, c_void_p, c_void_p, c_void_p, c_void_p),
    "epsmesh_patch_make_of": (c_int, c_void_p, c_void_p, c_void_p, c_double),
    "epsmesh_patch_deepest": (c_double, c_void_p),
    "epsmesh_patch_touch": (TouchInC, c_void_p, c_void_p, c_void_p, c_double),
    "epsmesh_patch_touch_each": (None, c_void_p, c_void_p, c_size_t, c_void_p, c_void_p, c_void_p),
    "epsmesh_path_load": (c_int, c_void_p, c_void_p, c_size_t),
    "epsmesh_path_flaw": (c_int, c_void_p, ctypes.POINTER(c_char_p)),
    "epsmesh_insertion_sizes": (None, ctypes.POINTER(c_size_t)),
    "epsmesh_insertion_begin": (None, c_void_p, c_void_p, c_double),
    "epsmesh_insertion_each": (None, c_void_p, c_void_p, c_size_t, c_void_p, c_void_p),
    "epsmesh_friction_sizes": (None, ctypes.POINTER(c_size_t)),
    "epsmesh_touch_rubbing_each": (None, c_void_p, c_size_t, c_void_p, c_double, c_void_p, c_void_p),
}


class BuildError(RuntimeError):
    """The evaluator is not built, and cannot be."""


@dataclass(frozen=True)
class _Part:
    """A library: ``name`` of its installed file, what compiles it, ``package`` and ``variable`` of a compiler."""

    name: str
    source: str
    language: str
    flags: tuple[str, ...]
    package: str
    variable: str
    what: str


_EVALUATOR = _Part("_evaluator", "epsmesh.c", "C", ("-std=c99", "-O2"), "gcc", "CC", "real-time models are evaluated")
_GRADIENT = _Part(
    "_gradient",
    "epsmesh_gradient.cpp",
    "C++",
    ("-std=c++11", "-O3"),
    "g++",
    "CXX",
    "derivatives of forces are computed",
)


@cache
def gradients() -> Any:
    """Return epsmesh_gradient of the derivatives' library.

    Raises:
        BuildError: as :func:`library`.
    """
    function = _opened(_GRADIENT).epsmesh_gradient
    function.restype = None
    function.argtypes = (c_void_p, c_size_t, c_void_p, c_void_p, c_size_t, c_void_p, c_void_p, c_void_p)
    return function


@cache
def library() -> ctypes.CDLL:
    """Return the evaluator with the types of its functions; a checkout's is compiled if its sources are new.

    Raises:
        BuildError: if there is neither a library nor a compiler, or if compiling or loading fails.
    """
    found = _opened(_EVALUATOR)
    for name, (result, *arguments) in _FUNCTIONS.items():
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    sizes = (c_size_t * 6)()
    found.epsmesh_sizes(sizes)
    if (sizes[1], sizes[2]) != (QUERY_SIZE, TOUCH_SIZE):
        raise BuildError("the evaluator in C is not the one of this package: install it again")
    return found


@cache
def size_of(number: int) -> int:
    """Return the size (bytes) of a model (0), a patch (3), a memory (4) or a moment of it (5)."""
    sizes = (c_size_t * 6)()
    library().epsmesh_sizes(sizes)
    return int(sizes[number])


def sources() -> Path:
    """Return the folder of the C sources, for a compiler's include path."""
    return _SOURCES


def source_files() -> list[Path]:
    """Return the text files in that folder, relative to it, without tests."""
    patterns, folder = ("*.[ch]", "*.cpp", "src/*.c", "examples/*", "fmu/*.c"), sources()
    found = (path for pattern in patterns for path in sorted(folder.glob(pattern)))
    return [
        path.relative_to(folder)
        for path in found
        if path.is_file() and path.suffix != ".epsm" and not path.name.startswith("test_")
    ]


def _is_checkout() -> bool:
    """Return whether the package is a checkout's: what is installed comes without the file that it is built by."""
    return (_PACKAGE / "pyproject.toml").is_file()


def _opened(part: _Part) -> ctypes.CDLL:
    path = _installed(part) or _built(part)
    try:
        return ctypes.CDLL(str(path))
    except OSError as problem:
        raise BuildError(f"the evaluator in {part.language} cannot be loaded: {problem}") from problem


def _installed(part: _Part) -> Path | None:
    """Return the library that `pip install` built; a checkout's sources take precedence, as they may be newer."""
    return None if _is_checkout() else next(iter(sorted(_PACKAGE.glob(f"{part.name}*"))), None)


def _built(part: _Part = _EVALUATOR) -> Path:
    """Return the library of the checkout's sources."""
    if not _is_checkout():
        raise BuildError(
            f"the evaluator in {part.language} is not part of this installation, since there was no {part.language} "
            "compiler: install it again, with one"
        )
    files = sorted([*_SOURCES.glob("epsmesh*.[ch]*"), *_SOURCES.glob("src/*.c")])
    compiler = _compiler(part)
    texts = b"\0".join([file.read_bytes() for file in files])
    name = hashlib.sha256(texts + repr((part, compiler)).encode()).hexdigest()[:16]
    # Several machines, and systems in containers, may share a checkout.
    machine = "-".join(filter(None, [sysconfig.get_platform(), *platform.libc_ver()]))
    kind = f"{Path(part.source).stem}-{machine}"
    path = _PACKAGE / ".built" / f"{kind}-{name}.so"
    if not path.exists():
        _compile(part, compiler, path)
        _remove_old(path.parent, f"{kind}-*.so")
    return path


def _remove_old(folder: Path, pattern: str) -> None:
    """Remove what earlier sources left; processes that have loaded such a library keep it."""
    for path in folder.glob(pattern):
        with suppress(OSError):
            if time() - path.stat().st_mtime > _KEPT:
                path.unlink()


def _compiler(part: _Part) -> list[str]:
    """Return the compiler's command, [] if there is none."""
    if asked := os.environ.get(part.variable):
        return shlex.split(asked)
    return next(([name] for name in _COMPILERS.get(part.language, ()) if shutil.which(name)), [])


def _compile(part: _Part, compiler: list[str], path: Path) -> None:
    if not compiler or not shutil.which(compiler[0]):
        raise BuildError(
            f"{part.what} in {part.language}, and there is no {part.language} compiler: install one (on Debian: "
            f"apt-get install {part.package}), or set {part.variable}"
        )
    try:
        path.parent.mkdir(exist_ok=True)
        with TemporaryDirectory(dir=path.parent) as folder:  # other processes see a complete file or none
            made = Path(folder) / "made.so"
            command = [*compiler, *part.flags, "-fPIC", "-shared", str(_SOURCES / part.source), "-o", str(made), "-lm"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                raise BuildError(
                    f"the evaluator in {part.language} does not compile: {' '.join(command)}\n{done.stderr.strip()}"
                )
            made.replace(path)
    except OSError as problem:
        raise BuildError(
            f"the evaluator in {part.language} cannot be built in {path.parent}: {problem.strerror}"
        ) from problem
