"""Files beside a study that are cut short, flipped or filled with something else: read, or refused in words."""

import struct

import meshio
import nrrd
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epsmesh.plan.plan import make_plan
from epsmesh.run.reading import known_of, open_to_read, read_rows
from epsmesh.run.record import Record
from epsmesh.run.store import Store, StoreError
from epsmesh.shapes.files.image import read_image
from epsmesh.shapes.files.read import read_surface
from epsmesh.shapes.files.step import entities_of, named_faces, unit_of
from epsmesh.shapes.triangles import SurfaceError
from epsmesh_identify.experiment.read import read_curve
from epsmesh_identify.experiment.reading import ExperimentError, Reading
from epsmesh_realtime import ModelError
from epsmesh_realtime import read as read_model
from epsmesh_realtime.export.file import open_model
from tests.cases import study
from tests.fuzz.profile import thrown
from tests.identify.experiment.curves import cycle, write
from tests.organs import box, write_nifti, write_stl
from tests.realtime.synthetic import write_random
from tests.shapes.files import dicoms

PLAN = make_plan(study(material={"young": "10 kPa", "poisson": [0.3, 0.4]}))
STEP = b"""ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;
#1=CARTESIAN_POINT('',(0.,0.,1.E1));\n#3=VERTEX_POINT('',#1);\n#4=EDGE_LOOP('',(#3));\n#5=ADVANCED_FACE('top',(#4),#1,.T.);
#6=CLOSED_SHELL('',(#5));\n#2=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));\nENDSEC;\nEND-ISO-10303-21;\n"""


@st.composite
def damaged(draw: st.DrawFn, data: bytes) -> bytes:
    """Draw bytes that are cut short, or of which bits are flipped, or numbers are none."""
    changed = bytearray(data)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(changed) - 1, 0)))
        match draw(st.integers(0, 3)):
            case 0:
                del changed[at:]
            case 1 | 2 if changed:
                changed[at] ^= 1 << draw(st.integers(0, 7))
            case _:
                special = st.sampled_from([np.nan, np.inf, 1e38, -0.0])
                changed[at : at + 4] = draw(st.one_of(st.binary(min_size=4, max_size=4), special.map(_float)))
    return bytes(changed)


def _float(value: float) -> bytes:
    return struct.pack("<f", value)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder = tmp_path_factory.mktemp("good")
    points, facets = box(0.02, 0.02, 0.01)
    write_stl(folder / "box.stl", points, facets)
    meshio.write_points_cells(folder / "box.ply", 1e3 * points, [("triangle", facets)])
    meshio.write_points_cells(folder / "box.obj", 1e3 * points, [("triangle", facets)])
    places = np.stack(np.meshgrid(*3 * [np.arange(12)], indexing="ij"), -1)
    ball = (((places - 5.5) ** 2).sum(-1) < 16).astype(np.uint8)
    for ending in ("nii", "nii.gz"):
        write_nifti(folder / f"ball.{ending}", ball, np.diag([2.0, 2.0, 2.0, 1.0]))
    nrrd.write(str(folder / "ball.nrrd"), ball, {"space directions": 2 * np.eye(3), "space origin": np.zeros(3),
               "space": "right-anterior-superior", "space units": ["mm"] * 3})  # fmt: skip
    dicoms.segmentation(folder / "ball.dcm", dicoms.frames(dicoms.values()))
    write_random(folder / "box.epsm")
    store = Store(folder / "cases.sqlite")
    for key in PLAN.keys:
        store.put(Record(key, "ok", force=1.0))
    store.close()
    return folder


@pytest.fixture(scope="module")
def thrown_at(tmp_path_factory):
    return tmp_path_factory.mktemp("thrown")


@given(data=st.data(), ending=st.sampled_from(["stl", "ply", "obj"]), repair=st.booleans())
@thrown(0.3)
def test_surfaces(good, thrown_at, data, ending, repair):
    file = thrown_at / f"box.{ending}"
    file.write_bytes(data.draw(damaged((good / file.name).read_bytes())))
    try:
        loaded = read_surface(file, 1e-3, repair=repair)
    except SurfaceError as refused:
        readable(refused)
    else:
        assert np.isfinite(loaded.triangles.points).all() and loaded.triangles.volume > 0


@given(data=st.data(), ending=st.sampled_from(["nii", "nii.gz", "nrrd", "dcm"]))
@thrown(0.2)
def test_label_maps(good, thrown_at, data, ending):
    file = thrown_at / f"ball.{ending}"
    file.write_bytes(data.draw(damaged((good / file.name).read_bytes())))
    try:
        loaded = read_image(file, 1)
    except SurfaceError as refused:
        readable(refused)
    else:
        assert np.isfinite(loaded.triangles.points).all()


@given(data=damaged(STEP))
@thrown(0.3)
def test_step_files_are_looked_through_before_the_kernel_reads_them(data):
    try:
        entities = entities_of(data)
        assert unit_of(entities) in (None, "mm", "m", "cm", "um", "in")
        named_faces(entities)
    except SurfaceError as refused:
        readable(refused)


@pytest.mark.parametrize("point", [b"(0.(0.,1.E1)", b"(0.,0.)", b"(0.,0.,1.E1,2.)", b"(0.,0.,up)", b"()"])
def test_a_point_that_is_none_is_named(point):
    with pytest.raises(SurfaceError, match="is not a point"):
        named_faces(entities_of(STEP.replace(b"(0.,0.,1.E1)", point)))


@given(data=st.data())
@thrown(0.3)
def test_models(good, thrown_at, data):
    file = thrown_at / "box.epsm"
    file.write_bytes(data.draw(damaged((good / "box.epsm").read_bytes())))
    for reader in (read_model, open_model):
        try:
            reader(file)
        except ModelError as refused:
            readable(refused)


@given(data=st.data())
@thrown(0.3)
def test_stores(good, thrown_at, data):
    file = thrown_at / "cases.sqlite"
    file.write_bytes(bytes_ := data.draw(damaged((good / "cases.sqlite").read_bytes())))
    for reader in (lambda: known_of(file, PLAN), lambda: read_rows(file), lambda: looked_through(file)):
        try:
            reader()
        except StoreError as refused:
            readable(refused)
    assert file.read_bytes() == bytes_  # whoever reads changes nothing


def looked_through(file):
    with open_to_read(file) as store:
        assert len(list(store.records())) <= len(PLAN.keys)
        for problem in store.problems():
            readable(problem)
        assert all(one.size >= 0 for one in store.doomed(older_than=0.0))


def readable(refused: Exception | str) -> None:
    """Assert that a message is one line that a person can read."""
    assert str(refused).strip()
    assert "\n" not in str(refused)
    assert len(str(refused)) < 1000


@pytest.fixture(scope="module")
def curve(tmp_path_factory):
    time, depth, force = cycle(60, hold=20)
    columns = {"time (s)": time, "depth (mm)": 1e3 * depth, "force (mN)": 1e3 * force}
    return write(tmp_path_factory.mktemp("curve") / "curve.csv", columns)


@given(data=st.data(), segment=st.sampled_from(["approach", "hold", "approach+hold", "retract"]))
@thrown(0.3)
def test_a_damaged_curve_is_read_or_refused(curve, data, segment):
    path = curve.with_name("damaged.csv")
    path.write_bytes(data.draw(damaged(curve.read_bytes())))
    try:
        found = read_curve(path, Reading(segment=segment))
    except ExperimentError as error:
        assert str(path) in str(error)
        return
    assert np.isfinite(found.depth).all() and np.isfinite(found.force).all()
