"""Contract of every shape: its properties are compared with each other and with a mesh.

A new shape is found in the registry, with the examples in its own words; nothing needs to be added here.
"""

import tomllib
from dataclasses import replace
from itertools import pairwise, product
from math import cos, inf, pi, sin

import gmsh
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from epsmesh.compat import gmsh_session
from epsmesh.mesh.curve import EDGES, curve
from epsmesh.mesh.generate import generate
from epsmesh.mesh.size import Sizes
from epsmesh.plan.key import case_key, normalised, reference_key
from epsmesh.scene.model import Scene
from epsmesh.shapes.body import Body, Drawn, Layered
from epsmesh.shapes.frame import Frame
from epsmesh.shapes.probe import PLANES, Probe
from epsmesh.shapes.registry import BODIES, PROBES, specialised
from epsmesh.shapes.section import words_of
from epsmesh.study.problems import StudyError
from tests.cases import study

# A body that is not drawn has a file: see tests/shapes/test_scanned.py.
DRAWN = {name: model for name, model in BODIES.items() if issubclass(model, Drawn)}
SUPPORTS = ("bottom", "sides", "bottom+sides", {"below": "-6 mm"})
SIZES = Sizes(epsilon=inf, fine=3e-3, coarse=6e-3, rim=0.4e-3, growth=0.6)


def example(model, **changes):
    """Return a shape made from the examples in its own words."""
    required = {name for name, field in model.model_fields.items() if field.is_required()} - {"shape"}
    examples = tomllib.loads("\n".join(f"{name} = {words_of(model, name).example}" for name in sorted(required)))
    (shape,) = model.model_fields["shape"].annotation.__args__
    given = {name: tuple(value) if isinstance(value, list) else value for name, value in examples.items()}
    return specialised(model.model_validate({"shape": shape} | given | changes))


def body(shape: str, fixed=None) -> Body:
    """Return an example, with its bottom fixed if it has one."""
    has_faces = not BODIES[shape].model_fields["fixed"].is_required()
    return example(BODIES[shape], **({"fixed": fixed or "bottom"} if fixed or has_faces else {}))


def supports(shape: str) -> tuple:
    """Return the supports to test."""
    return SUPPORTS if not BODIES[shape].model_fields["fixed"].is_required() else SUPPORTS[3:]


def has_edges(body: Body) -> bool:
    return np.isfinite(body.gap((0.0, 0.0, 0.0)))


def probe(shape: str, **changes) -> Probe:
    """Return an example, oblique to the axes if it has a direction."""
    turned = {"direction": (1.0, 2.0, 0.0)} if "direction" in PROBES[shape].model_fields else {}
    return example(PROBES[shape], **turned, **changes)


@pytest.fixture(params=DRAWN)
def a_body(request) -> Body:
    return body(request.param)


ROUNDED = {"edge": "0.45 mm", "contact": "unilateral"}
TOOLS = {name: (name, {}) for name in PROBES} | {
    "rounded disc": ("disc", ROUNDED),
    "rounded blade": ("blade", ROUNDED),
    "three faces": ("pyramid", {"sides": 3, "tip": "0.3 mm"}),
    "wedge with rounded ends": ("wedge", ROUNDED | {"tip": "0.5 mm"}),
}


@pytest.fixture(params=TOOLS)
def a_probe(request) -> Probe:
    shape, changes = TOOLS[request.param]
    return probe(shape, **changes)


# By day a disc on every body, and every tool on a box.
PAIRS = [
    pytest.param(pair, id="-".join(pair), marks=() if "box" in pair or "disc" in pair else pytest.mark.nightly)
    for pair in product(DRAWN, PROBES)
]


@pytest.fixture(scope="module", params=PAIRS)
def meshed(request):
    """A scene off centre with straight elements, and its mesh."""
    shapes = body(request.param[0]), probe(request.param[1], at=("3 mm", "-2 mm"))
    scene = Scene(*shapes, rim_segments=SIZES.rim_segments(shapes[1]), straight=True)
    return scene, generate(scene, SIZES)


def on_outline(mesh, group):
    return mesh.points[np.unique(mesh.facets[group])]


# ---- bodies -----------------------------------------------------------------------------------------


def test_volume_extent_and_heights_are_those_of_what_is_drawn(meshed):
    scene, mesh = meshed
    corners = mesh.points[mesh.cells]
    volume = float(np.linalg.det(corners[:, 1:] - corners[:, :1]).sum() / 6)
    assert volume == pytest.approx(scene.body.volume, rel=0.03)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    assert (low[2], high[2]) == pytest.approx(scene.body.heights, abs=1e-9 if has_edges(scene.body) else 1e-4)
    assert max(high - low) <= 1.0001 * scene.body.extent <= 2.5 * max(high - low)


def test_every_point_of_the_boundary_is_on_a_surface_and_projects_to_itself(meshed):
    scene, mesh = meshed
    surfaces = [surface for group in scene.body.surfaces().values() for surface in group]
    points = np.vstack([on_outline(mesh, group) for group in mesh.facets])
    distance = np.abs([surface.distance(points) for surface in surfaces])
    assert distance.min(axis=0).max() < 1e-9
    for surface, off in zip(surfaces, distance, strict=True):
        on = points[off < 1e-9]
        assert len(on)
        np.testing.assert_allclose(surface.project(on), on, atol=1e-12)
        moved = on + 1e-4 * np.random.default_rng(1).normal(size=on.shape)
        assert np.abs(surface.distance(surface.project(moved))).max() < 1e-12
        assert np.linalg.norm(surface.project(moved) - moved, axis=1) == pytest.approx(np.abs(surface.distance(moved)))


def test_reach_thickness_and_farthest_hold_all_of_the_body(meshed):
    scene, mesh = meshed
    local = scene.frame.local(mesh.points)
    assert np.hypot(local[:, 0], local[:, 1]).max() == pytest.approx(scene.body.reach(scene.frame), rel=0.01)
    flat = 1e-9 if has_edges(scene.body) else 0.02
    assert -local[:, 2].min() == pytest.approx(scene.body.thickness(scene.frame), rel=flat)
    assert 1 <= scene.body.farthest(scene.frame) / np.linalg.norm(local, axis=1).max() < 1.01


@pytest.mark.parametrize("shape", [name for name, model in DRAWN.items() if issubclass(model, Layered)])
def test_what_is_below_its_layers_is_a_lower_body(shape):
    """The support stays at its place; the other layers, and the rest of the body, too."""
    sizes = (("a", "2 mm"), ("b", "3 mm"))
    layers = tuple({"name": name, "thickness": size, "young": "1 kPa", "poisson": 0.3} for name, size in sizes)
    whole = example(DRAWN[shape], layer=layers, fixed={"below": "-9 mm"})
    for number, depth in ((1, 2e-3), (2, 5e-3)):
        found = whole.below(number)
        low, top = whole.heights
        assert found.heights == pytest.approx((low + depth, top))
        assert found.volume / whole.volume == pytest.approx((top - depth - low) / (top - low))
        assert found.hold.edges() == pytest.approx([-9e-3 + depth])
        assert found.interfaces == pytest.approx([end + depth for end in whole.interfaces[number:]])
        assert found.layer == whole.layer[number:]


def test_a_curved_surface_says_how_much(a_body):
    curved = [surface for group in a_body.surfaces().values() for surface in group if surface.is_curved]
    assert np.isfinite(a_body.bend) == bool(curved)


def test_outline_lies_on_the_body(a_body):
    points = np.vstack(a_body.outline())
    surfaces = [surface for group in a_body.surfaces().values() for surface in group]
    on = int(has_edges(a_body))  # an edge joins two
    assert np.sort(np.abs([s.distance(points) for s in surfaces]), axis=0)[on].max() < 1e-9
    extent = np.ptp(points, axis=0).max()
    assert extent <= 1.0001 * a_body.extent <= 2.5 * extent


@pytest.mark.parametrize(("shape", "fixed"), [(shape, fixed) for shape in DRAWN for fixed in supports(shape)], ids=str)
def test_mirror_planes_and_half_plane_are_true(shape, fixed):
    """Mirror images of boundary points are on the boundary, and fixed where the points are."""
    found, random = body(shape, fixed), np.random.default_rng(2)
    surfaces = found.surfaces()
    images = [np.diag(1 - 2 * np.array(PLANES[plane])) for plane in found.mirror_planes]
    if found.half_plane() is not None:
        images += [np.array([[cos(t), -sin(t), 0], [sin(t), cos(t), 0], [0, 0, 1]]) for t in random.uniform(0, 7, 5)]
    for surface in (surface for group in surfaces.values() for surface in group):
        points = surface.project(random.uniform(-1, 1, (40, 3)) * found.extent)
        for image in images:
            at = points @ image.T
            off = np.min([np.abs(other.distance(at)) for group in surfaces.values() for other in group], axis=0)
            assert off.max() < 1e-12
            held = [found.hold.holds(surfaces, point[None], 1e-9) for point in points]
            assert held == [found.hold.holds(surfaces, point[None], 1e-9) for point in at]


def test_the_middle_is_the_axis_and_what_is_round_has_no_corner(a_body):
    for along, half in zip(np.eye(3)[:2], a_body.half_sides, strict=True):
        just = np.array([0.0, 0.0, sum(a_body.heights) / 2]) + np.outer([0.999 * half, -0.999 * half], along)
        assert np.all(a_body.inside(just) > 0)
        assert np.all(a_body.inside(just + np.outer([0.002, -0.002], along * half)) < 0)
    aslant = np.append(0.999 * np.array(a_body.half_sides) / np.sqrt(2), sum(a_body.heights) / 2)
    beyond = aslant * (1.002, 1.002, 1.0)
    is_circle = a_body.inside(np.array([aslant]))[0] > 0 > a_body.inside(np.array([beyond]))[0]
    assert a_body.is_round == (is_circle and a_body.half_sides[0] == a_body.half_sides[1])
    assert a_body.is_smooth != has_edges(a_body)


def test_gap_is_the_distance_to_the_edge_of_the_top(a_body):
    if not has_edges(a_body):
        return
    top = ConvexHull(np.vstack([line for line in a_body.outline() if np.ptp(line[:, 2]) == 0])[:, :2])
    for x, y in ((0.0, 0.0), (3e-3, -2e-3), (-9e-3, 5e-3), (40e-3, 0.0)):
        off = -np.max(top.equations @ [x, y, 1.0])  # from the nearest side, or from its line if the point is outside
        assert a_body.gap((x, y, 0.0)) == pytest.approx(off, rel=1e-3)


# ---- probes -----------------------------------------------------------------------------------------


def test_sizes_of_a_footprint_are_those_of_its_outline(a_probe):
    outline = a_probe.outline()
    assert np.array_equal(outline[0], outline[-1]) or np.allclose(outline[0], outline[-1], atol=1e-12)
    length = float(np.linalg.norm(np.diff(outline, axis=0), axis=1).sum())
    assert length == pytest.approx(a_probe.perimeter, rel=1e-3)
    assert np.hypot(*outline.T).max() == pytest.approx(a_probe.circumradius)
    assert np.abs(outline).max(axis=0).min() == pytest.approx(a_probe.half_width)
    np.testing.assert_allclose(a_probe.to_edge(outline), outline, atol=1e-9)


def test_mirror_lines_and_roundness_of_a_footprint_are_true(a_probe):
    """Outline and profile are symmetric in exactly those lines in which the probe says so."""
    outline, sizes = a_probe.outline(), a_probe.circumradius
    dense = np.vstack([np.linspace(start, end, 30) for start, end in pairwise(outline)])

    inside = sizes * np.random.default_rng(3).uniform(-0.6, 0.6, (200, 2))

    def is_image(matrix) -> bool:
        heights, moved = a_probe.profile(inside), a_probe.profile(inside @ matrix.T)
        if not a_probe.is_flat and not np.allclose(heights, moved, rtol=1e-9, atol=1e-12):
            return False
        images = outline @ matrix.T
        return bool(
            max(np.hypot(*(dense - image).T).min() for image in images[:: len(images) // 100 + 1]) < 5e-3 * sizes
        )

    for angle in (0.0, 0.3, pi / 4, pi / 2, 2.0):
        normal = np.array([cos(angle), sin(angle)])
        assert a_probe.is_mirrored(*normal) == is_image(np.eye(2) - 2 * np.outer(normal, normal)), angle
    turn = np.array([[cos(0.7), -sin(0.7)], [sin(0.7), cos(0.7)]])
    assert a_probe.is_round == is_image(turn)


def distance_to_outline(probe, points):
    """Return the distance of points (n, 2) to the straight pieces of the outline."""
    outline = probe.outline()
    start, side = outline[:-1], np.diff(outline, axis=0)
    offset = points[:, None] - start
    share = np.clip(np.sum(offset * side, axis=2) / np.maximum(np.sum(side**2, axis=1), 1e-30), 0, 1)
    return np.linalg.norm(offset - share[..., None] * side, axis=2).min(axis=1)


def said_distance(text, points):
    """Return the distance that a probe's ``text`` of x, y and z in mm has at points (n, 3), in own coordinates."""
    names = {"Sqrt": np.sqrt, "Max": np.maximum, "Min": np.minimum, "Fabs": np.abs}
    places = dict(zip("xyz", 1e3 * points.T, strict=True))
    return 1e-3 * eval(text("x", "y", "z", 1e3).replace("^", "**"), names, places)


def flat(points):
    return np.column_stack([points, np.zeros(len(points))])


def test_edge_distance_is_nought_at_the_edge_and_near_the_truth_elsewhere(a_probe):
    points = np.random.default_rng(3).uniform(-3, 3, (60, 3)) * a_probe.circumradius
    true = np.hypot(distance_to_outline(a_probe, points[:, :2]), points[:, 2])
    said = said_distance(a_probe.edge_distance, points)
    assert np.all((0.6 * true < said) & (said < 2 * true))
    assert said_distance(a_probe.edge_distance, flat(a_probe.outline())).max() < 1e-9


def drawn_edge(probe, body):
    """Return points of every curve of the drawn footprint, in its own coordinates, and the curves' types."""
    frame, curves, kinds = probe.frame_on(body), [], set()
    with gmsh_session():
        gmsh.option.setNumber("General.Terminal", 0)
        face = probe.draw(gmsh.model.occ, frame, lambda size: 1e3 * size)
        gmsh.model.occ.synchronize()
        for _, curve in gmsh.model.getBoundary([(2, face)], oriented=False):
            (start,), (end,) = gmsh.model.getParametrizationBounds(1, curve)
            points = np.array(gmsh.model.getValue(1, curve, list(np.linspace(start, end, 9)))).reshape(-1, 3)
            curves.append(frame.local(1e-3 * points))
            kinds.add(gmsh.model.getType(1, curve))
    return np.vstack(curves), kinds


def test_the_drawn_edge_is_that_of_edge_distance(a_probe, a_body):
    """For every curve; if one of them is not straight, elements are curved."""
    points, kinds = drawn_edge(a_probe, a_body)
    assert np.abs(points[:, 2]).max() < 1e-12
    assert said_distance(a_probe.edge_distance, points).max() < 1e-9 * a_probe.circumradius
    assert a_probe.is_curved == (kinds != {"Line"})


def test_to_edge_returns_the_nearest_points_of_a_curved_edge(a_probe):
    """From points near the edge, such as the middles of straight edges."""
    outline = a_probe.outline()
    points = outline[:: len(outline) // 50 + 1]
    points = points + 0.05 * a_probe.half_width * np.random.default_rng(5).normal(size=points.shape)
    nearest = a_probe.to_edge(points)
    if not a_probe.is_curved:
        assert np.array_equal(nearest, points)
        return
    assert said_distance(a_probe.edge_distance, flat(nearest)).max() < 1e-9 * a_probe.circumradius
    least = distance_to_outline(a_probe, points)
    np.testing.assert_allclose(np.linalg.norm(nearest - points, axis=1), least, atol=1e-3 * a_probe.half_width)


@pytest.mark.parametrize("shape", [name for name, model in PROBES.items() if "direction" in model.model_fields])
def test_length_lies_along_the_direction(shape, a_body):
    for direction in ((1.0, 2.0, 0.0), (0.0, 3.0, 0.0), (-1.0, 0.0, 0.0)):
        along = example(PROBES[shape], direction=direction).frame_on(a_body).along
        assert along == pytest.approx(np.array(direction) / np.linalg.norm(direction))


def test_what_is_drawn_lies_within_the_outline_and_has_its_area(meshed):
    scene, mesh = meshed
    corners = scene.frame.local(mesh.points)[mesh.facets["probe"]]
    assert np.abs(corners[..., 2]).max() < 1e-9 or not scene.is_flat
    sides = corners[:, 1:, :2] - corners[:, :1, :2]
    area = float(np.abs(np.linalg.det(sides)).sum() / 2)
    x, y = scene.probe.outline().T
    share = 1e-3 if scene.is_flat else 3e-3 if scene.probe.has_singular_edge else 3e-2
    assert area == pytest.approx(float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / 2, rel=share)
    assert np.hypot(corners[..., 0], corners[..., 1]).max() < 1.02 * scene.probe.circumradius


def test_curved_edges_lie_on_the_outline(meshed):
    scene, _ = meshed
    scene = Scene(scene.body, scene.probe, rim_segments=SIZES.rim_segments(scene.probe))
    mesh = curve(generate(scene, SIZES), scene)
    patch = np.isin(mesh.cells[:, :4], mesh.rim)
    assert patch.sum(axis=1).max() >= 2
    ends, middle = mesh.cells[:, :4][:, EDGES], mesh.cells[:, 4:]
    along = np.isin(ends, mesh.rim).all(axis=2)
    if scene.is_flat:
        along &= np.abs(mesh.points[middle][..., 2]) < 1e-12
    else:
        on_surface = np.min(
            [np.abs(s.distance(mesh.points)) for g in scene.body.surfaces().values() for s in g], axis=0
        )
        along &= on_surface[middle] < 1e-12
    local = scene.frame.local(mesh.points[np.unique(middle[along])])[:, :2]
    edge = local[np.linalg.norm(scene.probe.to_edge(local) - local, axis=1) < 0.02 * SIZES.rim]
    # Along a rim that is not plane, gmsh makes as many edges as the sizes there require.
    assert len(edge) >= (1 if scene.is_flat else 0.85 if scene.probe.has_singular_edge else 0.7) * SIZES.rim_segments(
        scene.probe
    )
    np.testing.assert_allclose(scene.probe.to_edge(edge), edge, atol=1e-12)


@pytest.mark.parametrize("at", [(0.0, 0.0), (3e-3, -2e-3), (12e-3, 8e-3)])
def test_gap_is_the_least_over_the_outline(a_body, a_probe, at):
    frame = a_probe.model_copy(update={"at": at}).frame_on(a_body)
    edge = [a_body.gap(frame.at(*point)) for point in a_probe.outline()]
    assert a_probe.gap(a_body, frame) == pytest.approx(min(edge), rel=2e-3, abs=1e-6)


@pytest.mark.parametrize("slender", [2.0, 8.0])
def test_edge_distance_of_a_slender_ellipse_is_never_too_large(slender):
    """Elements grow with that distance: if it were too large, the footprint would have few of them."""
    for axes in ((f"{slender} mm", "1 mm"), ("1 mm", f"{slender} mm")):
        ellipse = probe("ellipse", axes=axes)
        points = np.random.default_rng(5).uniform(-1.5, 1.5, (2000, 2)) * ellipse.axes
        true = np.linalg.norm(ellipse.outline()[None] - points[:, None], axis=2).min(axis=1)
        said = said_distance(ellipse.edge_distance, flat(points))
        apart = true > 0.02e-3  # the outline is a polygon
        assert np.all(said[apart] < 1.02 * true[apart])
        assert np.all(said[apart] > 0.58 * true[apart])


def test_cases_share_a_record_only_if_all_that_force_is_proportional_to_changes_together(a_probe):
    """If only one of several keys changes, the force is another one."""
    keys = a_probe.PROPORTIONAL_TO
    (case,) = study().cases()
    moved = a_probe.model_copy(update={key: 0.1e-3 * (2 + n) for n, key in enumerate(keys)})

    def known(**changes):
        changed = replace(case, probe=moved.model_copy(update=changes))
        return case_key(changed, scaled=True), reference_key(changed, 1e-3), normalised(changed)

    assert known() == known(**{key: 3 * getattr(moved, key) for key in keys})
    for key in keys if len(keys) > 1 else ():
        assert not {*known()} & {*known(**{key: 3 * getattr(moved, key)})}


def test_a_force_that_is_proportional_to_nothing_is_of_its_own_depth():
    class Settled(PROBES["disc"]):
        PROPORTIONAL_TO = ()

    (case,) = study().cases()
    shallow, deep = (
        replace(case, probe=example(Settled, depth=f"{depth} mm")) for depth in (0.1, 0.2)
    )  # fmt: skip
    assert normalised(deep).probe.depth == 0.2e-3
    assert deep.scale.length == shallow.scale.length
    assert case_key(deep, scaled=True) != case_key(shallow, scaled=True)
    assert reference_key(deep, 1e-3) != reference_key(shallow, 1e-3)


@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_the_way_to_a_side_ends_at_the_edge_of_the_face(shape):
    body, (x, y) = example(BODIES[shape]), (3e-3, -2e-3)
    for angle in np.linspace(0.1, 6.2, 7):
        along = (cos(angle), sin(angle))
        way = body.to_side((x, y), along)
        assert way > 0
        assert body.gap((x + way * along[0], y + way * along[1], 0.0)) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("edges", [8, 40])
def test_the_polygon_of_the_disc_to_be_drawn_has_the_area_of_the_disc(edges):
    disc = example(PROBES["disc"])
    drawn = disc.inscribed(edges)
    assert edges / 2 * drawn.radius**2 * np.sin(2 * np.pi / edges) == pytest.approx(np.pi * disc.radius**2)


def test_what_f_is_proportional_to_moves_the_footprint_and_leaves_its_shape(a_probe, a_body):
    frame, keys = a_probe.frame_on(a_body), a_probe.PROPORTIONAL_TO or ("depth",)
    once, twice = (a_probe.model_copy(update=dict.fromkeys(keys, much)) for much in (1e-4, 2e-4))
    assert np.linalg.norm(once.travel(frame)) > 0
    assert twice.travel(frame) == pytest.approx(2 * np.array(once.travel(frame)))
    # Where the contact area grows with the depth, F is not proportional to it.
    assert np.array_equal(once.outline(), twice.outline()) == bool(a_probe.PROPORTIONAL_TO)
    assert once.frame_on(a_body) == twice.frame_on(a_body)


def inside(probe, count=400):
    """Return points (n, 2) within the footprint's outline, and some on it."""
    outline = probe.outline()[::7]
    shares = np.random.default_rng(6).uniform(0, 1, (count // len(outline) + 1, len(outline), 1))
    return np.vstack([(shares * outline).reshape(-1, 2), outline])


def beyond_a_corner(probe, points):
    """Return a mask of points (n, 2) in the corners of the rectangle that a rounded blade leaves free."""
    if not (probe.shape == "blade" and getattr(probe, "edge", 0.0)):
        return np.zeros(len(points), dtype=bool)
    flat = np.array([probe.length, probe.width]) / 2 - probe.edge
    return np.hypot(*np.maximum(np.abs(points) - flat, 0).T) > (1 + 1e-6) * probe.edge


def test_a_profile_is_finite_over_the_footprint_and_begins_at_the_lowest_point(a_probe):
    points = inside(a_probe)
    height = a_probe.profile(points)
    is_tool = ~beyond_a_corner(a_probe, points)
    assert np.all(height >= 0)
    assert np.array_equal(np.isfinite(height), is_tool)
    height = height[is_tool]
    assert a_probe.profile(np.zeros((1, 2)))[0] == 0
    # Where the tool ends there is nothing beyond; elsewhere the footprint contains all that it may touch.
    outline = a_probe.outline()
    beyond, ends = a_probe.profile(1.001 * outline), a_probe.ends_at(outline)
    assert np.all(np.isinf(beyond[ends]))
    assert np.all(beyond[~ends] > a_probe.depth)
    assert a_probe.has_singular_edge == (height.max() == 0) <= ends.all()


def test_the_section_of_a_round_tool_has_its_profile_as_integral(a_probe):
    """Its slope is the derivative of the heights, and zero where it is flat."""
    section = a_probe.revolved
    assert (section is not None) == a_probe.is_round
    if section is None:
        return
    radii = np.linspace(0.05, 0.95, 7) * min(section.limit, 2 * a_probe.half_width)
    step = 1e-6 * radii[-1]
    ends = [a_probe.profile(np.column_stack([radii + by, 0 * radii])) for by in (-step, step)]
    np.testing.assert_allclose((ends[1] - ends[0]) / (2 * step), section.slope(radii), rtol=1e-5, atol=1e-12)
    assert section.is_flat == (a_probe.force_exponent == 1)
    assert np.isinf(a_probe.profile(np.array([[1.01 * section.limit, 0.0]]))).all() or not section.is_flat


def test_elements_are_small_where_contact_is_expected_to_end(a_probe):
    """Within the footprint, at its edge if that is singular; over a band if the edge of contact is not known."""
    distance = said_distance(a_probe.rim_distance, flat(inside(a_probe, 20_000)))
    length, area = a_probe.rim_size
    assert length > 0
    assert np.all(distance <= a_probe.circumradius)
    assert (area > 0) == (not a_probe.has_singular_edge)
    assert bool((distance[: -len(a_probe.outline()[::7])] == 0).any()) == (area > 0)


# ---- frames -----------------------------------------------------------------------------------------


def test_a_frame_turns_forth_and_back():
    frame = Frame((1e-3, 2e-3, 3e-3), axis=(0.6, 0.0, -0.8)).turned((1.0, 1.0, 0.0))
    points = np.random.default_rng(4).normal(size=(20, 3))
    np.testing.assert_allclose(frame.world(frame.local(points)), points, atol=1e-12)
    matrix = np.array([frame.along, frame.across, frame.outward])
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1)


def test_a_frame_places_what_is_drawn_and_writes_its_coordinates():
    """A rectangle drawn upright is rotated into the frame's plane, along its direction."""
    for axis in ((0.6, 0.0, -0.8), (0.0, 0.6, 0.8), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)):
        frame = Frame((1e-3, 2e-3, 3e-3), axis=axis).turned((1.0, 2.0, 0.5))
        blade = probe("blade")
        with gmsh_session():
            gmsh.option.setNumber("General.Terminal", 0)
            blade.draw(gmsh.model.occ, frame, lambda length: 1e3 * length)
            gmsh.model.occ.synchronize()
            corners = 1e-3 * np.array([gmsh.model.getValue(0, tag, []) for _, tag in gmsh.model.getEntities(0)])
        local = frame.local(corners)
        np.testing.assert_allclose(np.abs(local), np.tile([blade.length / 2, blade.width / 2, 0], (4, 1)), atol=1e-9)
        texts = frame.expressions(1e3)
        for corner, own in zip(corners, local, strict=True):
            x, y, z = 1e3 * corner
            assert [eval(text, {}, {"x": x, "y": y, "z": z}) for text in texts] == pytest.approx(1e3 * own, abs=1e-9)


# ---- nothing by default -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "base"), [*((body, Body) for body in DRAWN.values()), *((probe, Probe) for probe in PROBES.values())]
)
def test_a_shape_that_leaves_something_out_cannot_be_made(model, base):
    """Values that could be wrong silently have no default: without one of them there is no shape."""
    for name in base.__abstractmethods__:
        incomplete = type("Incomplete", (model,), {name: getattr(base, name), "__module__": __name__})
        with pytest.raises(TypeError, match=name):
            example(incomplete)


def test_what_is_not_in_the_registry_is_refused():
    for section, shape in (("body", "torus"), ("probe", "star")):
        with pytest.raises(StudyError, match="unknown shape"):
            study(**{section: {"shape": shape}})
