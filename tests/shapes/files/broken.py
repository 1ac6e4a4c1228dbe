"""Typical defects of organ surfaces, each with words of the message that refuses it."""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from tests.shapes.files.solids import Surface, ball, both, obj, ply, stl, stl_text


@dataclass(frozen=True)
class Broken:
    """A file and words of its message; ``repairs`` if `repair = true` makes a body of it."""

    name: str
    data: bytes
    words: tuple[str, ...]
    unit: float = 1e-3
    repairs: bool = False


def _file(name: str, data: bytes, *words: str, unit: float = 1e-3) -> Broken:
    return Broken(name, data, words, unit)


def _mended(name: str, data: bytes, *words: str) -> Broken:
    return Broken(name, data, words, repairs=True)


def _near(points: FloatArray, place: tuple[float, float, float]) -> int:
    return int(np.linalg.norm(points - place, axis=1).argmin())


def _without(surface: Surface, *places: tuple[float, float, float]) -> Surface:
    """The surface without the facets around some points."""
    points, facets = surface
    gone = np.zeros(len(facets), dtype=bool)
    for place in places:
        gone |= (facets == _near(points, place)).any(axis=1)
    return points, facets[~gone]


def _moved(surface: Surface, place: tuple[float, float, float], to: tuple[float, float, float]) -> Surface:
    points = surface[0].copy()
    points[_near(points, place)] = to
    return points, surface[1]


def _turned(surface: Surface, count: int) -> Surface:
    facets = surface[1].copy()
    facets[:count] = facets[:count, ::-1]
    return surface[0], facets


def _fin(surface: Surface) -> Surface:
    points, facets = surface
    a, b = facets[0, :2]
    return np.concatenate([points, 1.3 * points[a : a + 1]]), np.concatenate([facets, [(a, b, len(points))]])


def _wall(surface: Surface) -> Surface:
    """A wall inside, from one side to the other."""
    points, facets = surface
    rim = np.nonzero(np.abs(points[:, 2]) < 1e-9)[0]
    rim = rim[np.argsort(np.arctan2(points[rim, 1], points[rim, 0]))]
    centre = len(points)
    wall = [(a, b, centre) for a, b in zip(rim, np.roll(rim, -1), strict=True)]
    return np.concatenate([points, [(0.0, 0.0, 0.0)]]), np.concatenate([facets, wall])


def _sheet(count: int = 12) -> Surface:
    x, y = np.meshgrid(np.arange(count + 1.0), np.arange(count + 1.0), indexing="ij")
    points = 5 * np.column_stack([x.ravel(), y.ravel(), 0.1 * np.sin(x + y).ravel()])
    i, j = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
    a = (i * (count + 1) + j).ravel()
    b, c, d = a + count + 1, a + count + 2, a + 1
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def _klein(count: int = 40) -> Surface:
    """A closed one-sided surface: a Klein bottle."""
    i, j = np.meshgrid(np.arange(count), np.arange(8), indexing="ij")

    def number(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return (u % count) * 8 + np.where(u >= count, -v, v) % 8

    corners = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)]
    a, b, c, d = (k.ravel() for k in corners)
    angle, turn = 2 * np.pi * i.ravel() / count, 2 * np.pi * j.ravel() / 8
    ring = 30 + 8 * np.cos(turn + angle / 2)
    points = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), 8 * np.sin(turn + angle / 2)])
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def _pinched() -> Surface:
    """A ball whose top and bottom are one point."""
    points, facets = ball(3)
    top, bottom = _near(points, (0, 0, 20)), _near(points, (0, 0, -20))
    points = points.copy()
    points[top] = points[bottom] = (0.0, 0.0, 0.0)
    facets = np.where(facets == bottom, top, facets)
    return points, facets


def _changed(data: bytes, old: bytes, new: bytes, times: int = 1) -> bytes:
    assert old in data
    return data.replace(old, new, times)


def _finite(surface: Surface, value: float) -> Surface:
    points = surface[0].copy()
    points[17, 1] = value
    return points, surface[1]


def _half_welded() -> Surface:
    """Each facet with corners of its own, moved by more than rounding."""
    points, facets = ball(2)
    corners = points[facets].reshape(-1, 3)
    corners = corners * (1 + 1e-3 * np.random.default_rng(1).standard_normal(corners.shape))
    return corners, np.arange(len(corners)).reshape(-1, 3)


def _slit(surface: Surface) -> Surface:
    """A surface open along a line: two points where there should be one."""
    points, facets = surface
    facets = facets.copy()
    one = _near(points, (0, 0, 20))
    around = np.nonzero((facets == one).any(axis=1))[0][:3]
    facets[around] = np.where(facets[around] == one, len(points), facets[around])
    return np.concatenate([points, points[[one]] + np.array([0, 0, 0.5])]), facets


def corpus() -> list[Broken]:
    """Return the broken files."""
    good = ball()
    whole = stl(good)
    text, lines = stl_text(ball(1)), obj(ball(1))
    nan, inf = float("nan"), float("inf")
    inner = ball(2, (8.0, 8.0, 8.0))
    numbers = [
        _file("nan.stl", stl(_finite(good, nan)), "not finite", "nan", "export"),
        _file("infinite.stl", stl(_finite(good, inf)), "not finite", "inf"),
        _file("nan-text.stl", stl_text(_finite(ball(2), nan)), "not finite", "nan"),
        _file("nan.ply", ply(_finite(good, nan), "ascii"), "not finite", "point 18"),
        _file("nan.obj", obj(_finite(good, -inf)), "not finite", "-inf"),
    ]
    files = [
        _file("empty.stl", b"", "is empty"),
        _file("short.stl", b"solid", "truncated", "endsolid"),
        _file("truncated.stl", whole[:20_000], "truncated", "1,280 facets", "it has 398:"),
        _file("header.stl", whole[:84], "truncated", "it has 0:"),
        _file("truncated-text.stl", text[: len(text) // 2], "truncated", "endsolid"),
        _file("truncated.ply", ply(good)[:5000], "truncated", "vertex"),
        _file("truncated-faces.ply", ply(good)[:-500], "truncated", "1,280 of face"),
        _file("truncated-text.ply", ply(good, "ascii")[:-400], "truncated", "face"),
        _file("truncated.obj", _changed(lines, b"\nv ", b"\n# "), "a facet names point 42 of 41"),
        _file("letter.stl", b"Dear colleague, here is the liver that you asked for.\n" * 9, "not an STL file", "Dear"),
        _file("letter.ply", b"Dear colleague\n", "not a PLY file"),
        _file("cornerless.obj", lines[: lines.index(b"\nf ")] + b"\nf \n", "a facet with 0 corners"),
        _file("letter.obj", b"Dear colleague\n", "not an OBJ surface", "0 lines of points"),
        _file("word.stl", _changed(text, b"vertex", b"corner"), "`vertex` occurs 239 times in 80 facets"),
        _file("comma.stl", text.replace(b".", b","), "line 4", "three numbers"),
        _file("comma.obj", lines.replace(b".", b","), "line", "three coordinates"),
        _file("names.obj", _changed(lines, b"\nf 1", b"\nf one"), "line", "numbers of points"),
        _file("zero.obj", _changed(lines, b"\nf ", b"\nf 0 "), "line", "from 1 on"),
        _file("really-ply.stl", ply(good), "content is that of `.ply`", "rename"),
        _file("really-stl.obj", whole, "content is that of `.stl`", "rename"),
        _file("really-stl.ply", text, "content is that of `.stl`", "rename"),
        _file("organ.vtk", b"# vtk DataFile", "is a file of VTK, which is not read", ".stl, .ply, .obj"),
        _file(
            "cloud.ply", _changed(ply(good, "ascii"), b"element face", b"element edge"), "no surface", "vertex, edge"
        ),
        _file("fraction.ply", _changed(ply(good, "ascii"), b"\n3 ", b"\n3.5 "), "3.5, which is not an integer"),
        _file("format.ply", _changed(ply(good, "ascii"), b"ascii", b"morse"), "`format morse 1.0`"),
        _file("flat.ply", _changed(ply(good, "ascii"), b"float z", b"float w"), "x, y, w", "needed are x, y and z"),
        _file("words.ply", ply(good, "ascii").replace(b".", b","), "not numbers"),
        _file("wrong-point.ply", ply((good[0], good[1] + 1)), "a facet names point 642", "0 to 641"),
        _file("line.ply", ply((good[0], good[1][:, :2])), "2 corners"),
        _file("none-text.stl", b"solid organ\nendsolid organ\n", "has no facets"),
        _file("none.stl", stl((good[0], good[1][:0])), "no facets"),
        _file("none.ply", ply((good[0], good[1][:0])), "no facets"),
        _file("huge.ply", _changed(ply(good), b"face 1280", b"face 4000000"), "4,000,000 facets", "Decimation"),
    ]
    units = [
        _file("metres.stl", whole, "80 m across", '"mm" or "cm"', unit=1.0),
        _file("millimetres.stl", stl((good[0] / 1e3, good[1])), "0.08 mm across", '"m"', unit=1e-3),
        _file("microns.stl", stl((good[0] * 1e3, good[1])), "80 m across", '"um"', unit=1e-3),
        _file("point.stl", stl((good[0] * 0, good[1])), "0 mm across", "no usual unit"),
        _file("galaxy.obj", obj((good[0] * 1e18, good[1])), "km across", "no usual unit"),
    ]
    shapes = [
        _mended("hole.stl", stl(_without(good, (0, 0, 20))), "not closed", "1 hole", "mm long", "repair"),
        _mended("holes.ply", ply(_without(good, (0, 0, 20), (40, 0, 0))), "2 holes, the largest", "Close Holes"),
        _mended("facet.obj", obj((good[0], good[1][1:])), "1 hole", "3 open edges"),
        _file("half.stl", stl((good[0], good[1][good[0][good[1]].mean(axis=1)[:, 2] > 0])), "not closed", "1 hole"),
        _file("sheet.stl", stl(_sheet()), "not closed", "1 hole"),
        _mended("slit.stl", stl(_slit(good)), "not closed", "4 open edges"),
        _file("torn.ply", ply(_half_welded()), "not closed", "318 holes"),
        _mended("fin.stl", stl(_fin(good)), "1 edges have more than two facets", "Non Manifold"),
        _mended("wall.stl", stl(_wall(good)), "edges have more than two facets", "inner walls"),
        _mended("inverted-some.stl", stl(_turned(good, 5)), "5 facets are inverted", "Re-Orient"),
        _file("klein.ply", ply(_klein()), "one-sided surface"),
        _file("flat.stl", stl(ball(axes=(40.0, 30.0, 1e-6))), "no volume", "sheet"),
        _file("two.stl", stl(both(good, ball(2, centre=(90, 0, 0)))), "2 separate shells", "beside", "cm³"),
        _mended("crumb.stl", stl(both(good, ball(1, (1, 1, 1), (60, 0, 0)))), "2 separate shells", "beside"),
        _mended("cavity.stl", stl(both(good, (inner[0], inner[1][:, ::-1]))), "2 separate shells", "inside"),
        _file("nested.obj", obj(both(good, ball(3, (38.0, 28.0, 18.0)))), "2 separate shells", "inside"),
        _file("overlapping.stl", stl(both(good, ball(3, centre=(30, 5, 5)))), "2 separate shells", "across", "Union"),
        _file("twice-moved.stl", stl(both(good, (good[0] + 1e-2, good[1]))), "2 separate shells"),
        _file("pierced.stl", stl(_moved(good, (0, 0, 20), (0, 0, -40))), "pairs of facets cross", "repair"),
        _mended("tangled.ply", ply(_moved(good, (0, 0, 20), (14, 2, 19.5))), "pairs of facets cross", "MeshLab"),
        _mended("pinched.stl", stl(_pinched()), "1 points join parts", "(0, 0, 0)"),
    ]
    return [*numbers, *files, *units, *shapes]
