"""Extremes together: where two of them meet, things break that hold at each of them."""

from collections.abc import Iterator

from pipeline.verify.sections import Section, blade, box, cylinder, disc, mesh, study
from pipeline.verify.stress.cell import Cell, Expect


def corners() -> Iterator[Cell]:
    """Yield the cells of the last row."""
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
        probe = blade(10, 2, action="cut", slice=f"{slice_} mm")
        yield f"blade slices {100 * slice_:g} times its depth", study(0.3, box(), probe, mesh(0.2)), "right"
    off = blade(10, 2, action="cut", slice="1 mm", at=["20 mm", "25 mm"])
    # The work of the slice hides what the depth takes: the bar may say that F is not known.
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
    yield "tolerance 1e-3", study(0.3, method="iterative", tolerance=1e-3), "either"
    yield "tolerance 1e-3, nu 0.5", study(0.5, method="iterative", tolerance=1e-3), "either"
    yield "tolerance 1e-14", study(0.44, method="iterative", tolerance=1e-14), "either"
    yield "tolerance 1e-14, nu 0.5", study(0.5, method="iterative", tolerance=1e-14), "either"
