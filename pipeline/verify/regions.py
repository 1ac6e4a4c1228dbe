"""Bodies of several materials whose force is known: in a limit, of one material, or on the meridian."""

from collections.abc import Iterator, Sequence
from math import pi
from typing import Any

from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run.execute import compute
from pipeline.study.load import parse
from pipeline.verify.row import Row

Section = dict[str, Any]

_ACCURACY = {"2D": "0.1 %", "3D": "0.3 %"}
# Thickness (mm), Young's modulus (kPa) and Poisson's ratio, from the top down.
_STACK = ((1.0, 60.0, 0.3), (2.0, 5.0, 0.4), (1.0, 20.0, 0.2))
_INCOMPRESSIBLE_SKIN = ((1.0, 60.0, 0.49), (9.0, 5.0, 0.3))
# Radii of a wide punch in units of the stack's height; what is left of the edge's part of F then is below 0.2 %.
_WIDE, _LEFT = (2.5, 5.0, 10.0), 0.002
_DEPTH = 1e-5


def region_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of layers and inclusions, as they are solved; ``quick`` leaves a few of each kind; collective."""
    yield from _springs(comm, quick)
    yield from _meridians(comm, quick)
    yield from _of_one_material(comm, quick)


def _springs(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Under a punch much wider than the layers are thick, each of them is a spring of its oedometric modulus."""
    height = sum(thickness for thickness, _, _ in _STACK)
    compliance = sum(1e-3 * h / (1e3 * young * (1 - nu) / ((1 + nu) * (1 - 2 * nu))) for h, young, nu in _STACK)
    for contact in ("frictionless",) if quick else ("frictionless", "bonded"):
        ratios = []
        for wide in _WIDE:
            a = wide * height
            force, _, message = _force(comm, "2D", _cylinder(a + 5 * height, _STACK), _disc(a, contact))
            ratios.append(force * compliance / (pi * (1e-3 * a) ** 2 * _DEPTH))
        # The edge adds a share that falls like height / a, and its square: extrapolated to none.
        first, second, third = ratios
        yield Row(
            f"wide punch on three layers, {contact}", "2D", 1.0, "springs in series, a / h to infinity",
            (first - 6 * second + 8 * third) / 3, 0.0, _LEFT, message,
        )  # fmt: skip


def _meridians(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Layered cylinders in three dimensions against the same in two, which is the reference."""
    for name, stack in (("three layers", _STACK), ("ν = 0.49 above 0.3", _INCOMPRESSIBLE_SKIN)):
        for contact in ("frictionless",) if quick else ("frictionless", "bonded"):
            scene = _cylinder(12.0, stack), _disc(2.0, contact)
            flat, flat_bar, flat_message = _force(comm, "2D", *scene)
            force, bar, message = _force(comm, "3D", *scene)
            yield Row(
                f"layered cylinder, {name}, {contact}", "3D", flat, f"axisymmetric, bar {flat_bar:.0e} {flat_message}",
                force, bar, flat_bar, message,
            )  # fmt: skip


def _of_one_material(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Pieces that are as stiff as what is round them are not felt."""
    inclusion = {"name": "ball", "at": ["1 mm", "0 mm", "-5 mm"], "radius": "3 mm"}
    for nu in (0.3,) if quick else (0.3, 0.49):
        tissue = {"young": "10 kPa", "poisson": nu}
        body: Section = _cylinder(12.0, ()) | {"height": "10 mm"}
        flat, flat_bar, flat_message = _force(comm, "2D", body, _disc(2.0, "bonded"), tissue)
        pieces = body | {
            "layers": [{"name": "top", "thickness": "1 mm", **tissue}],
            "inclusion": [{**inclusion, **tissue}],
        }
        force, bar, message = _force(comm, "3D", pieces, _disc(2.0, "bonded"), tissue)
        yield Row(
            f"layer and inclusion of the same tissue, ν = {nu:g}", "3D", flat,
            f"axisymmetric, bar {flat_bar:.0e} {flat_message}".strip(), force, bar, flat_bar, message,
        )  # fmt: skip


def _force(
    comm: MPI.Comm, path: str, body: Section, probe: Section, material: Section | None = None
) -> tuple[float, float, str]:
    """Solve a scene to the accuracy of its path; return force, error bar and message."""
    sections = {"body": body, "probe": probe, "mesh": {"accuracy": _ACCURACY[path]}, "solve": {"exact": False}}
    study = parse(sections | ({"material": material} if material else {}))
    plan = make_plan(study, without=("axisymmetric",) if path == "3D" else ())
    (record,) = compute(plan, comm).values()
    return record.force, record.force_error, record.message


def _cylinder(radius: float, stack: Sequence[tuple[float, float, float]]) -> Section:
    layers = [
        {"name": f"layer{number}", "thickness": f"{h} mm", "young": f"{young} kPa", "poisson": nu}
        for number, (h, young, nu) in enumerate(stack)
    ]
    height = sum(thickness for thickness, _, _ in stack)
    return {"shape": "cylinder", "radius": f"{radius} mm", "height": f"{height} mm", "fixed": "bottom",
            "layers": layers}  # fmt: skip


def _disc(radius: float, contact: str) -> Section:
    return {"shape": "disc", "radius": f"{radius} mm", "depth": f"{1e3 * _DEPTH} mm", "contact": contact}
