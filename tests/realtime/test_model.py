"""Forces in real time, held against quadrature and against mechanics; what a model does not know it refuses."""

import pickle
from dataclasses import replace
from math import nan, pi, tan

import numpy as np
import pytest
import xarray as xr
from scipy.special import ellipe, ellipk

import epsmesh
from epsmesh_realtime import Friction, History, Model, ModelError, Patch, Tip
from epsmesh_realtime.file import pack, unpack
from epsmesh_realtime.model import about, model_of
from epsmesh_realtime.query import Query, packed_each
from tests.realtime.synthetic import of_place, random_model, write_random, write_surface
from tests.verification import known

TOOLS = (
    ("disc", {"radius": 2e-3}),
    ("sphere", {"radius": 6e-3}),
    ("cone", {"radius": 5e-3, "angle": 1.2}),
    ("blade", {"length": 6e-3, "width": 1e-3}),
)
AT = (0.011, 0.017, 0.0)


def deep(model: Model, name: str, sizes: dict, depth: float = 3e-4, at=AT, **more):
    touch = model.query(name, at=at, depth=depth, **sizes, **more)
    assert touch.status == "ok", touch
    return touch


def rings(c: float, h: float, plane: float, a: float, depth: float, profile, count: int = 400) -> float:
    """Return the force of a tool whose contact has radius ``a``, by rings of constant pressure on a half-space."""
    edges = a * np.sin(np.linspace(0, pi / 2, count + 1))
    r = (edges[1:] + edges[:-1]) / 2

    def disc(b):  # the displacement at r of a unit pressure within b (K. L. Johnson, Contact Mechanics, 3.29)
        inside = np.minimum(r / b, 1) ** 2
        outside = np.minimum(b / r, 1) ** 2
        far = r / b * (ellipe(outside) - (1 - outside) * ellipk(np.minimum(outside, 1 - 1e-15)))
        return 4 * b / (pi * plane) * np.where(r < b, ellipe(inside), far)

    columns = [disc(b) for b in edges[1:]]
    matrix = np.array([c - p for c, p in zip(columns, [0 * r, *columns[:-1]], strict=True)]).T
    areas = pi * np.diff(edges**2)
    matrix += (c + h / 4 * np.add.outer(r**2, r**2)) * areas
    pressure = np.linalg.solve(matrix, depth - profile(r))
    return float(areas @ pressure)


@pytest.mark.parametrize(
    ("name", "sizes", "profile"),
    [
        ("disc", {"radius": 2e-3}, lambda r: 0 * r),
        ("sphere", {"radius": 6e-3}, lambda r: 6e-3 - np.sqrt(36e-6 - r**2)),
        ("cone", {"radius": 5e-3, "angle": 1.2}, lambda r: r / tan(1.2)),
    ],
)
@pytest.mark.parametrize("h", [6e5, -2e5])
def test_a_round_tool_is_that_of_an_integral_equation(name, sizes, profile, h):
    place = (30.0, h, 1 / (1 - 0.45**2))
    touch = deep(of_place(30.0, h, 0.45), name, sizes, 4e-4, (0.0, 0.0, 0.0))
    assert touch.force[2] == pytest.approx(rings(*place, touch.contact_radius, 4e-4, profile), rel=3e-3)
    # Any other circle presses less, or pulls: of these, contact takes the one with the largest force.
    for other in (0.9, 1.1) if name != "disc" else ():
        assert rings(*place, other * touch.contact_radius, 4e-4, profile) < touch.force[2]


def test_a_body_that_is_a_half_space_gives_the_closed_forms():
    model, at = of_place(), (0.0, 0.0, 0.0)
    disc = deep(model, "disc", {"radius": 2e-3}, 1e-4, at).force[2]
    assert disc == pytest.approx(known.half_space_disc(1.0, 0.3, 2e-3, 1e-4, "frictionless")[0])
    ball = deep(model, "sphere", {"radius": 1.0}, 1e-6, at).force[2]
    assert ball == pytest.approx(known.half_space_ball(1.0, 0.3, 1.0, 1e-6), rel=1e-6)
    cone = deep(model, "cone", {"radius": 5e-3, "angle": 1.2}, 1e-4, at).force[2]
    assert cone == pytest.approx(known.half_space_cone(1.0, 0.3, 1.2, 1e-4))
    bonded = deep(model, "disc", {"radius": 2e-3, "contact": "bonded"}, 1e-4, at).force[2]
    assert bonded == pytest.approx(known.half_space_disc(1.0, 0.3, 2e-3, 1e-4, "bonded")[0])


@pytest.mark.parametrize(("name", "sizes"), TOOLS[:3])
@pytest.mark.parametrize("is_round", [False, True])
def test_nor_does_one_over_a_curved_face(name, sizes, is_round):
    model, count = random_model(curved=True, turned=True, is_round=is_round), 64
    tips, forces, depths, aside = [], [], [], []
    for angle in 2 * pi * np.arange(count) / count:
        x, y, depth = 0.01 + 0.004 * np.cos(angle), 0.012 + 0.004 * np.sin(angle), 3e-4 + 1e-4 * np.sin(angle + 1)
        spot = model.spot(x, y)
        at = model.origin + np.array([x, y, spot.height]) @ model.axes
        normal = spot.normal @ model.axes
        forces.append(deep(model, name, sizes, depth, at, axis=-normal).force)
        aside.append(np.linalg.norm(np.cross(forces[-1], normal)) / (forces[-1] @ normal))
        tips.append(at - depth * normal)
        depths.append(depth)
    turns = 1j * np.fft.fftfreq(count, 1 / count)[:, None]
    moved = np.real(np.fft.ifft(turns * np.fft.fft(tips, axis=0), axis=0))
    assert max(aside) > 1e-5
    stored = 0.4 * np.linalg.norm(forces[0]) * depths[0]
    assert abs(2 * pi / count * (np.array(forces) * moved).sum()) < 1e-8 * stored


@pytest.mark.parametrize(("name", "sizes"), TOOLS[:3])
def test_what_is_not_known_of_the_faces_curvature_is_in_the_bar_of_round_tools(name, sizes):
    model, at = random_model(curved=True), (0.01, 0.012)
    place = (*at, model.spot(*at).height)
    touch, known = (deep(of, name, sizes, at=place) for of in (model, replace(model, bend_error=0.0)))
    bend = model.face.bend.copy()
    bend[0, 0] += model.bend_error
    sharper = deep(replace(model, face=replace(model.face, bend=bend)), name, sizes, at=place)
    change = np.linalg.norm(touch.force) - np.linalg.norm(sharper.force)
    assert touch.force_error - known.force_error == pytest.approx(change, rel=0.1, abs=1e-12)


def test_a_slender_blade_is_a_strip():
    model, at, long, short, along = of_place(), (0.0, 0.0, 0.0), 50e-3, 1e-3, np.array([0.6, 0.8, 0.0])
    touch = deep(model, "blade", {"length": 2 * long, "width": 2 * short, "along": along}, 1e-4, at)
    # It is more than the ellipse within, and less than the one round it (A. E. Green and I. N. Sneddon, 1950).
    ellipse, _ = known.half_space_ellipse(1.0, 0.3, (long, short), 1e-4)
    assert ellipse < touch.force[2] < 2**0.5 * ellipse
    across = {"length": 2 * short, "width": 2 * long, "along": (-along[1], along[0], 0.0)}
    assert deep(model, "blade", across, 1e-4, at).force[2] == touch.force[2]
    assert model.query("blade", at=at, depth=1e-4, length=60 * short, width=short).status == "tool"
    # h lowers what is far from the axis: pressure falls towards the ends of a blade from what it is on a segment, where
    # it is the same all along, so that the mean of x² along the edge is between l²/3 and l²/2.
    h, soft = 1e-3 / touch.force[2] / long**2, 1e-4 / touch.force[2]
    more = 1e-4 / deep(of_place(0.0, h), "blade", {"length": 2 * long, "width": 2 * short}, 1e-4, at).force[2] - soft
    assert h * long**2 / 3 / 2 < more < h * long**2 / 2 / 2


@pytest.mark.parametrize(("name", "sizes"), TOOLS)
def test_stiffness_is_the_slope_of_the_force(name, sizes):
    model, step = random_model(), 1e-8
    up, down = (deep(model, name, sizes, 3e-4 + s).force[2] for s in (step, -step))
    assert deep(model, name, sizes).stiffness == pytest.approx((up - down) / (2 * step), rel=1e-5)


@pytest.mark.parametrize(("name", "sizes"), TOOLS)
def test_force_goes_with_the_modulus_and_the_frame(name, sizes, tmp_path):
    model, turned = random_model(), write_random(tmp_path / "turned.epsm", turned=True)
    touch = deep(model, name, sizes)
    assert deep(model, name, sizes, young=30e3).force == pytest.approx(3 * touch.force)
    at = turned.origin + turned.axes.T @ np.array(AT)
    other = deep(turned, name, sizes, at=at, axis=-turned.axes[2])
    assert turned.axes @ other.force == pytest.approx(touch.force)
    assert other.force_error == pytest.approx(touch.force_error)
    assert deep(model, name, sizes, poisson=0.3).force[2] != pytest.approx(touch.force[2], rel=1e-3)


@pytest.mark.parametrize(("name", "sizes"), TOOLS)
def test_contact_is_lost_and_regained(name, sizes):
    model = random_model()
    lost = model.query(name, at=AT, depth=-1e-4, **sizes)
    assert lost.status == "no contact"
    assert not lost.force.any()
    forces = [deep(model, name, sizes, depth).force[2] for depth in (1e-9, 1e-6, 1e-4)]
    assert 0 < forces[0] < forces[1] < forces[2]


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ({"at": (0.0301, 0.0, 0.0)}, "outside"),
        ({"at": (0.0, 0.0, 1e-3)}, "off"),
        ({"at": (nan, 0.0, 0.0)}, "input"),
        ({"at": (0.0, 0.0)}, "input"),
        ({"depth": nan}, "input"),
        ({"depth": 0.02}, "deep"),
        ({"young": 0.0}, "input"),
        ({"poisson": 0.2}, "poisson"),
        ({"axis": (0.1, 0.0, -1.0)}, "tilted"),
        ({"axis": (0.0, 0.0, 1.0)}, "tilted"),
        ({"axis": (0.0, 0.0, 0.0)}, "input"),
        ({"radius": -1.0}, "input"),
        ({"radius": nan}, "tool"),
        ({"radius": 0.012}, "large"),
        ({"at": (0.0, 0.0249, 0.0), "radius": 3e-3}, "large"),
        ({"tool": "blade"}, "tool"),
        ({"tool": "cone"}, "tool"),
        ({"tool": "sphere", "radius": 2e-3, "depth": 2e-3}, "large"),
    ],
)
def test_what_a_model_does_not_know_it_refuses(query, status):
    asked = {"tool": "disc", "radius": 2e-3, "at": AT, "depth": 1e-4} | query
    touch = random_model().query(asked.pop("tool"), **asked)
    assert touch.status == status
    assert touch.message
    assert np.isnan([*touch.force, touch.force_error, touch.stiffness, touch.contact_radius]).all()


def test_no_part_of_a_file_is_a_model(tmp_path):
    write_random(tmp_path / "model.epsm")
    data = (tmp_path / "model.epsm").read_bytes()
    model_of(data)
    for size in range(0, len(data), 7):
        with pytest.raises(ModelError):
            model_of(data[:size])
    order = data[:12] + data[12:16][::-1] + data[16:]
    for foreign in (b"", b"CDF\x02" + data[4:], data[:8] + b"\xff" * 400, order, data + bytes(8)):
        with pytest.raises(ModelError):
            model_of(foreign)


@pytest.mark.parametrize("kind", [{}, {"curved": True}])
def test_a_damaged_file_is_no_model_or_answers_with_a_status(tmp_path, kind):
    write_random(tmp_path / "model.epsm", **kind)
    data, rng, loaded = (tmp_path / "model.epsm").read_bytes(), np.random.default_rng(9), 0
    for number in range(400):
        bad = bytearray(data)
        for place in rng.integers(0, len(data) if number % 2 else 3000, rng.integers(1, 4)):
            bad[place] = rng.integers(256)
        try:
            model = model_of(bytes(bad))
        except ModelError as problem:
            assert str(problem)
            continue
        loaded += 1
        for tool, sizes in TOOLS:
            touch = model.query(tool, at=model.origin, depth=1e-4, **sizes)
            assert touch.message or touch.status == "ok"
            assert np.isfinite(touch.force).all() == (touch.status in ("ok", "no contact"))
    assert loaded > 20


def test_a_curved_face_says_how_well_it_is_known(tmp_path):
    for curved in (False, True):
        write_random(tmp_path / "model.epsm", curved=curved)
        without = (tmp_path / "model.epsm").read_bytes().replace(b"bend_error", b"bend_other")
        if not curved:
            assert model_of(without).bend_error == 0
            continue
        with pytest.raises(ModelError, match="bend_error"):
            model_of(without)


def test_tables_that_make_no_sense_give_a_status():
    model = random_model()
    table = replace(model.table, reciprocal=-model.table.reciprocal)
    touch = replace(model, table=table).query("disc", radius=2e-3, at=AT, depth=1e-4)
    assert touch.status == "damaged"


def test_a_model_and_a_touch_print_what_they_are_in_a_line():
    model = random_model()
    assert len(repr(model)) < 200
    assert f"E = {model.young:.4g} Pa" in repr(model)
    touch = model.query("disc", at=(1e3, 0.0, 0.0), depth=1e-4, radius=1e-3)
    assert touch.message in repr(touch)


def test_a_model_can_be_sent_to_another_process(tmp_path):
    surface, asked = write_surface(tmp_path / "model.epsm"), {"at": AT, "depth": 1e-4, "radius": 1e-3}
    touch, moved = surface.press("disc", **asked)
    sent = pickle.loads(pickle.dumps(surface))
    assert np.array_equal(sent.model.query("disc", **asked).force, touch.force)
    assert np.array_equal(sent.press("disc", **asked)[1], moved)


def test_a_query_with_a_word_that_there_is_not_is_refused():
    with pytest.raises(TypeError, match="raduis"):
        random_model().query("disc", at=(0.0, 0.0, 0.0), depth=1e-4, raduis=1e-3)
    for wrong in ({"radius": "2 mm"}, {"depth": None}, {"young": "10 kPa"}):
        with pytest.raises(TypeError, match=f"SI units.*{next(iter(wrong.values()))}"):
            random_model().query("disc", **({"at": AT, "depth": 1e-4, "radius": 1e-3} | wrong))


def test_a_model_has_the_numbers_of_its_file(tmp_path):
    write_random(tmp_path / "model.epsm")
    data = (tmp_path / "model.epsm").read_bytes()
    found = unpack(data)
    numbers = model_of(data).numbers()
    assert {"reciprocal", "tensors", "bar", "young", "pair_links"} <= set(numbers) <= {*found}
    for name, values in numbers.items():
        np.testing.assert_array_equal(values, found[name])
    assert about(found) == {"title": "random"}
    for text in (b"[" * 100_000, b"[1]", b'{"title": 1}', b"\xff"):
        with pytest.raises(ModelError, match="about"):
            about({"about": np.frombuffer(text, np.uint8)})
    for name, values in (("a" * 32, 1.0), ("empty", np.zeros(0)), ("deep", np.zeros((1,) * 5))):
        with pytest.raises(ValueError, match=name):
            pack({name: values})


@pytest.mark.parametrize("kind", [{}, {"is_round": True}, {"curved": True, "is_even": False}])
@pytest.mark.parametrize(("name", "sizes"), TOOLS)
def test_many_queries_in_one_call_are_those_of_many_calls(name, sizes, kind):
    model, rng, count = random_model(**kind), np.random.default_rng(3), 60
    x, y = (rng.uniform(-0.031, 0.031, (count, 2)) * (1, 0.8)).T
    places = np.column_stack([x, y, [model.spot(*place).height for place in zip(x, y, strict=True)]])
    varied = {
        "at": places,
        "depth": rng.uniform(-1e-5, 4e-4, count),
    }
    if "curved" not in kind:
        varied["axis"] = rng.integers(0, 2, (count, 3)) * (0, 0, -1)
    asked = sizes | ({"along": rng.standard_normal((count, 3))} if name == "blade" else {})
    touches = model.query_many(name, **varied, **asked, poisson=0.4)
    assert set(touches.status) >= {"ok", "no contact", "outside" if "curved" in kind else "input"}
    side_by_side = model.query_many(name, **varied, **asked, poisson=0.4, threads=3)
    np.testing.assert_array_equal(side_by_side.force, touches.force)
    np.testing.assert_array_equal(side_by_side.status, touches.status)
    for number, status in enumerate(touches.status):
        own = {key: np.asarray(value)[number] if np.ndim(value) else value for key, value in (varied | asked).items()}
        touch = model.query(name, **own, poisson=0.4)
        assert touch.status == status
        np.testing.assert_array_equal(touches.force[number], touch.force)
        for field in ("force_error", "stiffness", "contact_radius"):
            np.testing.assert_array_equal(getattr(touches, field)[number], getattr(touch, field))


def test_packed_queries_may_have_gaps_and_are_nothing_else():
    query = Query("disc", radius=2e-3, at=AT, depth=np.linspace(1e-5, 1e-4, 6))
    evaluator, packed = random_model().evaluator, packed_each(query, 1e3, 0.4)
    whole, part = evaluator.touch_each(packed), evaluator.touch_each(packed[::2])
    np.testing.assert_array_equal(part.force, whole.force[::2])
    assert np.isfinite(part.force).all()
    with pytest.raises(TypeError, match="a packed query has 136 bytes"):
        evaluator.touch_each(np.zeros(6))


def test_queries_whose_shapes_do_not_go_together_are_refused():
    with pytest.raises(ValueError, match="threads must be at least 1, not 0"):
        random_model().query_many("disc", at=AT, depth=1e-4, radius=1e-3, threads=0)
    assert random_model().query_many("disc", at=np.zeros((0, 3)), depth=1e-4, radius=1e-3, threads=2).force.shape == (
        0,
        3,
    )
    for at, depth in ((np.zeros((4, 3)), np.zeros(5)), (np.zeros((4, 2)), 1e-4), (np.zeros((2, 2, 3)), 1e-4)):
        with pytest.raises(ValueError, match="shape"):
            random_model().query_many("disc", at=at, depth=depth, radius=1e-3)


@pytest.mark.parametrize("kind", [{}, {"is_round": True}, {"curved": True}])
def test_a_model_is_a_dataset_too(tmp_path, kind):
    path = tmp_path / "model.epsm"
    surface = write_surface(path, **kind)
    dataset = epsmesh.open(path)
    dataset.to_netcdf(tmp_path / "model.nc")
    with xr.open_dataset(tmp_path / "model.nc") as again:
        xr.testing.assert_equal(again.load(), dataset)
    assert dataset.attrs["title"] == "random"
    assert (dataset["young"].item(), dataset["young"].units) == (surface.model.young, "Pa")
    assert dataset["reciprocal"].dims == ("poisson_node", "v", "u")
    assert dataset["surface_modes"].dims == ("vertex", "component", "mode")
    arrays = unpack(path.read_bytes())
    path.write_bytes(pack(arrays | {"check_x": np.zeros(3), "check_y": np.zeros(4)}))
    with pytest.raises(ModelError, match="damaged"):
        epsmesh.open(path)


def test_a_bar_is_a_force_in_newtons_whoever_answers():
    model, place = random_model(), {"at": AT, "depth": 1e-4}
    asked = [{"tool": tool, **sizes, **place} for tool, sizes in TOOLS]
    tip = Tip(lambda x, y: 30 * x**2 + 120 * y**2, 4e-3)
    relaxing = replace(model, relaxation=((0.4, 2.0),))

    def bars(young):
        touches = [model.query(young=young, **one) for one in asked]
        touches += model.query_all([asked[0]], young=young)
        touches += [Patch(model, tip).query(**place, young=young)]
        touches += [History(relaxing).query(0.5, young=young, **asked[0])]
        touches += [Friction(model, 0.3).query(young=young, **asked[0]).touch]
        assert {touch.status for touch in touches} == {"ok"}
        return np.array([touch.force_error for touch in touches])

    np.testing.assert_allclose(bars(2e4), 2 * bars(1e4), rtol=1e-9)
