"""The cells of the stress matrix: each row takes one input to its extremes, the last one combines two extremes."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from typing import Any, Literal

from tests.verification.sections import Section, blade, box, cylinder, disc, mesh, mm, study

Against = Literal["truth", "base"]
Expect = Literal["right", "refused", "either"]

_A, _R = 2.0, 20.0  # the probe's and the body's radius
_NU = (0, 0.2, 0.3, 0.4, 0.44, 0.45, 0.49, 0.495, 0.499, 0.4999, 0.49999, 0.5)


@dataclass(frozen=True)
class Cell:
    """One study of one case, and the expected result.

    ``against`` is "truth", the same scene at a required accuracy, or "base", the row's reference cell of that
    ``group``, compared without error bars: F / ``scale`` must agree to 1e-8. ``expect`` is "right", "refused", or
    "either" where a refusal is as good as the right answer. ``ranks`` is the number of ranks to start, 0 for none.
    """

    row: str
    value: str
    study: dict[str, Any]
    against: Against = "truth"
    expect: Expect = "right"
    scale: float = 1.0
    accuracy: str = "0.1 %"
    group: str = ""
    ranks: int = 0
    quick: bool = False


def cells() -> tuple[Cell, ...]:
    """Return all cells, row by row; cells of an invariance follow their reference cell."""
    rows = (_poisson, _young, _size, _depth, _probe, _layer, _jump, _growth, _edge, _epsilon, _blade, _degree, _locking)
    return tuple(cell for row in (*rows, _support, _method, _ranks, _corners) for cell in row())


def _poisson() -> Iterator[Cell]:
    for nu in _NU:
        yield Cell("Poisson's ratio", f"{nu:g}", study(nu), quick=nu in (0, 0.44, 0.5))
    for nu in (0, 0.44, 0.4999, 0.5):
        yield Cell("Poisson's ratio, frictionless", f"{nu:g}", study(nu, probe=disc(contact="frictionless")))


def _young() -> Iterator[Cell]:
    for nu, moduli in ((0.3, (1e4, 1e-3, 1.0, 1e8, 1e12)), (0.4999, (1e4, 1e-3, 1e12))):
        for young in moduli:
            group = f"nu {nu:g}"
            yield _same("Young's modulus (Pa)", f"{young:g}, {group}", study(nu, young=young), young / 1e4, group)


def _size() -> Iterator[Cell]:
    for nu, sizes in ((0.3, (20, 1, 7.3, 300, 1e4)), (0.4999, (20, 1, 1e4))):
        for size in sizes:
            s, group = size / 20, f"nu {nu:g}"
            scene = study(nu, cylinder(size, size), disc(_A * s, 0.01 * s), mesh(0.4 * s, fine=8 * s, coarse=8 * s))
            yield _same("body's radius (mm)", f"{size:g}, {group}", scene, s * s, group)


def _depth() -> Iterator[Cell]:
    for depth in (0.01, 1e-9, 1e-4, 1.0, 19.0):
        yield _same("depth (mm)", f"{depth:g}", study(probe=disc(depth=depth)), depth / 0.01)


def _same(row: str, value: str, scene: dict[str, object], scale: float, group: str = "") -> Cell:
    """Return a cell of an invariance; the cell of scale 1 is compared with the truth."""
    first = scale == 1.0
    return Cell(row, value, scene, "truth" if first else "base", scale=scale, group=group, quick=group != "nu 0.4999")


def _probe() -> Iterator[Cell]:
    for share in (0.001, 0.003, 0.01, 0.03, 0.1, 0.2, 0.4):
        a = share * _R
        yield Cell("probe / body radius", f"{share:g}", study(probe=disc(a), sizes=mesh(0.2 * a)), quick=share == 0.001)


def _layer() -> Iterator[Cell]:
    for ratio in (0.1, 0.2, 0.5, 1, 2, 5, 20, 50):
        h = ratio * _A
        body = cylinder(_A + 8 * h if ratio < 5 else 60, h)
        sizes = mesh(min(0.4, 0.2 * h), fine=min(8, h))
        for nu in (0.3, 0.4999):
            yield Cell("layer thickness / a", f"{ratio:g}, nu {nu:g}", study(nu, body, sizes=sizes), quick=ratio == 0.5)


def _jump() -> Iterator[Cell]:
    for jump, a in ((10, 20), (100, 10), (1000, 1), (1e4, 0.1)):
        for nu in (0.3, 0.49):
            scene = study(nu, cylinder(200, 200), disc(a), mesh(100 / jump, fine=100, coarse=100))
            yield Cell("coarse / rim", f"{jump:g}, nu {nu:g}", scene, quick=jump == 1e4 and nu == 0.3)


def _growth() -> Iterator[Cell]:
    for nu in (0.3, 0.4999):
        for growth in (0.2, 0.5, 1.0, 1.5):
            yield Cell("growth", f"{growth:g}, nu {nu:g}", study(nu, sizes=mesh(growth=growth)), quick=growth == 1.5)


def _edge() -> Iterator[Cell]:
    row = "gap to the body's edge / a"
    for gap in (-0.01, 0.0, 0.001, 0.01):
        a = _R / (1 + gap)
        wanted: Expect = "refused" if gap <= 0 else "right"
        yield Cell(row, f"{gap:g}, centred", study(probe=disc(a)), expect=wanted, quick=gap <= 0)
        scene = study(probe=disc(at=_R - _A * (1 + gap)), sizes=mesh(0.3))
        yield Cell(row, f"{gap:g}, off centre", scene, expect=wanted)
        scene = study(0.45, box(20, 20, 20), blade(20 / (1 + gap)), mesh(0.3))
        yield Cell(row, f"{gap:g}, blade across", scene, expect=wanted, accuracy="0.3 %")


def _epsilon() -> Iterator[Cell]:
    near = {"a/2": _A / 2, "a": _A, "a + 1e-6": _A + 2e-6, "a + 0.1 %": 1.001 * _A, "a + 1 %": 1.01 * _A, "2 a": 2 * _A}
    far = {"R - 1 %": 0.99 * _R, "R - 1e-7": _R * (1 - 1e-7), "R": _R, "R + 1e-7": _R * (1 + 1e-7), "full": inf}
    for outside in ("coarse", "free", "fixed"):
        for label, epsilon in (near | far).items():
            clash = outside == "fixed" and epsilon <= _A
            barely = outside == "fixed" and epsilon < 1.2 * _A  # narrower than an element at the rim
            expect: Expect = "refused" if clash else "either" if barely else "right"
            scene = study(sizes=mesh(fine=4, epsilon=epsilon, outside=outside))
            quick = label in ("a", "R - 1e-7")
            yield Cell("epsilon", f"{label}, {outside}", scene, expect=expect, quick=quick)


def _blade() -> Iterator[Cell]:
    for ratio in (1, 2, 5, 10, 25, 50, 100):
        w = 2.0 if ratio <= 25 else 0.5
        scene = study(0.3, box(), blade(ratio * w, w), mesh(0.1 * w))
        yield Cell("blade length / width", f"{ratio:g}", scene, accuracy="0.3 %", quick=ratio == 5)


def _degree() -> Iterator[Cell]:
    row = "element"
    for degree in (1, 2, 3):
        for nu in (0.0, 0.3, 0.44):
            sizes = mesh(degree=degree)
            yield Cell(row, f"displacement {degree}, nu {nu:g}", study(nu, sizes=sizes), quick=degree == 3 and nu == 0)
    for degree in (2, 3):
        for nu in (0.26, 0.4, 0.5):
            sizes = mesh(degree=degree, element="mixed")
            yield Cell(row, f"mixed {degree}, nu {nu:g}", study(nu, sizes=sizes), quick=degree == 3 and nu == 0.5)


def _locking() -> Iterator[Cell]:
    most = {1: 0.45, 2: 0.495, 3: 0.495}
    for degree, limit in most.items():
        for nu in (0.45, 0.495, 0.4951, 0.5):
            expect: Expect = "right" if nu <= limit else "refused"
            scene = study(nu, sizes=mesh(degree=degree, element="displacement"))
            yield Cell("locking", f"displacement {degree}, nu {nu:g}", scene, expect=expect, quick=nu > limit)


def _support() -> Iterator[Cell]:
    for nu in (0.3, 0.5):
        for fixed in ("sides", "bottom+sides", -19.99, -10.0, -1.0, -0.1):
            name = fixed if isinstance(fixed, str) else f"below {mm(fixed)}"
            expect: Expect = "refused" if fixed == -19.99 else "right"  # a strip 800 times thinner than the elements
            yield Cell("support", f"{name}, nu {nu:g}", study(nu, cylinder(fixed=fixed)), expect=expect)


def _method() -> Iterator[Cell]:
    for nu in (0.0, 0.3, 0.44, 0.45, 0.4999, 0.5):
        for method in ("direct", "iterative"):
            against: Against = "truth" if method == "direct" else "base"
            group = f"nu {nu:g}"
            scene = study(nu, method=method)
            yield Cell("method", f"{method}, {group}", scene, against, group=group, quick=nu in (0.3, 0.5))


def _ranks() -> Iterator[Cell]:
    for nu in (0.3, 0.4999):
        for ranks in (1, 2, 3):
            against: Against = "truth" if ranks == 1 else "base"
            group = f"nu {nu:g}"
            yield Cell("ranks", f"{ranks}, {group}", study(nu), against, group=group, ranks=ranks)


def _corners() -> Iterator[Cell]:
    """Extremes in pairs, which may fail where each alone is fine."""
    for compare in (_thin, _slender, _held, _columns, _blades, _naive):
        for value, scene, expect in compare():
            yield Cell("corners", value, scene, expect=expect, accuracy="0.5 %")


_Corner = tuple[str, Section, Expect]


def _thin() -> Iterator[_Corner]:
    for nu in (0.44, 0.45, 0.5):
        scene = study(nu, cylinder(3.6, 0.2), sizes=mesh(0.04, fine=0.2))
        yield f"layer 0.1 a, nu {nu:g}", scene, "right"
    scene = study(0.4999, cylinder(20, 0.02), disc(0.02), mesh(0.004, fine=0.02, coarse=2, epsilon=0.1))
    yield "layer of a, body 1000 a wide, epsilon 5 a, nu 0.4999", scene, "right"
    scene = study(0.5, cylinder(20, 1), disc(0.02), mesh(0.004, fine=1, epsilon=0.02, coarse=1))
    yield "epsilon = a = 0.001 R, layer R/20, nu 0.5", scene, "right"
    yield (
        "sheet 1000 x 1000 x 10, disc at its corner",
        study(0.499, box(1000, 1000, 10), disc(2, at=497.9), mesh(0.4, fine=10, coarse=100, epsilon=20)),
        "right",
    )


def _slender() -> Iterator[_Corner]:
    for nu in (0.3, 0.5):
        for height in (1000, 5000):
            sizes = mesh(fine=20, coarse=20)
            yield f"needle {height // 20} R high, nu {nu:g}", study(nu, cylinder(20, height), sizes=sizes), "either"


def _held() -> Iterator[_Corner]:
    for nu in (0.3, 0.49, 0.5):
        for level in (-0.05, -0.01):
            yield f"held below {level:g} mm, nu {nu:g}", study(nu, cylinder(fixed=level)), "either"
    for share in (0.99, 0.999, 0.99999):
        for fixed in ("sides", "bottom+sides"):
            for nu in (0.3, 0.5):
                scene = study(nu, cylinder(fixed=fixed), disc(20 * share))
                yield f"{fixed} held, a = {share:g} R, nu {nu:g}", scene, "either"


def _columns() -> Iterator[_Corner]:
    for nu in (0.3, 0.5):
        for gap in (1e-7, 1e-6, 1e-5, 1e-3, 0.01):
            for contact in ("bonded", "frictionless"):
                sizes = mesh(fine=4, epsilon=2 * (1 + gap), outside="fixed")
                scene = study(nu, probe=disc(contact=contact), sizes=sizes)
                yield f"held column a + {gap:g} a, {contact}, nu {nu:g}", scene, "either"
        scene = study(nu, sizes=mesh(fine=4, epsilon=0.2, outside="free"))
        yield f"free column of 0.1 a, 100 times as high, nu {nu:g}", scene, "either"


def _blades() -> Iterator[_Corner]:
    sizes = mesh(0.1)
    at = ["4 mm", "29.749 mm"]
    yield "blade 100:1, 1 µm off the edge, nu 0.4999", study(0.4999, box(), blade(50, 0.5, at=at), sizes), "right"
    turned = blade(50, 0.5, direction=[1.0, 1.0, 0.0], at=["0 mm", "3 mm"])
    yield "blade 100:1 across, nu 0.45", study(0.45, box(), turned, sizes), "right"
    for slice_ in (0.01, 1.0):
        probe = blade(10, 2, slice=f"{slice_} mm")
        yield f"blade slices {100 * slice_:g} times its depth", study(0.3, box(), probe, mesh(0.2)), "right"
    off = blade(10, 2, slice="1 mm", at=["20 mm", "25 mm"])
    # The work of the slice dominates that of the depth: the bar may say that F is not known.
    yield "slices in a corner, nu 0.5", study(0.5, box(), off, mesh(0.2)), "either"


def _naive() -> Iterator[_Corner]:
    for degree in (1, 2, 3):
        for nu in (0.0, 0.44):
            sizes = mesh(2, 1.5, degree=degree)
            yield f"rim = a, growth 1.5, degree {degree}, nu {nu:g}", study(nu, sizes=sizes), "either"
    for nu in (0.45, 0.5):
        yield f"rim = a, growth 1.5, mixed, nu {nu:g}", study(nu, sizes=mesh(2, 1.5)), "right"
        yield f"rim = 4 a, mixed, nu {nu:g}", study(nu, sizes=mesh(8, 1.5)), "right"
    for nu in (0.2501, 0.2500001):
        yield f"mixed, nu {nu:.8g}", study(nu, sizes=mesh(element="mixed")), "right"
    yield "tolerance 1e-3", study(0.3, method="iterative", energy_tolerance=1e-3), "either"
    yield "tolerance 1e-3, nu 0.5", study(0.5, method="iterative", energy_tolerance=1e-3), "either"
    yield "tolerance 1e-14", study(0.44, method="iterative", energy_tolerance=1e-14), "either"
    yield "tolerance 1e-14, nu 0.5", study(0.5, method="iterative", energy_tolerance=1e-14), "either"
