"""Bodies of other shapes: round ones on the meridian and in the limit of a half-space, and the same body from files."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import gmsh
from mpi4py import MPI

from pipeline import compat
from pipeline.verify import known
from pipeline.verify.compare import against, against_meridian, solve
from pipeline.verify.row import Row
from pipeline.verify.sections import Section, box, disc, mm, tissue
from pipeline.verify.star import directions, star_file

# Semi-axes (mm), and the height below which they are held, and half as many facets as a file of it has.
_ROUND, _AXES, _BELOW, _POINTS = (60.0, 60.0, 45.0), (60.0, 45.0, 30.0), -10.0, 7000
_BALL, _CURVED = 1e6, 1e-5  # a ball of so many radii of the disc, and what its curvature leaves of F
_BOX = (60.0, 60.0, 20.0)


def body_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of ellipsoids and of bodies from files, as they are solved; ``quick`` leaves a few; collective."""
    yield from _balls(comm, quick)
    yield from _ellipsoids(comm, quick)
    if not quick:
        yield from _files(comm)


def _balls(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """A ball that is so large that its surface is plane."""
    for contact in ("frictionless",) if quick else ("frictionless", "bonded"):
        force, source = known.half_space_disc(10e3, 0.3, 1e-3, 1e-5, contact)
        scene = _scene(_ellipsoid((_BALL,) * 3, 0.0), disc(1, contact=contact))
        yield against(comm, f"ball of a million radii, disc, {contact}, ν = 0.3", "2D", (force, source, _CURVED), scene)


def _ellipsoids(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Ellipsoids of revolution in three dimensions against the same in two, which is the reference."""
    for contact, nu in (("bonded", 0.3),) if quick else (("bonded", 0.3), ("frictionless", 0.3), ("frictionless", 0.5)):
        scene = _scene(_ellipsoid(_ROUND), disc(8, contact=contact), nu)
        yield against_meridian(comm, f"ellipsoid 4:4:3, a = 8 mm, {contact}, ν = {nu:g}", scene)


def _files(comm: MPI.Comm) -> Iterator[Row]:
    """Bodies from files against the same ones declared: the file's bar adds to that of the reference."""
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
    """Keep what the CAD kernel prints of a STEP file, past Python and gmsh, from the table of rows."""
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
