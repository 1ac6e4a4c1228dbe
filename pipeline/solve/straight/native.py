"""Code in C, compiled for this machine when first needed, and kept beside the compiled forms.

The compiler is the one that dolfinx compiles its forms with.
"""

import hashlib
import importlib.util
import sysconfig
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cffi
import numpy as np

from pipeline.solve.cache import form_cache
from pipeline.solve.compiled import quiet_compiler

_FLAGS = ("-O3", "-march=native")


class Library:
    """The functions that ``declarations`` declare, of a C file; compiled if they are not yet."""

    def __init__(self, source: Path, declarations: str):
        self._functions = _load(source.read_text(), declarations)
        self._kept: list[np.ndarray] = []

    def __call__(self, name: str, *arguments: Any) -> Any:
        """Call a function; arrays are passed as they are, and must be contiguous and of the declared type."""
        ffi = self._functions.ffi
        types = ffi.typeof(getattr(self._functions.lib, name)).args
        passed = [
            ffi.from_buffer(f"{kind.item.cname}[]", value) if isinstance(value, np.ndarray) else value
            for kind, value in zip(types, arguments, strict=True)
        ]
        return getattr(self._functions.lib, name)(*passed)

    def address(self, name: str) -> int:
        """Return where a function begins."""
        ffi, lib = self._functions.ffi, self._functions.lib
        return int(ffi.cast("uintptr_t", ffi.addressof(lib, name)))

    def set(self, name: str, values: np.ndarray) -> None:
        """Let a pointer point at ``values``, which are kept."""
        self._kept.append(values)
        setattr(self._functions.lib, name, self._functions.ffi.from_buffer("double[]", values))


def compiles(library: Callable[[], Library]) -> bool:
    """Tell whether the C of a ``library`` can be compiled here."""
    try:
        library()
    except Exception:  # distutils raises many kinds
        return False
    return True


@cache
def _load(code: str, declarations: str) -> Any:
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    name = "epsmesh_" + hashlib.sha256("".join((code, declarations, suffix, *_FLAGS)).encode()).hexdigest()[:16]
    path = form_cache() / f"{name}{suffix}"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=path.parent) as folder:  # others see nothing of it, or all
            builder = cffi.FFI()
            builder.cdef(declarations)
            builder.set_source(name, code, extra_compile_args=list(_FLAGS))
            with quiet_compiler():
                Path(builder.compile(tmpdir=folder)).replace(path)
    specification = importlib.util.spec_from_file_location(name, path)
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module
