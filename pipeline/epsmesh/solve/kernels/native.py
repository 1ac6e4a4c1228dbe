"""The C code of this folder, compiled into one library for this machine at its first use.

The compiler is that of dolfinx's forms; the library is cached beside them.
"""

import hashlib
import importlib.util
import os
import shlex
import shutil
import sys
import sysconfig
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cffi
import numpy as np
import numpy.typing as npt

from epsmesh.solve import CompilerError
from epsmesh.solve.compiled import form_cache, quiet_compiler

# Vectors of the multigrid cycle and of products in single precision.
Single = npt.NDArray[np.float32]

_FLAGS = ("-O3", "-march=native", "-fvisibility=hidden")
_FOLDER = Path(__file__).parent
# Types of numpy by those of C.
_TYPES = {"double": "float64", "float": "float32", "int": "int32", "uint8_t": "uint8", "uint64_t": "uint64"}
_PRECISIONS = {np.dtype(name): name for name in ("float32", "float64")}


def call(name: str, *arguments: Any) -> Any:
    """Call a C function; arrays are passed without copies.

    Raises:
        TypeError: if an array is not of the declared type.
        ValueError: if it is not contiguous.
    """
    function, of_array, kinds = _function(name)
    passed = []
    for kind, value in zip(kinds, arguments, strict=True):  # a case makes a thousand calls: nothing more than needed
        if isinstance(value, np.ndarray):
            if kind is None or (value.dtype is not kind[1] and value.dtype != kind[1]):
                raise _other_type(name, kind, value)
            # From its bytes alone, cffi would take an array of any type.
            passed.append(of_array(kind[0], value))
        else:
            passed.append(value)
    return function(*passed)


def _other_type(name: str, kind: tuple[Any, np.dtype] | None, values: np.ndarray) -> TypeError:
    expected = "a number" if kind is None else f"an array of {kind[1]}"
    return TypeError(f"{name} in C takes {expected}, not an array of {values.dtype}")


def precision(values: np.ndarray) -> str:
    """Return the name of the type of ``values``, "float32" or "float64"; numpy takes 10 µs to write it."""
    return _PRECISIONS[values.dtype]


@cache
def _function(name: str) -> tuple[Any, Any, tuple[Any, ...]]:
    """Return a C function, the conversion of arrays, and the array types of each parameter, None for numbers."""
    module = library()
    function, ffi = getattr(module.lib, name), module.ffi
    kinds = ffi.typeof(function).args
    arrays = tuple(
        (ffi.typeof(f"{kind.item.cname}[]"), np.dtype(_TYPES[kind.item.cname])) if kind.kind == "pointer" else None
        for kind in kinds
    )
    return function, ffi.from_buffer, arrays


def address(name: str) -> int:
    """Return the address of a C function."""
    module = library()
    return int(module.ffi.cast("uintptr_t", module.ffi.addressof(module.lib, name)))


def point_at(name: str, values: np.ndarray) -> None:
    """Point a C pointer of the library at ``values``, which the caller must keep alive."""
    module = library()
    if values.dtype != np.dtype(float):
        raise _other_type(name, (None, np.dtype(float)), values)
    setattr(module.lib, name, module.ffi.from_buffer("double[]", values))


@cache
def library() -> Any:
    """Return the compiled module; it is compiled if the cache does not have it.

    Raises:
        CompilerError: if compilation fails.
    """
    header, sources = _FOLDER / "kernels.h", sorted(_FOLDER.glob("*.c"))
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    texts = [file.read_text() for file in sorted(_FOLDER.glob("*.[ch]"))]
    name = "epsmesh_" + hashlib.sha256("".join((*texts, suffix, *_FLAGS)).encode()).hexdigest()[:16]
    path = form_cache() / f"{name}{suffix}"
    if not path.exists():
        _compile(name, path, header, sources)
    specification = importlib.util.spec_from_file_location(name, path)
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def _compile(name: str, path: Path, header: Path, sources: list[Path]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    builder = cffi.FFI()
    builder.cdef(header.read_text())
    builder.set_source(
        name,
        '#include "kernels.h"',
        sources=[str(source) for source in sources],
        include_dirs=[str(_FOLDER)],
        extra_compile_args=list(_FLAGS),
    )
    with TemporaryDirectory(dir=path.parent) as folder, quiet_compiler():  # other processes see a complete file or none
        try:
            made = Path(builder.compile(tmpdir=folder))
        except Exception as error:  # distutils raises many kinds
            raise CompilerError(_why_not(error)) from error
        made.replace(path)


def _why_not(error: Exception) -> str:
    """Say why nothing compiles here, and the way out: kernels and forms are compiled when first used."""
    compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")[0]
    if shutil.which(compiler) is None:
        return (
            f"no C compiler: {compiler} is not on PATH, and solvers are compiled at their first use; "
            "install gcc (Debian: `apt-get install gcc`; conda: `conda install compilers`), or set CC"
        )
    include = Path(sysconfig.get_path("include"))
    if not (include / "Python.h").exists():
        version = f"python{sys.version_info.major}.{sys.version_info.minor}-dev"
        return f"Python.h is not in {include}, and solvers are compiled at their first use; install {version}"
    return (
        f"the C code of epsmesh does not compile ({error}): dolfinx needs a working C compiler, too; "
        "install one, or set CC"
    )
