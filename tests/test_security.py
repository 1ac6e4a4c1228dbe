"""Nothing that stands in a file is run: the code has no means to."""

import ast
import gzip
import json
import os
import re
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from epsmesh.files import cache_folder
from epsmesh.plan.plan import make_plan
from epsmesh.report.page import render
from epsmesh.report.read import read
from epsmesh.report.study import DatasetError, study_of
from epsmesh.run.reading import known_of
from epsmesh.run.store import Store, StoreError
from epsmesh.shapes.files.image import read_image
from epsmesh.shapes.files.read import Loaded
from epsmesh.shapes.triangles import SurfaceError
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_study
from tests.cases import raw, study
from tests.commands import ROOT, talk
from tests.organs import box, write_stl
from tests.realtime.synthetic import write_random
from tests.report.synthetic import dataset

FILES = sorted(file for folder in ("pipeline", "benchmarks", "scripts", "docs") for file in Path(folder).rglob("*.py"))
# Our own: vendored libraries are known by their hash in the policy of a page.
SCRIPTS = sorted(file for file in Path("pipeline").rglob("*.js") if "vendor" not in file.parts)
UNPICKLERS = {"pickle", "cPickle", "dill", "marshal", "shelve", "joblib", "yaml"}
RUNNERS = {"eval", "exec", "compile", "__import__", "system", "popen"}
STUDY = """
[body]
shape = "surface"
file = {file}
unit = "mm"
fixed = {{below = "-5 mm"}}
[material]
young = "5 kPa"
poisson = 0.45
[probe]
shape = "disc"
radius = "2 mm"
depth = "0.2 mm"
at = ["0 mm", "0 mm"]
[mesh]
accuracy = "5 %"
"""


@pytest.mark.parametrize("name", ["../mine", "a/b", "/tmp/mine", "..", "."])
def test_a_new_study_stays_where_studies_are(name, epsmesh, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = epsmesh("new", name)
    assert done.exit_code == 2
    assert "a name has no folders" in done.stderr or "must be letters" in done.stderr
    assert not list(tmp_path.rglob("*.toml"))


def test_no_module_unpickles_evaluates_or_starts_a_shell():
    assert len(FILES) > 300
    for file in FILES:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                assert not UNPICKLERS & {alias.name.split(".")[0] for alias in node.names}, file
            if isinstance(node, ast.ImportFrom):
                assert (node.module or "").split(".")[0] not in UNPICKLERS, file
            if isinstance(node, ast.Call):
                check(node, f"{file}:{node.lineno}")


def check(call: ast.Call, where: str) -> None:
    """Assert that a call neither evaluates text, nor starts a shell, nor unpickles arrays."""
    name = call.func.id if isinstance(call.func, ast.Name) else ""
    attribute = call.func.attr if isinstance(call.func, ast.Attribute) else ""
    owner = call.func.value.id if isinstance(call.func, ast.Attribute) and isinstance(call.func.value, ast.Name) else ""
    assert name not in RUNNERS, where
    assert (owner, attribute) not in {("os", "system"), ("os", "popen")}, where
    given = {keyword.arg: keyword.value for keyword in call.keywords}
    assert not (isinstance(shell := given.get("shell"), ast.Constant) and shell.value), where
    if (owner, attribute) == ("np", "load"):
        assert isinstance(given.get("allow_pickle"), ast.Constant) and not given["allow_pickle"].value, where


def test_no_page_makes_elements_of_text():
    assert len(SCRIPTS) > 8
    for script in SCRIPTS:
        text = script.read_text(encoding="utf-8")
        assert not re.search(
            r"\beval\(|new Function|document\.write|insertAdjacentHTML|outerHTML|fetch\(|import\(", text
        )
        assert re.findall(r"(\S+)\.innerHTML", text) in ([], ['document.getElementById("axes")'])  # of numbers


@pytest.fixture
def folders(tmp_path):
    """A project with studies, and a folder of surfaces beside it."""
    project, strange = tmp_path / "project", tmp_path / "strange"
    for folder in (project / "studies", project / "meshes", strange):
        folder.mkdir(parents=True)
        write_stl(folder / "box.stl", *box(0.02, 0.02, 0.01))
    (project / "meshes" / "away.stl").symlink_to(strange / "box.stl")
    (project / "meshes" / "zero.stl").symlink_to("/dev/zero")
    os.mkfifo(project / "meshes" / "pipe.stl")
    return project, strange


def written(project, *files):
    path = project / "studies" / "mine.toml"
    text = ", ".join(f"'{file}'" for file in files)
    path.write_text(STUDY.format(file=text if len(files) == 1 else f"[{text}]"))
    return path


@pytest.mark.parametrize(
    "file", ["box.stl", "../meshes/box.stl", "../../strange/box.stl", "../meshes/away.stl", "{strange}/box.stl"]
)
def test_a_study_names_any_file_that_can_be_read(folders, file, epsmesh):
    project, strange = folders
    path = written(project, file.format(strange=strange))
    assert read_study(path).shape == ()
    assert epsmesh("plan", path).exit_code == 0


@pytest.mark.parametrize(
    ("file", "why"),
    [
        ("none.stl", "cannot be read: No such file"),
        ("~/x.stl", "cannot be read: No such file"),  # no home is meant
        ("/dev/zero", "it is not a regular file"),
        ("../meshes/zero.stl", "it is not a regular file"),
        ("../meshes/pipe.stl", "it is not a regular file"),
        ("..", "it is not a regular file"),
        ("/etc/passwd", "allowed are .stl, .ply, .obj"),
    ],
)
def test_what_cannot_be_read_is_named_with_its_reason(folders, file, why):
    path = written(folders[0], "box.stl", file)
    with pytest.raises(StudyError) as refused:
        read_study(path)
    (line,) = str(refused.value).splitlines()
    assert line.startswith(f"{path}: body.file = ")
    assert why in line


def test_names_are_shown_as_they_are():
    tables = [raw()["probe"] | {"name": name} for name in ("a\x1b[2J", "b")]
    with pytest.raises(StudyError, match=r"probe\[1\].name.*control characters"):
        study(probe=tables)


def test_the_study_in_a_dataset_is_held_to_what_a_file_is_held_to(folders, monkeypatch):
    monkeypatch.chdir(folders[0])
    for file, is_read in (("meshes/box.stl", True), ("meshes/pipe.stl", False)):
        found = study_of(dataset().assign_attrs(study=STUDY.format(file=f"'{file}'")))
        assert (found is not None) is is_read
    for text in ("a" + ".a" * 30 + " = 1", "x = " + "[" * 5000, "x = 1" + "0" * 5000, "x =" + " " * 2_000_000):
        assert study_of(dataset().assign_attrs(study=text)) is None


def test_commands_to_be_pasted_hold_one_command_each():
    hostile = dataset().assign_attrs(
        study_folder="$(reboot)", study_file="x; rm -rf ~.toml", git_commit="$(reboot)", ranks="2; reboot"
    )
    page = render(hostile, "a b")
    assert "epsmesh run &#39;$(reboot)/x; rm -rf ~.toml&#39; --fresh" in page
    assert "epsmesh report &#39;results/a b.nc&#39;" in page
    assert "git checkout" not in page
    assert "mpirun" not in page


def test_a_dataset_moves_no_cursor_and_fills_no_memory(tmp_path):
    from netCDF4 import Dataset

    path = tmp_path / "known.nc"
    hostile = dataset(failed=1).assign_attrs(title="a\x1b[2Jb")
    hostile["message"] = hostile["message"].where(hostile["message"] == "", "\x1b]0;c\x07\nd")
    hostile.to_netcdf(path)
    found = read(path)
    assert found.attrs["title"] == r"a\x1b[2Jb"
    assert r"\x1b]0;c\x07" + "\nd" in found["message"].values
    assert found["message"].dims == hostile["message"].dims
    np.testing.assert_array_equal(found["force"], hostile["force"])
    with Dataset(path, "a") as file:
        file.createDimension("many", 10**10)
        file.createVariable("nothing", "f8", ("many",), zlib=True, chunksizes=(10**6,))
    assert path.stat().st_size < 10**6
    with pytest.raises(DatasetError, match="would take 80 GB"):
        read(path)


@pytest.mark.parametrize(
    "program",
    [
        "CREATE VIEW more AS SELECT 1",
        "CREATE TRIGGER more AFTER INSERT ON records BEGIN DELETE FROM records; END",
        "DROP TABLE records; CREATE VIEW records AS WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n) "
        "SELECT k AS key, k AS record, 0 AS stored FROM n",
        "DROP TABLE records; CREATE VIRTUAL TABLE records USING fts5(key, record, stored); "
        "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = replace(sql, 'CREATE VIRTUAL', 'CREATE  VIRTUAL')",
        "DROP TABLE records; CREATE TABLE Records (key TEXT, record TEXT AS (hex(zeroblob(7000000))), stored REAL)",
        "CREATE INDEX slow ON records (hex(zeroblob(7000000)))",
    ],
)
def test_a_store_is_data(tmp_path, program):
    path = tmp_path / "cases.sqlite"
    Store(path).close()
    database = sqlite3.connect(path)
    database.executescript(program)
    database.close()
    with pytest.raises(StoreError, match=r"no case store|not that of a case store"):
        known_of(path, make_plan(study()))
    opened = Store(path)
    assert "was renamed to" in opened.notice
    opened.close()


HOSTILE = "a\x1b]0;b\x07\n\u009b2J\u202e"


def test_no_file_writes_on_a_terminal_what_it_does_not_say(tmp_path):
    """Neither by its name, nor by names in it, nor by keys of records, for people or for scripts."""
    mine = tmp_path / f"{HOSTILE}.toml"
    mine.write_text("title = 1")
    store, model = tmp_path / "cases.sqlite", tmp_path / "model.epsm"
    opened = Store(store)
    opened.put_rows([(HOSTILE, "{", 0.0)])
    opened.close()
    write_random(model)
    start = (data := bytearray(model.read_bytes())).index(b"check_bar")
    data[start : start + 3], data[start + 32 : start + 36] = b"\x1b[2", b"\xff" * 4
    model.write_bytes(data)
    commands = [("plan", mine), ("status", "--store", store), ("touch", model), ("touch", mine)]
    for words in (*commands, *((*words, "--json") for words in commands)):
        status, said, errors = talk(*words)
        text = said + errors
        assert status in (1, 2)
        assert all(line.isprintable() for line in text.split("\n")), text
        assert "\\x1b" in text or "\\u001b" in text
        if "--json" in words and "status" not in words:
            (fault, *_) = at[0]["errors"] if isinstance(at := json.loads(said), list) else at["errors"]
            assert mine not in words or fault["file"] == str(mine)


def test_what_a_stream_has_no_sign_for_is_written_out(tmp_path):
    status, said, _ = talk("plan", ROOT / "studies" / "quick.toml", "--output", tmp_path, encoding="ascii")
    assert status == 0
    assert r"2 poisson \xd7 5 epsilon" in said


def test_commands_that_messages_name_hold_one_command_each(tmp_path, epsmesh):
    store = tmp_path / "x; reboot.sqlite"
    store.write_bytes(b"no store" * 100)
    told = epsmesh("status", "studies/quick.toml", "--store", store).stderr
    assert f"`epsmesh status --prune --yes --store '{store}'`" in told
    (tmp_path / "$(reboot).toml").write_text("")
    told = epsmesh("report", tmp_path / "$(reboot).toml").stderr
    assert f"`epsmesh run '{tmp_path}/$(reboot).toml'`" in told


@pytest.mark.parametrize("folder", ["", "here", "../here"])
def test_code_is_loaded_from_no_folder_that_one_happens_to_be_in(monkeypatch, tmp_path, folder):
    monkeypatch.delenv("EPSMESH_CACHE", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", folder)
    assert cache_folder() == tmp_path / ".cache" / "epsmesh"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    assert cache_folder() == tmp_path / "caches" / "epsmesh"


def test_records_that_nest_without_end_are_none(tmp_path):
    plan = make_plan(study())
    with sqlite3.connect(path := tmp_path / "cases.sqlite") as database:
        database.execute("CREATE TABLE records (key TEXT PRIMARY KEY, record TEXT NOT NULL, stored REAL NOT NULL)")
        database.execute("INSERT INTO records VALUES (?, ?, 0)", (plan.keys[0], "[" * 200_000))
    database.close()
    with pytest.raises(StoreError, match="cannot be read"):
        known_of(path, plan)


def nrrd(path: Path, data: bytes, *lines: str) -> Path:
    """Write an NRRD file of 20 × 20 × 20 voxels of a byte, with more lines in its header, and its data behind it."""
    head = ["NRRD0004", "type: uint8", "dimension: 3", "sizes: 20 20 20", "spacings: 1 1 1"]
    path.write_bytes("\n".join([*head, *lines, "", ""]).encode() + data)
    return path


def test_the_data_of_an_image_lie_where_its_header_says_and_are_what_it_says(folders):
    project, strange = folders
    voxels = np.zeros((20, 20, 20), dtype=np.uint8)
    voxels[4:16, 4:16, 4:16] = 1
    packed = gzip.compress(voxels.tobytes())
    for folder in (project / "meshes", strange):
        (folder / "data.gz").write_bytes(packed)

    def image(*lines: str, data: bytes = b"") -> Loaded:
        return read_image(nrrd(project / "meshes" / "box.nhdr", data, "encoding: gzip", *lines), 1, 1e-3)

    own = image(data=packed).triangles.points
    np.testing.assert_array_equal(own, image("data file: data.gz").triangles.points)
    for file in (strange / "data.gz", "../../strange/data.gz"):
        np.testing.assert_array_equal(own, image(f"data file: {file} ").triangles.points)
    for file in ("none.gz", "/dev/zero"):
        with pytest.raises(SurfaceError, match=r"data file of its header.*cannot be read"):
            image(f"data file: {file}")
    with pytest.raises(SurfaceError, match="more data than its header says"):
        image(data=gzip.compress(bytes(200_000)))
    with pytest.raises(SurfaceError, match="skips 1,000,000,000,000 lines"):
        image("line skip: 1000000000000", data=packed)
