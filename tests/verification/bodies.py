"""Bodies of other shapes: ellipsoids against the meridian and the half-space, and bodies from files."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import gmsh
from mpi4py import MPI

from epsmesh import compat
from epsmesh.verify import Row
from tests.verification import known
from tests.verification.compare import against, against_meridian, solve
from tests.verification.sections import Section, box, disc, mm, tissue
from tests.verification.star import directions, star_file

# Semi-axes (mm) of a round and a general ellipsoid; height below which they are fixed; number of points of a file.
_ROUND, _AXES, _BELOW, _POINTS = (60.0, 60.0, 45.0), (60.0, 45.0, 30.0), -10.0, 7000
_BALL, _CURVED = 1e6, 1e-5  # radius of a ball in radii of the disc; relative effect of its curvature on F
_BOX = (60.0, 60.0, 20.0)


def body_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of ellipsoids and of bodies from files; ``quick`` yields a few; collective."""
    yield from _balls(comm, quick)
    yield from _ellipsoids(comm, quick)
    if not quick:
        yield from _files(comm)


def _balls(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """A ball so large that its surface is plane near the disc."""
    for contact in ("frictionless",) if quick else ("frictionless", "bonded"):
        force, source = known.half_space_disc(10e3, 0.3, 1e-3, 1e-5, contact)
        scene = _scene(_ellipsoid((_BALL,) * 3, 0.0), disc(1, contact=contact))
        yield against(comm, f"ball of a million radii, disc, {contact}, ν = 0.3", "2D", (force, source, _CURVED), scene)


def _ellipsoids(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Ellipsoids of revolution in three dimensions; the reference is the same scene in two."""
    for contact, nu in (("bonded", 0.3),) if quick else (("bonded", 0.3), ("frictionless", 0.3), ("frictionless", 0.5)):
        scene = _scene(_ellipsoid(_ROUND), disc(8, contact=contact), nu)
        yield against_meridian(comm, f"ellipsoid 4:4:3, a = 8 mm, {contact}, ν = {nu:g}", scene)


def _files(comm: MPI.Comm) -> Iterator[Row]:
    """Bodies from files; the reference is the same body declared in the study."""
    with TemporaryDirectory(prefix="epsmesh-bodies-") as own:
        folder = Path(comm.bcast(own))
        if comm.rank == 0:
            (folder / "ellipsoid.stl").write_bytes(star_file(directions(_POINTS) * _AXES))
            _draw_box(folder / "box.step")
        comm.barrier()
        held = {"unit": "mm", "fixed": {"below": mm(_BELOW)}}
        step: Section = {"shape": "cad", "file": str(folder / "box.step"), **held}
        surface: Section = {"shape": "surface", "file": str(folder / "ellipsoid.stl"), **held}
        native = box(*_BOX) | {"fixed": held["fixed"]}
        for name, file, declared, radius in (
            ("box, STEP file", step, native, 2.0),
            ("ellipsoid 60 × 45 × 30 mm, STL file", surface, _ellipsoid(_AXES), 8.0),
        ):
            probe = disc(radius)
            force, bar, message = solve(comm, "3D", _scene(declared, probe))
            truth = force, f"body declared, bar {bar:.0e} {message}".strip(), bar
            yield against(comm, f"{name}, bonded, ν = 0.3", "3D", truth, _scene(file, probe))
        comm.barrier()


def _draw_box(path: Path) -> None:
    with _mute(), compat.gmsh_session():
        gmsh.option.setNumber("General.Terminal", 0)
        x, y, z = _BOX
        gmsh.model.occ.addBox(-x / 2, -y / 2, -z, x, y, z)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))


@contextmanager
def _mute() -> Iterator[None]:
    """Discard what the CAD kernel prints to standard output, past Python and gmsh."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def _ellipsoid(axes: tuple[float, ...], below: float = _BELOW) -> Section:
    return {"shape": "ellipsoid", "axes": [*map(mm, axes)], "fixed": {"below": mm(below)}}


def _scene(body: Section, probe: Section, nu: float = 0.3) -> Section:
    return {"body": body, "material": tissue(nu), "probe": probe | {"at": ["0 mm", "0 mm"]}}
