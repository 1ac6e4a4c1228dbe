"""Slips in files of force curves, and in what a study says of them: each is an error or a note, by name."""

import numpy as np
import pytest

from epsmesh_identify.experiment.read import read_curve
from epsmesh_identify.experiment.reading import ExperimentError, Reading, Window
from tests.identify.experiment.curves import approach, cycle, write

TIME, DEPTH, FORCE = approach()
GOOD = {"time (s)": TIME, "depth (mm)": 1e3 * DEPTH, "force (mN)": 1e3 * FORCE}
PLAIN = {"t": TIME, "z": 1e3 * DEPTH, "F": 1e3 * FORCE}
UNITS = {"depth": "mm", "force": "mN", "time": "s"}
TWICE = np.concatenate([TIME, TIME])
_, DEPTHS, FORCES = cycle()
TWO_CYCLES = {
    "time (s)": np.arange(800.0),
    "depth (mm)": 1e3 * np.tile(DEPTHS, 2),
    "force (mN)": 1e3 * np.tile(FORCES, 2),
}


def cell(row, column, text):
    """Return the change of a file that writes a text into a cell; row 0 has the headers."""

    def change(lines):
        fields = lines[row].split(",")
        fields[column] = text
        return [*lines[:row], ",".join(fields), *lines[row + 1 :]]

    return change


def shuffled(lines):
    """Return the lines with rows in no order."""
    return [lines[0], *np.random.default_rng(0).permutation(lines[1:])]


def saturated():
    return np.minimum(1e3 * FORCE, 30.0)


# What is in the file, how it is written, what the study says, and what the error must hold: place, finding, remedy.
ERRORS = {
    "unit of the key contradicts the header": (
        GOOD, {}, {"units": {"depth": "µm"}}, ["`depth (mm)`", "has the unit mm", 'units.depth is "µm"'],
    ),
    "unit in the name contradicts the header": (
        GOOD, {}, {"columns": {"force": "force (µN)", "depth": 2}}, ["has the unit mN", "force (µN)"],
    ),
    "no unit": (PLAIN, {}, {"columns": {"depth": "z", "force": "F"}}, ["`z`", "no unit", 'units = {depth = "mm"}']),
    "volts": (
        GOOD | {"deflection (V)": FORCE}, {}, {"columns": {"depth": 2, "force": "deflection (V)"}},
        ["`deflection (V)`", "cannot be force", "unknown unit `V`"],
    ),
    "depth and time swapped, with units": (
        GOOD, {}, {"columns": {"depth": "time (s)", "time": "depth (mm)", "force": 3}},
        ["`time (s)`", "cannot be depth", "no unit of a length"],
    ),
    "depth and time swapped, without units": (
        dict(zip("tzF", cycle(), strict=True)), {}, {"columns": {"depth": 1, "time": 2, "force": 3}, "units": UNITS},
        ["`z`", "time falls", "swapped"],
    ),
    "a point for thousands": (
        GOOD, {"separator": ";", "decimal": ",", "change": lambda x: [*x[:99], "9,9;1.234;5,1", *x[100:]]}, {},
        ["line 100", "`depth (mm)`", '"1.234" is no number'],
    ),
    "no such column": (GOOD, {}, {"columns": {"depth": "indentation"}}, ['no column "indentation"', "`depth (mm)`"]),
    "column beyond the last": (GOOD, {}, {"columns": {"force": 7}}, ["columns.force = 7", "there are 3"]),
    "one column for two": (
        GOOD, {}, {"columns": {"depth": 2, "force": 3, "time": 2}}, ["`depth (mm)`", "depth and time"],
    ),
    "duplicate columns": (
        {**GOOD, "Depth (mm)": DEPTH}, {}, {"columns": {"depth": "depth (mm)"}}, ["several columns", "2, 4"],
    ),
    "two depths": ({**GOOD, "piezo (mm)": DEPTH}, {}, {}, ["depth could be", "`piezo (mm)`", "write in [[meas"]),
    "no header": (GOOD, {"change": lambda lines: lines[1:]}, {}, ["depth is not found", "number 1"]),
    "a word among numbers": (
        GOOD, {"change": cell(149, 2, "OVERLOAD")}, {}, ["line 150", "`force (mN)`", '"OVERLOAD"'],
    ),
    "a word among numbers, and no depth": (
        {"time (s)": TIME, "spare": DEPTH, "force (mN)": FORCE}, {"change": cell(149, 2, "OVERLOAD")}, {},
        ["depth is not found", '`force (mN)` has text, "OVERLOAD" in line 150'],
    ),
    "empty column": (
        GOOD | {"force (mN)": np.nan * TIME}, {}, {"columns": {"force": 3}}, ["`force (mN)`", "no values"],
    ),
    "decimal commas between commas": (GOOD, {"decimal": ","}, {}, ["a header of 3", "decimal commas", "semicolons"]),
    "rows in no order": (GOOD, {"change": shuffled}, {}, ["time falls", "no order"]),
    "rows in no order, without time": (
        {k: GOOD[k] for k in ("depth (mm)", "force (mN)")}, {"change": shuffled}, {}, ["`depth (mm)`", "to and fro"],
    ),
    "some rows misplaced, without time": (
        {k: GOOD[k] for k in ("depth (mm)", "force (mN)")},
        {"change": lambda x: [*x[:50], x[180], *x[50:180], *x[181:]]},
        {},
        ["line 51", "`depth (mm)`", "in no order"],
    ),
    "a code for a missing force": (
        GOOD, {"change": cell(120, 2, "-999")}, {}, ["line 121", "`force (mN)`", "-0.999", "missing value"],
    ),
    "codes for missing depths": (
        GOOD,
        {"change": lambda x: cell(120, 1, "0")(cell(121, 1, "0")(x))},
        {},
        ["line 121", "`depth (mm)`", "missing value"],
    ),
    "two tests in one file": (
        {"time (s)": TWICE, "depth (mm)": np.tile(DEPTH, 2), "force (mN)": np.tile(FORCE, 2)}, {}, {},
        ["line 202", "time falls from 20 s to 0 s", "second test"],
    ),
    "sign of the force wrong": (GOOD, {}, {"force_sign": -1}, ["`force (mN)`", "never rises", "signs"]),
    "sign of the depth wrong": (GOOD, {}, {"depth_sign": -1}, ["no approach", "sign.depth"]),
    "retract for an approach": ({k: v[::-1] for k, v in list(GOOD.items())[1:]}, {}, {}, ["no approach", "retract"]),
    "no contact": (GOOD | {"force (mN)": 0.02 * np.cos(9.1 * np.arange(200.0))}, {}, {}, ["never rises", "noise"]),
    "constant force": (GOOD | {"force (mN)": 0 * TIME + 3}, {}, {}, ["`force (mN)`", "never changes"]),
    "constant depth": (GOOD | {"depth (mm)": 0 * TIME + 3}, {}, {}, ["`depth (mm)`", "never changes"]),
    "window of nothing": (
        GOOD, {}, {"window": Window(3e-3, 4e-3, "m")}, ["window 3 mm to 4 mm", "recorded are 0 mm to 2 mm"],
    ),
    "window of few": (GOOD, {}, {"window": Window(1e-3, 1.02e-3, "m")}, ["in the window", "at least 10"]),
    "window of time without time": (
        {"depth (mm)": 1e3 * DEPTH, "force (mN)": FORCE}, {}, {"window": Window(0, 1, "s")},
        ["window", "no column of time"],
    ),
    "few rows": ({k: v[::30] for k, v in GOOD.items()}, {}, {}, ["7 rows", "at least 10"]),
    "no cycle": (GOOD, {}, {"cycle": 2}, ["cycle = 2", "has 1"]),
    "no hold": (GOOD, {}, {"segment": "hold"}, ["no hold"]),
    "no retract": (GOOD, {}, {"segment": "retract"}, ["no retract"]),
    "depth and force swapped": (
        GOOD, {}, {"columns": {"depth": 3, "force": 2, "time": 1}, "units": {}}, ["cannot be depth", "`force (mN)`"],
    ),
    "depth and force swapped, without units": (
        PLAIN, {}, {"columns": {"depth": "F", "force": "z"}, "units": {"depth": "mm", "force": "mN"}},
        ["`F`", "goes to and fro", "swapped"],
    ),
    "a last row of zero": (GOOD, {"change": cell(200, 2, "0")}, {}, ["line 201", "`force (mN)`", "it is the last"]),
    "volts for a load": (
        {"z (mm)": 1e3 * DEPTH, "load (V)": 1e2 * FORCE}, {}, {}, ["force is not found", "unit V, no unit of a force"],
    ),
    "grams of another column": ({"z (mm)": 1e3 * DEPTH, "acc (g)": 1e2 * FORCE}, {}, {}, ["force is not found"]),
    "one header more than columns": (
        GOOD, {"change": lambda lines: [f"{lines[0]},x", *lines[1:]]}, {},
        ["depth is not found", "3 columns have 4 headers", "by number"],
    ),
    "one header fewer than columns": (
        GOOD, {"change": lambda lines: [lines[0].partition(",")[2], *lines[1:]]}, {"columns": {"depth": "depth"}},
        ["no column", "3 columns have 2 headers", "by number"],
    ),
    "a comma for thousands": (
        {"way (µm)": 1e6 * DEPTH, "load (mN)": 1e3 * FORCE}, {"separator": ";", "change":
        lambda lines: [lines[0], *(f"{float(a):,.1f};{b}" for a, b in (line.split(";") for line in lines[1:]))]}, {},
        ["line 102", "`way (µm)`", '"1,005.0" is no number'],
    ),
    "the only force is empty": (
        GOOD | {"force (mN)": np.nan * TIME}, {}, {}, ["force is not found", "`force (mN)` has no values"],
    ),
    "two tables": (
        GOOD, {"change": lambda lines: [*lines, *("1,2" for _ in range(50))]}, {},
        ["line 202", "2 columns", "others have 3"],
    ),
}  # fmt: skip

# What is in the file, how it is written, and what the note must say.
TOLD = {
    "saturated load cell": (GOOD | {"force (mN)": saturated()}, {}, ["largest value", "saturated", "left out"]),
    "saturated load cell with noise": (
        GOOD | {"force (mN)": saturated() + 0.03 * np.cos(7.3 * np.arange(200))}, {}, ["hardly rises", "saturated"],
    ),
    "time that stands still": (GOOD | {"time (s)": 0 * TIME + 5}, {}, ["time never changes", "`time (s)`", "not read"]),
    "depth and time swapped, of one ramp": (
        {"depth (mm)": np.arange(200) / 10, "time (s)": 12 + 1e3 * DEPTH + 3e-3 * np.cos(np.arange(200)),
         "force (mN)": 1e3 * FORCE}, {}, ["even steps from 0", "swapped"],
    ),
    "words for times": (
        GOOD, {"change": lambda x: [x[0], *(f"at {row}" for row in x[1:])]},
        ['`time (s)` has text, "at 0" in line 2', "not read as time"],
    ),
    "gap in time": (GOOD | {"time (s)": TIME + 30 * (TIME > 10)}, {}, ["gap of 30", "time", "line 102"]),
    "gap in depth": (
        GOOD, {"change": lambda lines: lines[:140] + lines[165:]}, ["gap of 0.00026", "depth", "line 141"],
    ),
    "blocks of rows swapped, without time": (
        {k: GOOD[k] for k in ("depth (mm)", "force (mN)")},
        {"change": lambda x: [x[0], *x[121:], *x[1:121]]},
        ["the depth jumps by 0.002 m before line 82"],
    ),
    "rows twice": (GOOD, {"change": lambda x: [x[0], *(r for row in x[1:] for r in (row, row))]}, ["200 rows", "time"]),
    "rows without a value": (GOOD, {"change": cell(149, 2, "")}, ["1 rows", "line 150", "left out"]),
    "rows of nan": (GOOD, {"change": cell(149, 1, "NaN")}, ["1 rows", "line 150", "left out"]),
    "empty column": (GOOD | {"spare": np.nan * TIME}, {}, ["columns without values: spare"]),
    "a line between rows": (GOOD, {"change": lambda x: [*x[:99], "paused", *x[99:]]}, ["line 100", "left out"]),
    "a row cut short": (GOOD, {"change": lambda lines: [*lines, "20.1,2.0"]}, ["line 202", "left out"]),
    "time without a unit": ({"t": TIME, "z (mm)": 1e3 * DEPTH, "F (N)": FORCE}, {}, ["`t` has no unit", "units"]),
    "several cycles": (TWO_CYCLES, {}, ["2 cycles", "number 1"]),
    "no air": ({k: v[100:] for k, v in GOOD.items()}, {}, ["little or no air"]),
    "metres for millimetres": (
        {"depth (m)": 1e3 * DEPTH, "force (mN)": FORCE, "time (s)": TIME}, {}, ["depth changes by 2 m", "unit"],
    ),
    "sign of depth": (GOOD | {"depth (mm)": -1e3 * DEPTH}, {}, ["depth falls", "`depth (mm)`", "sign is changed"]),
    "sign of force": (
        GOOD | {"force (mN)": -1e3 * FORCE}, {}, ["force is negative", "`force (mN)`", "sign is changed"],
    ),
    "two times": ({"clock time (s)": TIME + 5, **GOOD}, {}, ["time could be clock time (s), time (s)", "not read"]),
}  # fmt: skip


@pytest.mark.parametrize("slip", ERRORS)
def test_a_slip_is_an_error_by_name(tmp_path, slip):
    columns, how, given, parts = ERRORS[slip]
    path = write(tmp_path / "curve.csv", columns, **how)
    with pytest.raises(ExperimentError) as caught:
        read_curve(path, Reading(**given))
    assert all(part in str(caught.value) for part in (str(path), *parts)), caught.value


@pytest.mark.parametrize("slip", TOLD)
def test_a_slip_is_told(tmp_path, slip):
    columns, how, parts = TOLD[slip]
    notes = read_curve(write(tmp_path / "curve.csv", columns, **how), Reading()).notes
    assert any(all(part in line for part in parts) for line in notes), notes


BINARY = b"\x01\x00\x02\x00" * 99
# By name of the file: what is in it, and words of the message.
NO_CURVES = {
    "empty.csv": (b"", "is empty"),
    "blank.csv": (b" \n\n", "is empty"),
    "spreadsheet.csv": (b"PK\x03\x04 rest", "spreadsheet"),
    "HDF5.csv": (b"\x89HDF\r\n", "HDF5"),
    "binary.csv": (BINARY, "binary"),
    "binary.other": (BINARY, "binary"),
    "binary.xlsx": (BINARY, "spreadsheet"),
    "binary.ibw": (BINARY, "Igor"),
    "binary.jpk-force": (BINARY, "JPK"),
    "letter.csv": (b"Dear all,\nplease find the curves\nin the other folder.\n", "no table of numbers"),
    "one-column.csv": (b"1.0\n2.0\n3.0\n", "no table of numbers"),
}


@pytest.mark.parametrize("name", NO_CURVES)
def test_what_is_no_table_is_told(tmp_path, name):
    data, part = NO_CURVES[name]
    with pytest.raises(ExperimentError, match="No such file"):
        read_curve(tmp_path / name, Reading())
    (tmp_path / name).write_bytes(data)
    with pytest.raises(ExperimentError, match=part):
        read_curve(tmp_path / name, Reading())


def test_a_saturated_part_is_not_used(tmp_path):
    curve = read_curve(write(tmp_path / "a.csv", GOOD | {"force (mN)": saturated()}), Reading())
    assert curve.force.max() < 30e-3
    assert np.ptp(curve.depth) < 0.9 * np.ptp(DEPTH)


def test_coarse_steps_of_the_depth_are_no_holds(tmp_path):
    columns = GOOD | {"depth (mm)": np.round(1e3 * DEPTH, 1)}
    curve = read_curve(write(tmp_path / "a.csv", columns), Reading())
    assert np.ptp(curve.depth) == pytest.approx(np.ptp(DEPTH))
    assert not any("gap" in note for note in curve.notes)


def test_coarse_steps_of_the_force_are_not_saturation(tmp_path):
    steps = np.round(1e3 * FORCE / 4) * 4  # millinewtons, a sixteenth of the largest
    curve = read_curve(write(tmp_path / "a.csv", GOOD | {"force (mN)": steps}), Reading())
    assert curve.force.max() == pytest.approx(1e-3 * steps.max())
