"""Bodies that touch more than the tool: supports, loose layers, two jaws, and their slip when they are pulled."""

from collections.abc import Iterator
from math import pi, sqrt

from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.record import Record
from epsmesh.study.read import parse
from epsmesh.verify import Row, Section
from tests.verification import known
from tests.verification.sections import box, cylinder, mm, tissue

_YOUNG, _POISSON = 10e3, 0.3
# Of the integral equation, whose pressure has six terms, and of a point force for contact of a tenth of the thickness.
_RECEDING = 5e-3
# Of half of a body whose weight keeps it on a smooth plane: it bends the plane under the tool.
_WEIGHT = 1e-3
# Of jaws on a body that is no half-space; of the directions of friction, which differ a bit.
_FINITE, _ALIGNED = 2e-2, 1e-3
_FRICTION = 0.3
_TOGETHER = {"together": "grasp"}
# Of two bodies that are large beside their contact, and no half-spaces.
_FINITE_BODIES = 5e-3
_HERTZ = "H. Hertz (1882)"
_GRAVITY, _DENSITY = 9.81, 1060.0
# Of a strip as a beam, whose overhang is ten times its thickness; of forces that the solver balances.
_BEAM, _BALANCED = 3e-2, 1e-7
_LIGHT = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}


def contacts_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of several contacts; collective."""
    yield _lift_off(comm)
    yield from _loose(comm)
    if not quick:
        yield _on_a_ridge(comm)
        yield from _grasps(comm)
        yield _between_balls(comm)
        yield from elastic_rows(comm)
        yield from _pulled(comm)


def _record(comm: MPI.Comm, body: Section, probe: Section | list[Section], mesh: Section, **more: Section) -> Record:
    material = tissue(_POISSON, 1e-3 * _YOUNG) | more.pop("material", {})
    study = parse({"body": body, "material": material, "probe": probe, "mesh": mesh, "solve": {"exact": False}, **more})
    (record,) = compute(make_plan(study), comm).values()
    return record


def _sizes(rim: float, fine: float) -> Section:
    return {"epsilon": "full", "fine": mm(fine), "coarse": mm(fine), "rim": mm(rim), "growth": 0.4}


def _ball(radius: float, depth: float) -> Section:
    return {"shape": "sphere", "radius": mm(radius), "depth": mm(depth), "contact": "unilateral"}


def _jaws(tool: Section) -> list[Section]:
    return [tool | _TOGETHER, _TOGETHER | {}]


def _lift_off(comm: MPI.Comm) -> Row:
    """Radius at which a layer that is pressed at a point lifts off a smooth plane."""
    thick, radius = 10.0, 40.0
    body = cylinder(radius, thick, "none") | {"support": {"on": "bottom", "friction": 0}}
    found = _record(comm, body, _ball(2, 0.1), _sizes(0.1, 3) | {"growth": 0.3})
    touching = pi * (1e-3 * radius) ** 2 - found.largest["lift_off_area"]
    value, bar = sqrt(touching / pi), found.largest["lift_off_area_error"] / touching / 2
    reference = 1e-3 * thick * known.receding_radius()
    return Row("layer on a smooth plane, edge of lift-off (m)", "3D", reference, known.KEER, value, bar, _RECEDING)


def _on_a_ridge(comm: MPI.Comm) -> Row:
    """Length over which each end of a heavy strip stays clear of a round support below its middle."""
    thick, wide, radius, young = 2.0, 2.0, 1e3, 6.24e6  # mm, Pa
    support = {"on": "bottom", "shape": "cylinder", "radius": mm(radius), "direction": [0, 1, 0]}
    disc = {"shape": "disc", "radius": "0.7 mm", "depth": "0.00005 mm", "contact": "unilateral"}
    sizes = _sizes(0.03, 1) | {"growth": 0.5}
    material = tissue(0.0, 1e-3 * young) | {"density": f"{_DENSITY} kg/m^3"}
    found = _record(
        comm, box(96, wide, thick, "none") | {"support": support}, disc, sizes, material=material, load=_LIGHT
    )
    value = found.largest["lift_off_area"] / (2e-3 * wide)
    bar = found.largest["lift_off_area_error"] / found.largest["lift_off_area"]
    reference = known.overhang(young, 1e-3 * thick, _DENSITY * _GRAVITY, 1e-3 * radius)
    name = "heavy strip on a round support, length that is clear (m)"
    return Row(name, "3D", reference, known.TIMOSHENKO, value, bar, _BEAM, found.message)


def _loose(comm: MPI.Comm) -> Iterator[Row]:
    """A heavy layer that lies loose on tissue: how far both sink under their weight, and what the contact carries."""
    upper, lower, weight = 8e-3, 12e-3, _DENSITY * _GRAVITY
    heavy = {"density": f"{_DENSITY} kg/m^3"}
    flap = {"name": "flap", "thickness": "8 mm", "contact": "unilateral", "friction": 0} | tissue(0.0, 20) | heavy
    body, material = box(40, 40, 20) | {"layer": [flap]}, tissue(0.0) | heavy
    found = _record(comm, body, _ball(5, 0.5), _sizes(1, 5) | {"growth": 0.8}, material=material, load=_LIGHT)
    sag = weight * (upper**2 / 2 / 20e3 + (upper * lower + lower**2 / 2) / 10e3)
    yield Row("loose layer on tissue, sag under their weight (m)", "3D", sag, "columns", found.sag, _BALANCED)
    carried = found.force + weight * upper * 40e-3**2
    yield Row(
        "loose layer on tissue, force between them", "3D", carried, "F and weight",
        found.largest["interface_force"], _BALANCED,
    )  # fmt: skip


def _grasps(comm: MPI.Comm) -> Iterator[Row]:
    """A grasp that is symmetric about the middle, beside one tool on half of the body."""
    disc = {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm", "contact": "unilateral"}
    half = box(40, 40, 10, "none") | {"support": {"on": "bottom", "friction": 0}}
    for name, tool in (("discs", disc), ("balls", _ball(5, 0.3))):
        both = _record(comm, box(40, 40, 20, "none"), _jaws(tool), _sizes(0.1, 3))
        one = _record(comm, half, tool, _sizes(0.1, 3), load=_LIGHT, material={"density": "1000 kg/m^3"})
        yield Row(
            f"block between two {name}", "3D", one.force, "half of it on a smooth plane",
            both.force, both.force_error, one.force_error + _WEIGHT, both.message or one.message,
        )  # fmt: skip

    both = _record(comm, box(40, 40, 20, "none"), [*_jaws(disc)[:1], _ball(5, 0.3) | _TOGETHER], _sizes(0.3, 5))
    yield Row(
        "block between a disc and a ball: F of the ball", "3D", both.force, "F of the disc",
        both.largest["jaw_force"], _BALANCED, message=both.message,
    )  # fmt: skip


def _between_balls(comm: MPI.Comm) -> Row:
    """F on a block between two balls at the computed radius of contact: each is H. Hertz's."""
    radius, depth = 20.0, 0.02
    found = _record(comm, box(24, 24, 24, "none"), _jaws(_ball(radius, depth)), _sizes(0.04, 3))
    modulus = _YOUNG / (1 - _POISSON**2)
    force = 4 / 3 * modulus * found.contact_radius**3 / (1e-3 * radius)
    bar = 3 * found.contact_radius_error
    return Row("block between two balls, at the computed radius", "3D", force, _HERTZ, found.force, bar)


def elastic_rows(comm: MPI.Comm) -> Iterator[Row]:
    """F and the radius of contact of a ball on a block of another modulus, both 400 radii of the contact large."""
    radius, depth = 100.0, 0.0025
    width = sqrt(1e-6 * radius * depth)
    for name, ratio in (("a third of", 1 / 3), ("equal to", 1.0), ("three times", 3.0)):
        probe = _ball(radius, depth) | tissue(_POISSON, 1e-3 * _YOUNG * ratio)
        found = _record(comm, box(400, 400, 200), probe, _sizes(0.03, 40) | {"growth": 0.3})
        modulus = _YOUNG / (1 - _POISSON**2) / (1 + 1 / ratio)
        force = 4 / 3 * modulus * width * 1e-3 * depth
        scene = f"elastic ball on a block, E {name} its own"
        more = _FINITE_BODIES, found.message
        yield Row(f"{scene}: F", "3D", force, _HERTZ, found.force, found.force_error, *more)
        yield Row(f"{scene}: radius (m)", "3D", width, _HERTZ, found.contact_radius, found.contact_radius_error, *more)


def _pulled(comm: MPI.Comm) -> Iterator[Row]:
    """Two balls that are pulled until both contacts slide: the force, and the way of the one that slides last."""
    probe = _jaws(_ball(5, 0.3) | {"friction": _FRICTION, "pull": "0.15 mm"})
    probe[1]["depth"] = "0.2 mm"
    found = _record(comm, box(60, 60, 40, "sides"), probe, _sizes(0.7, 10))
    numbers = found.largest | {"force": found.force}
    pull, press = (numbers[name] + numbers[f"jaw_{name}"] for name in ("pull_force", "force"))
    bar = (numbers["pull_force_error"] + numbers["jaw_pull_force_error"]) / pull
    name = "block between two balls that are pulled"
    yield Row(f"{name}: F at whole slip", "3D", _FRICTION * press, known.COULOMB, pull, bar, _ALIGNED, found.message)
    reference = known.slip_of_ball(_YOUNG, _POISSON, _FRICTION, found.force, found.contact_radius)
    way, bar = numbers["slip_whole"], numbers["slip_whole_error"] / numbers["slip_whole"]
    yield Row(f"{name}: pull at whole slip (m)", "3D", reference, known.MINDLIN, way, bar, _FINITE, found.message)
