"""A cache of meshes on disk, keyed by their inputs; its size is bounded, and the least recently used go first."""

import os
import time
from collections.abc import Callable
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from epsmesh.compat import versions
from epsmesh.files import atomic
from epsmesh.mesh.generate import MeshArrays
from epsmesh.npz import read_npz
from epsmesh.plan.key import digest, mesh_key
from epsmesh.stages import stage
from epsmesh.study.case import Case

# Raise by hand when the same input gives another mesh.
MESH_VERSION = 14
LIMIT = 2_000_000_000  # bytes


class MeshCache:
    """Meshes in a folder, used by one process of a run. Two runs may share a folder, because files appear whole."""

    def __init__(self, folder: Path, limit: float = LIMIT):
        self._folder, self._limit = folder, limit

    def path(self, case: Case, mirrors: tuple[str, ...], *, is_coarse: bool = False) -> Path:
        """Return the file of a case's mesh, of the part bounded by the planes ``mirrors``.

        A mesh that is to be refined, ``is_coarse``, has a file of its own: where that fails, gmsh makes the fine one.
        """
        coarse = ["coarse"] if is_coarse else []
        key = digest(" ".join([str(MESH_VERSION), versions()["gmsh"], mesh_key(case), str(mirrors), *coarse]))
        return self._folder / f"{key}.npz"

    @stage("mesh cache")
    def get(self, path: Path) -> MeshArrays | None:
        """Return the mesh in ``path``, None if it is absent or unreadable."""
        content = _read(path)
        if content is None:
            return None
        facets = {name.removeprefix("facets_"): content[name] for name in content if name.startswith("facets_")}
        return MeshArrays(
            content["points"],
            content["cells"],
            facets,
            content["rim"],
            float(content["seconds"]),
            content.get("regions"),
            deviation=float(content["deviation"]),
        )

    @stage("mesh cache")
    def put(self, path: Path, mesh: MeshArrays) -> None:
        """Store a mesh. If the disk is full, it is not stored, and the run continues."""
        arrays: dict[str, Any] = {f"facets_{name}": value for name, value in mesh.facets.items()}
        if mesh.regions is not None:
            arrays["regions"] = mesh.regions
        own = {"points": mesh.points, "cells": mesh.cells, "rim": mesh.rim, "seconds": np.float64(mesh.seconds)}
        own |= {"deviation": np.float64(mesh.deviation)}
        self._keep(path, arrays | own)

    @stage("mesh cache")
    def arrays(self, key: str, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Return the arrays stored under ``key``; if there are none, store and return the result of ``make``."""
        path = self._folder / f"{digest(key)}.npz"
        found = _read(path)
        if found is None:
            found = make()
            self._keep(path, found)
        return found

    def _keep(self, path: Path, arrays: dict[str, Any]) -> None:
        """Write arrays to a file, if it can be written."""
        packed = BytesIO()  # of a disk that fills meanwhile zipfile would complain on standard error
        np.savez(packed, **arrays)
        with suppress(OSError):
            with atomic(path) as temporary:
                temporary.write_bytes(packed.getbuffer())
                _touch(temporary)
            self._shrink()

    def _shrink(self) -> None:
        """Remove the least recently used files until the rest is within the limit."""
        files = sorted(((f.stat().st_mtime, f.stat().st_size, f) for f in self._folder.glob("*.npz")), reverse=True)
        total = 0
        for _, size, file in files:
            total += size
            if total > self._limit:
                file.unlink(missing_ok=True)


def _read(path: Path) -> dict[str, Any] | None:
    """Return the arrays in a file, and mark it as used; None if it is absent or unreadable."""
    try:
        found = read_npz(path)
        _touch(path)
        return found
    except (OSError, ValueError):
        return None


def _touch(path: Path) -> None:
    """Mark a file as used now, by a clock finer than that of some file systems."""
    now = time.time_ns()
    os.utime(path, ns=(now, now))
