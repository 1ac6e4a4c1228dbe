"""Several tools at once: one energy, the closed forms of a half-space, and refusals, never a wrong number."""

from dataclasses import replace
from math import asin, nan, pi

import numpy as np
import pytest

from epsmesh_realtime import ModelError
from epsmesh_realtime.evaluator import Evaluator
from epsmesh_realtime.model import Model, model_of
from epsmesh_realtime.table import Pairs
from tests.realtime.synthetic import of_place, random_model, write_random

TOOLS = (
    {"tool": "disc", "radius": 1.5e-3},
    {"tool": "sphere", "radius": 6e-3},
    {"tool": "cone", "radius": 5e-3, "angle": 1.2},
    {"tool": "blade", "length": 4e-3, "width": 1e-3, "along": (0.6, 0.8, 0.0)},
)
FIRST, SECOND = (-0.006, 0.004, 0.0), (0.009, -0.002, 0.0)


def together(model: Model, *tools: dict, **more) -> list:
    touches = model.query_all(tools, **more)
    assert all(touch.status == "ok" for touch in touches), touches
    return touches


@pytest.mark.parametrize("ratio", [4.0, 6.0, 20.0])
def test_two_discs_on_a_half_space(ratio):
    model, a = of_place(0.0, 0.0, 0.4, pairs=True), 1e-3
    disc = {"tool": "disc", "radius": a, "depth": 1e-4}
    touches = together(model, disc | {"at": (0, 0, 0)}, disc | {"at": (0.6 * ratio * a, 0.8 * ratio * a, 0)})
    alone = model.query(**disc, at=(0, 0, 0)).force[2]
    sunk = 2 / pi * asin(1 / ratio)
    for touch in touches:
        bar = touch.force_error / touch.force[2]
        # A disc sinks the middle of the other by this, and what is round that by a (a/D)²/6 more.
        assert touch.force[2] == pytest.approx(alone / (1 + sunk), rel=bar + sunk / (6 * ratio**2))
        assert touch.force[2] == pytest.approx(alone / (1 + sunk + 2 / pi / (6 * ratio**3)), rel=bar)
        assert bar < 0.2 * sunk / ratio
    # Each is drawn towards the other one: there the face is lower.
    assert touches[0].force[:2] == pytest.approx(-touches[1].force[:2])
    assert touches[0].force[:2] @ (0.6, 0.8) > 0


def test_a_tool_by_itself_is_that_of_a_query():
    model = random_model()
    for tool in (*TOOLS, {"tool": "disc", "radius": 2e-3, "contact": "bonded"}):
        asked = tool | {"at": FIRST, "depth": 2e-4}
        (touch,) = model.query_all([asked], young=5e3, poisson=0.33)
        own = model.query(**asked, young=5e3, poisson=0.33)
        assert np.array_equal(touch.force, own.force)
        assert (touch.force_error, touch.stiffness, touch.contact_radius) == (
            own.force_error, own.stiffness, own.contact_radius,
        )  # fmt: skip
    assert model.query_all([]) == []


def energy(model: Model, tools: list[dict], depths: np.ndarray) -> float:
    """Return the work of pressing all tools straight down at once, each in proportion to its depth."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    shares = ((nodes + 1) / 2) ** 2  # forces of round tools begin with a root
    found = 0.0
    for share, weight, node in zip(shares, weights / 2, (nodes + 1) / 2, strict=True):
        asked = [tool | {"depth": share * depth} for tool, depth in zip(tools, depths, strict=True)]
        forces = [touch.force[2] for touch in together(model, *asked)]
        found += weight * 2 * node * float(np.dot(forces, depths))
    return found


@pytest.mark.parametrize("pair", [(0, 0), (0, 1), (1, 2), (3, 1), (3, 3)])
@pytest.mark.parametrize("is_round", [False, True])
def test_forces_are_slopes_of_one_energy(pair, is_round):
    model = random_model(is_round=is_round)
    tools = [TOOLS[pair[0]] | {"at": FIRST}, TOOLS[pair[1]] | {"at": SECOND}]
    depths = np.array([2e-4, 3e-4])
    touches = together(model, *(tool | {"depth": depth} for tool, depth in zip(tools, depths, strict=True)))
    step = 2e-5
    for number, axis in ((0, 0), (0, 1), (1, 0), (1, 1)):
        moved = []
        for way in (-2 * step, -step, step, 2 * step):
            at = list(tools[number]["at"])
            at[axis] += way
            others = list(tools)
            others[number] = tools[number] | {"at": at}
            moved.append(energy(model, others, depths))
        slope = -(moved[0] - 8 * moved[1] + 8 * moved[2] - moved[3]) / (12 * step)
        assert touches[number].force[axis] == pytest.approx(slope, abs=1e-6 * touches[number].force[2])
    for number in range(2):
        up, down = (
            together(model, *(
                tool | {"depth": depth + way * (other == number)}
                for other, (tool, depth) in enumerate(zip(tools, depths, strict=True))
            ))[number].force[2]
            for way in (1e-9, -1e-9)
        )  # fmt: skip
        assert touches[number].stiffness == pytest.approx((up - down) / 2e-9, rel=1e-5)


@pytest.mark.parametrize("pair", [(0, 1), (3, 2)])
@pytest.mark.parametrize("is_round", [False, True])
def test_two_tools_on_a_curved_face_yield_no_work_on_a_closed_path(pair, is_round):
    model, count = random_model(curved=True, turned=True, is_round=is_round), 64
    turns, apart = 2 * pi * np.arange(count) / count, []
    tips, forces = np.empty((2, 2, count, 3))
    for step, angle in enumerate(turns):
        asked = []
        for number, way in enumerate((1, -2)):
            x, y = 0.013 * (-1) ** number + 3e-3 * np.cos(angle), 0.004 + 3e-3 * np.sin(way * angle)
            depth, spot = 3e-4 + 1e-4 * np.sin(angle + number), model.spot(x, y)
            at = model.origin + np.array([x, y, spot.height]) @ model.axes
            tips[number, step] = at - depth * spot.normal @ model.axes
            asked.append(TOOLS[pair[number]] | {"at": at, "depth": depth, "axis": -spot.normal @ model.axes})
        touches = together(model, *asked)
        forces[:, step] = [touch.force for touch in touches]
        apart.append(1 - np.linalg.norm(touches[0].force) / np.linalg.norm(model.query(**asked[0]).force))
    assert max(apart) > 0.01
    waves = 1j * np.fft.fftfreq(count, 1 / count)[:, None]
    moved = np.real(np.fft.ifft(waves * np.fft.fft(tips, axis=1), axis=1))
    work = (forces * moved).sum(axis=(1, 2)) * 2 * pi / count
    stored = 0.4 * np.linalg.norm(forces[:, 0], axis=1) @ [3e-4, 3e-4]
    assert abs(work.sum()) < 1e-7 * stored
    # Each by itself does: what the one loses, the other gains.
    assert abs(work[0]) > 1e-4 * stored


def test_two_tools_feel_each_other_alike():
    """E. Betti, 1872: what the one changes of the other's force as it goes down, the other changes of its."""
    model, step = random_model(), 1e-8
    tools = [TOOLS[0] | {"at": FIRST, "depth": 2e-4}, TOOLS[1] | {"at": SECOND, "depth": 3e-4}]

    def forces(*more: float) -> np.ndarray:
        asked = [tool | {"depth": tool["depth"] + by} for tool, by in zip(tools, more, strict=True)]
        return np.array([touch.force[2] for touch in together(model, *asked)])

    of_second = (forces(0, step) - forces(0, -step))[0]
    of_first = (forces(step, 0) - forces(-step, 0))[1]
    assert of_first == pytest.approx(of_second, rel=1e-6)
    assert of_first < 0


def test_a_tool_may_lose_the_face_to_another_one():
    model = of_place(0.0, 0.0, 0.4, pairs=True)
    light = {"tool": "sphere", "radius": 1e-3, "at": (8e-3, 0, 0), "depth": 2e-5}
    heavy = {"tool": "disc", "radius": 2e-3, "at": (0, 0, 0), "depth": 4e-4}
    assert model.query(**light).status == "ok"
    touches = model.query_all([light, heavy])
    assert [touch.status for touch in touches] == ["no contact", "ok"]
    assert not touches[0].force.any()
    own = model.query(**heavy)
    assert touches[1].force == pytest.approx(own.force, rel=1e-12)
    assert touches[1].stiffness == pytest.approx(own.stiffness, rel=1e-12)
    above = light | {"depth": -1e-4, "at": (1e-4, 0, 0)}
    assert [touch.status for touch in model.query_all([above, heavy])] == ["no contact", "ok"]


def test_where_a_force_lifts_the_face_a_tool_above_it_may_be_touched():
    model = of_place(0.0, 0.0, 0.4, pairs=True)
    lifting = replace(model.pairs, modes=np.ones((1, 1, 1)), links=np.full((1, 1, 1), -40.0))
    model = replace(model, pairs=lifting)
    near = {"tool": "disc", "radius": 2e-3, "at": (0, 0, 0), "depth": 4e-4}
    above = {"tool": "sphere", "radius": 1e-2, "at": (8e-2, 0, 0), "depth": -1e-6}
    assert [touch.status for touch in model.query_all([near, above])] == ["ok", "ok"]
    assert model.query_all([near, above | {"depth": -1e-4}])[1].status == "no contact"


def test_many_tools_come_to_rest():
    model = random_model()
    places = [(x, y, 0.0) for x in (-0.02, -0.006, 0.008, 0.022) for y in (-0.008, 0.009)]
    tools = [TOOLS[n % 3] | {"at": place, "depth": 1e-4 * (1 + n)} for n, place in enumerate(places)]
    touches = together(model, *tools)
    # Each at the depth that the others leave it: two tools at a time are not enough.
    pairs = together(model, *tools[:2])
    assert touches[0].force[2] != pytest.approx(pairs[0].force[2], rel=1e-3)
    back = together(model, *tools[::-1])[::-1]
    for touch, other in zip(touches, back, strict=True):
        assert touch.force == pytest.approx(other.force, rel=1e-10, abs=1e-12)


def test_bars_hold_what_they_are_made_of():
    """A table that is off by what the file says, and models of one tool that are off by theirs."""
    model, rng = random_model(), np.random.default_rng(3)
    tools = [TOOLS[0] | {"at": FIRST, "depth": 2e-4}, TOOLS[1] | {"at": SECOND, "depth": 3e-4}]
    touches = together(model, *tools)
    rank = len(model.pairs.modes)
    for sign in (-1.0, 1.0):
        flat = np.zeros((1, *model.pairs.modes.shape[1:]))
        flat[0, 0, 0] = 1.0
        links = np.zeros((len(model.pairs.links), rank + 1, rank + 1))
        links[:, :rank, :rank] = model.pairs.links
        rooms = [model.room(*tool["at"][:2]) for tool in tools]
        links[0, rank, rank] = sign * model.pairs.error / np.sqrt(rooms[0] * rooms[1])
        off = replace(model.pairs, modes=np.concatenate([model.pairs.modes, flat]), links=links)
        for touch, other in zip(touches, together(replace(model, pairs=off), *tools), strict=True):
            assert abs(other.force[2] - touch.force[2]) < touch.force_error
    depths = [tool | {"depth": tool["depth"] * (1 + rng.uniform(-1, 1) * 1e-3)} for tool in tools]
    for touch, other in zip(touches, together(model, *depths), strict=True):
        assert abs(other.force[2] - touch.force[2]) < touch.force_error
    for tool, touch in zip(tools, touches, strict=True):
        alone = model.query(**tool)
        assert touch.force_error / touch.force[2] > alone.force_error / alone.force[2]
    sticks = tools[0] | {"contact": "bonded"}
    bonded = together(model, sticks, tools[1])
    pulled = 4 * 1.5e-3 / (1.45 * 1.55) * 0.2 / np.hypot(0.015, 0.006) * bonded[1].force[2] / bonded[0].force[2]
    alone = model.query(**sticks)
    assert bonded[0].force_error / bonded[0].force[2] > alone.force_error / alone.force[2] + pulled


@pytest.mark.parametrize(
    ("change", "statuses"),
    [
        ({"at": (FIRST[0] + 5.9e-3, FIRST[1], 0.0)}, ("near", "near", "others")),
        ({"at": FIRST}, ("near", "near", "others")),
        ({"at": (0.0301, 0.0, 0.0)}, ("others", "outside", "others")),
        ({"depth": nan}, ("others", "input", "others")),
        ({"depth": 0.02}, ("others", "deep", "others")),
        ({"radius": 0.012}, ("others", "large", "others")),
        ({"tool": "cone"}, ("others", "tool", "others")),
        ({"axis": (0.1, 0.0, -1.0)}, ("others", "tilted", "others")),
    ],
)
def test_what_is_not_known_of_one_tool_is_known_of_none(change, statuses):
    disc = {"tool": "disc", "radius": 1.5e-3, "depth": 1e-4}
    tools = [disc | {"at": FIRST}, disc | {"at": SECOND} | change, disc | {"at": (0.0, 0.02, 0.0)}]
    touches = random_model().query_all(tools)
    assert tuple(touch.status for touch in touches) == statuses
    for touch in touches:
        assert touch.message
        assert np.isnan([*touch.force, touch.force_error, touch.stiffness, touch.contact_radius]).all()
    assert random_model().query_all(tools[::2], poisson=0.2)[0].status == "poisson"


def test_a_model_that_knows_one_tool_says_so(tmp_path):
    tools = [TOOLS[0] | {"at": FIRST, "depth": 1e-4}, TOOLS[0] | {"at": SECOND, "depth": 1e-4}]
    write_random(tmp_path / "model.epsm")
    data = (tmp_path / "model.epsm").read_bytes()
    older = model_of(data.replace(b"pair_", b"rope_"))
    assert [touch.status for touch in older.query_all(tools)] == ["alone", "alone"]
    assert older.query_all(tools)[0].message
    assert older.query_all(tools[:1])[0].status == "ok"
    assert model_of(data).query_all(tools)[0].status == "ok"
    with pytest.raises(ValueError, match="at most 16"):
        model_of(data).query_all(tools * 9)
    for name in (b"pair_modes", b"pair_links", b"pair_error", b"pair_aside"):
        with pytest.raises(ModelError, match=name.decode()):
            model_of(data.replace(name, b"rope_" + name[5:]))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("links", lambda pairs: pairs.links + np.eye(4, k=1)),
        ("links", lambda pairs: pairs.links[:, :3, :3]),
        ("links", lambda pairs: np.concatenate([pairs.links, pairs.links])),
        ("modes", lambda pairs: np.full_like(pairs.modes, nan)),
        ("modes", lambda pairs: np.zeros((97, 5, 5))),
        ("error", lambda pairs: -1.0),
        ("aside", lambda pairs: nan),
    ],
)
def test_pairs_that_are_none_are_no_model(name, value):
    model = random_model()
    found = model.numbers()
    assert Pairs.of(found).error == model.pairs.error
    with pytest.raises(ModelError, match="pair_"):
        Evaluator.of(found | {f"pair_{name}": value(model.pairs)})
    one = {each: found[each][:1] for each in ("reciprocal", "curvature")} | {"tensors": found["tensors"][:, :1]}
    with pytest.raises(ModelError, match="pair_links"):
        Evaluator.of(found | one | {"poisson_range": (0.4, 0.4), "poisson": 0.4})


def test_tables_that_make_no_sense_give_a_status():
    model = random_model()
    tools = [TOOLS[0] | {"at": FIRST, "depth": 1e-4}, TOOLS[1] | {"at": SECOND, "depth": 1e-4}]
    for links in (1e300 * np.ones_like(model.pairs.links), -1e9 * np.ones_like(model.pairs.links)):
        with np.errstate(all="ignore"):
            touches = replace(model, pairs=replace(model.pairs, links=links)).query_all(tools)
        for touch in touches:
            assert touch.status != "ok" or np.isfinite([*touch.force, touch.force_error, touch.stiffness]).all()
    table = replace(model.table, reciprocal=-model.table.reciprocal)
    assert [touch.status for touch in replace(model, table=table).query_all(tools)] == ["damaged", "damaged"]
