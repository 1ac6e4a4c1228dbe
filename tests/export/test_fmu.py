"""A model as a co-simulation unit: valid, with the evaluator's forces, in the hands of an independent host."""

import ctypes
import re
import shutil
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from epsmesh_realtime import History
from epsmesh_realtime.export.file import write_model
from epsmesh_realtime.export.fmu import STATUSES, library_place, write_fmu
from tests.realtime.synthetic import random_model, write_random

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install epsmesh[fmi]")
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
RADIUS, STEP, COUNT = 5e-3, 1e-3, 400


@pytest.fixture(scope="module", params=[{}, {"curved": True, "turned": True}], ids=["flat", "curved"])
def made(request, tmp_path_factory):
    """Return a model and the file of its unit."""
    folder = tmp_path_factory.mktemp("unit")
    model = write_random(folder / "pad.epsm", **request.param)
    write_fmu(folder / "pad.epsm", folder / "pad.fmu", "0")
    return model, folder / "pad.fmu"


def path_of(model):
    """Return inputs of a tool that dives, slides, leaves the region and returns, in tissue that stiffens."""
    time = STEP * np.arange(COUNT)
    inputs = np.zeros(
        COUNT, [("time", float), *((f"tip.{c}", float) for c in "xyz"), ("young", float), ("poisson", float)]
    )
    x, y = 0.006 * np.sin(20 * time), 0.005 * np.sin(9 * time)
    depth = 5e-4 * np.sin(30 * time)
    x[300:330] = 1.1 * model.table.reach[0]
    rows, places = [], []
    for number in range(COUNT):
        spot = model.spot(x[number], y[number])
        local = np.array([x[number], y[number], spot.height])
        places.append(model.origin + local @ model.axes)
        rows.append(model.origin + (local - depth[number] * np.array(spot.normal)) @ model.axes)
    inputs["time"], inputs["young"], inputs["poisson"] = time, 1e4 * (1 + time), 0.4 + 0.05 * np.sin(time)
    for i, c in enumerate("xyz"):
        inputs[f"tip.{c}"] = np.array(rows)[:, i]
    return inputs, places, depth


def test_a_host_finds_the_unit_valid_and_gets_the_evaluators_forces(made):
    from fmpy.validation import validate_fmu

    model, unit = made
    assert validate_fmu(str(unit)) == []
    inputs, places, depth = path_of(model)
    found = fmpy.simulate_fmu(
        str(unit), stop_time=COUNT * STEP, step_size=STEP, output_interval=STEP, input=inputs, validate=False,
        start_values={"shape": 1, "radius": RADIUS},
    )  # fmt: skip
    seen, largest = set(), 0.0
    # What a step computes from the inputs at its beginning is there at its end.
    for asked, given, at, deep in zip(inputs, found[1:], places, depth, strict=True):
        touch = model.query("sphere", radius=RADIUS, at=at, depth=float(deep),
                            young=asked["young"], poisson=asked["poisson"])  # fmt: skip
        force = np.array([given[f"force.{c}"] for c in "xyz"])
        status = STATUSES[int(given["status"])]
        seen.add(status)
        if status == "ok":
            assert touch.status == "ok"
            assert given["depth"] == pytest.approx(deep, rel=1e-7)
            # Places and depths are sums of coordinates of 0.2 m, each rounded to 3e-17 m.
            within = 1e-12 * np.linalg.norm(touch.force) + 1e-15 * touch.stiffness
            np.testing.assert_allclose(force, touch.force, atol=within, rtol=0)
            assert given["force_error"] == pytest.approx(touch.force_error, rel=1e-9)
            largest = max(largest, float(np.linalg.norm(force)))
        else:
            assert np.all(force == 0) if status == "no contact" else np.isnan(force).all()
    assert seen >= {"ok", "no contact", "outside"}
    assert largest > 1e-3
    assert fmpy.read_model_description(str(unit)).modelVariables[0].unit == "s"


def test_a_step_can_be_repeated_and_its_result_returns(made):
    model, unit = made
    inputs, *_ = path_of(model)
    folder = fmpy.extract(str(unit))
    description = fmpy.read_model_description(str(unit))
    references = {v.name: v.valueReference for v in description.modelVariables}
    host = fmpy.fmi3.FMU3Slave(
        guid=description.guid, unzipDirectory=folder, modelIdentifier="epsmesh", instanceName="one"
    )
    host.instantiate()
    host.enterInitializationMode()
    host.setFloat64([references[f"tip.{c}"] for c in "xyz"], [inputs[f"tip.{c}"][20] for c in "xyz"])
    host.exitInitializationMode()
    forces = [references[f"force.{c}"] for c in "xyz"]
    first = list(host.getFloat64(forces))
    assert np.linalg.norm(first) > 0
    saved = host.getFMUState()
    host.setFloat64([references["young"]], [2 * model.young])
    host.doStep(0.0, STEP)
    assert list(host.getFloat64(forces)) == pytest.approx([2 * force for force in first])
    host.setFMUState(saved)
    assert list(host.getFloat64(forces)) == first
    host.freeFMUState(saved)
    host.terminate()
    host.freeInstance()
    shutil.rmtree(folder)


def test_relaxing_tissue_remembers_from_step_to_step(tmp_path):
    model = replace(random_model(), relaxation=((0.4, 0.05), (0.2, 2.0)))
    write_model(tmp_path / "pad.epsm", model, {}, {})
    write_fmu(tmp_path / "pad.epsm", tmp_path / "pad.fmu", "0")
    depths = 4e-4 * np.interp(np.arange(300), (0, 100, 200, 250, 299), (-0.2, 1.0, 1.0, 0.0, -0.2))
    inputs = np.zeros(300, [("time", float), ("tip.z", float)])
    inputs["time"], inputs["tip.z"] = STEP * np.arange(300), -depths

    def simulated():
        return fmpy.simulate_fmu(
            str(tmp_path / "pad.fmu"), stop_time=0.3, step_size=STEP, output_interval=STEP, input=inputs,
            validate=False, start_values={"shape": 1, "radius": RADIUS},
        )  # fmt: skip

    found = simulated()
    history = History(model)
    for given, depth in zip(found[1:], depths.tolist(), strict=True):
        touch = history.query(STEP, "sphere", radius=RADIUS, at=(0.0, 0.0, 0.0), depth=max(depth, 0.0))
        assert STATUSES[int(given["status"])] == touch.status
        assert given["force.z"] == pytest.approx(touch.force[2], rel=1e-10, abs=1e-15)
    held = found["force.z"][101:201]
    assert held[-1] < 0.8 * held[0]
    inputs["tip.z"][150] = np.nan  # where was the tool?
    statuses = [STATUSES[int(status)] for status in simulated()["status"]]
    assert "ok" in statuses[:150]
    assert statuses[151] == "input"
    assert {*statuses[153:]} == {"history"}


def test_its_sources_build_a_library_with_every_function_of_the_standard(made, tmp_path):
    _, unit = made
    with zipfile.ZipFile(unit) as files:
        assert library_place() in files.namelist()
        files.extractall(tmp_path)
    build = Xml.parse(tmp_path / "sources" / "buildDescription.xml").getroot()
    names = [each.get("name") for each in build.iter("SourceFile")]
    done = subprocess.run(
        ["cc", "-std=c99", "-O0", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", *names, "-oown.so", "-lm"],
        cwd=tmp_path / "sources", capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text()
    functions = re.findall(r"^FMI3_Export \w+ +(fmi3\w+);", header, re.MULTILINE)
    library = ctypes.CDLL(str(tmp_path / "sources" / "own.so"))
    assert len(functions) > 70
    assert [name for name in functions if not hasattr(library, name)] == []


def test_another_description_or_a_missing_model_is_refused(made, tmp_path):
    _, unit = made
    with zipfile.ZipFile(unit) as files:
        files.extractall(tmp_path)
    library = ctypes.CDLL(str(tmp_path / library_place()))
    library.fmi3InstantiateCoSimulation.restype = ctypes.c_void_p
    token = fmpy.read_model_description(str(unit)).guid.encode()

    def instance(token, folder):
        return library.fmi3InstantiateCoSimulation(
            b"one", token, str(folder).encode(), False, False, False, False, None, ctypes.c_size_t(0), None, None, None
        )

    assert instance(b"{another}", tmp_path / "resources") is None
    assert instance(token, tmp_path) is None
    right = instance(token, tmp_path / "resources")
    assert right
    library.fmi3FreeInstance(ctypes.c_void_p(right))


def test_the_command_packs_a_model_and_needs_a_compiler(epsmesh, tmp_path, monkeypatch):
    write_random(tmp_path / "pad.epsm")
    done = epsmesh("export", tmp_path / "pad.epsm", "--fmu", tmp_path / "pad.fmu")
    assert done.exit_code == 0, done.output
    assert zipfile.is_zipfile(tmp_path / "pad.fmu")
    monkeypatch.setenv("CC", "no-such-compiler")
    wrong = epsmesh("export", tmp_path / "pad.epsm", "--fmu", tmp_path / "other.fmu")
    assert wrong.exit_code == 2
    assert "there is no C compiler 'no-such-compiler': install gcc, or set CC" in wrong.output
    monkeypatch.delenv("CC")
    (tmp_path / "bad.epsm").write_bytes(b"CDF\x02")
    wrong = epsmesh("export", tmp_path / "bad.epsm", "--fmu", tmp_path / "other.fmu")
    assert wrong.exit_code == 2
    assert not (tmp_path / "other.fmu").exists()
