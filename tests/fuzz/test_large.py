"""Files of 100 MB that are no studies, surfaces, datasets, stores or models: refused, within a gigabyte of memory."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from epsmesh_realtime.file import VERSION
from tests.commands import ENVIRONMENT, ROOT
from tests.fuzz.conftest import MOST_MEMORY
from tests.fuzz.profile import IS_CAMPAIGN

SIZE = 100_000_000  # bytes
# What would end the machine ends the process first: bytes.
_LIMIT = 6 << 30
_READERS = {
    "study": "from epsmesh.study.read import read_study; read_study(Path(sys.argv[1]))",
    "surface": "from epsmesh.shapes.files.read import read_surface; read_surface(Path(sys.argv[1]), 1e-3)",
    "step": "from epsmesh.shapes.files.step import entities_of; entities_of(Path(sys.argv[1]).read_bytes())",
    "dataset": "from epsmesh.report.read import read; read(Path(sys.argv[1]))",
    "store": "from epsmesh.run.reading import read_rows; read_rows(Path(sys.argv[1]))",
    "model": "from epsmesh_realtime import read; read(sys.argv[1])",
}
_READ = r"""
import re, resource, sys
from pathlib import Path
resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}))
try:
    {read}
except Exception as refused:
    print(type(refused).__name__, refused)
# The peak of this program alone: what getrusage tells begins with the process that it was forked from.
print(re.search(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text())[1])
"""
_FACETS = ((SIZE - 84) // 50).to_bytes(4, "little")
_STL = b" facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 0 1 0\n  endloop\n endfacet\n"
_POINT = b"#1=CARTESIAN_POINT('',(0.,0.,1.E1));\n"
_PLY = b"""ply\nformat ascii 1.0\nelement vertex 6000000\nproperty float x\nproperty float y\nproperty float z
element face 1\nproperty list uchar int vertex_indices\nend_header\n"""


def sparse(head: bytes) -> Callable[[Path], None]:
    """Return what writes a beginning, and zeros, which take no room on the disk."""

    def write(path: Path) -> None:
        path.write_bytes(head)
        os.truncate(path, SIZE)

    return write


def repeated(head: bytes, unit: bytes, end: bytes = b"") -> Callable[[Path], None]:
    """Return what writes a beginning, and the same again and again."""

    def write(path: Path) -> None:
        path.write_bytes(head + unit * (SIZE // len(unit)) + end)

    return write


def noise(path: Path) -> None:
    path.write_bytes(bytes(80) + _FACETS + os.urandom(50 * int.from_bytes(_FACETS, "little")))


# By name of the file: who reads it, what writes it, what is said of it.
LARGE = {
    "zeros.toml": ("study", sparse(b""), "is larger than 1 MB"),
    "zeros.nc": ("dataset", sparse(b"\x89HDF\r\n\x1a\n"), "cannot be read as netCDF"),
    "zeros.sqlite": ("store", sparse(b"SQLite format 3\0"), "file is not a database"),
    "zeros.epsm": ("model", sparse(b"epsmesh\0" + bytes([VERSION, 0, 0, 0, 4, 3, 2, 1])), "is cut short"),
    "text.step": ("step", sparse(b"ISO-10303-21;\nDATA;\n#1=A('"), "is truncated"),
}
LONGER = {
    "zeros.stl": ("surface", sparse(bytes(80) + _FACETS), "is 0 mm across"),
    "noise.stl": ("surface", noise, "points are not finite"),
    "text.stl": ("surface", repeated(b"solid a\n", _STL), "truncated"),
    "text.ply": ("surface", repeated(_PLY, b"0.1 0.25 0.3 \n"), "which is not an integer"),
    "facets.obj": ("surface", repeated(b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", b"f 1 2 3\n"), "12,500,000 facets, more than"),
    "points.step": ("step", repeated(b"ISO-10303-21;\nDATA;\n", _POINT, b"ENDSEC;\n"), "truncated"),
}  # fmt: skip


@pytest.mark.parametrize("name", [*LARGE, *(LONGER if IS_CAMPAIGN else ())])
def test_a_large_file_is_refused_within_a_gigabyte(name, tmp_path):
    kind, write, message = {**LARGE, **LONGER}[name]
    write(tmp_path / name)
    code = _READ.format(limit=_LIMIT, read=_READERS[kind])
    reader = subprocess.run(
        [sys.executable, "-c", code, tmp_path / name], cwd=ROOT, env=ENVIRONMENT | {"PYTHONPATH": str(ROOT)},
        text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
    )  # fmt: skip
    (tmp_path / name).unlink()
    assert reader.returncode == 0, reader.stdout
    said, peak = reader.stdout.splitlines()
    assert message in said
    assert "Error" in said.split()[0]
    assert "MemoryError" not in said
    assert 1024 * int(peak) < MOST_MEMORY
