"""Files of testing machines become the curves that were measured, whatever their layout."""

import os
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from epsmesh_identify.experiment.read import files_of, read_curve, read_curves
from epsmesh_identify.experiment.reading import ExperimentError, Reading, Window
from epsmesh_identify.sections.columns import ColumnUnits
from tests.identify.experiment.curves import AIR, DEEP, RAMP, approach, cycle, write

TIME, DEPTH, FORCE = approach()
IN_MM = {"time (s)": TIME, "depth (mm)": 1e3 * DEPTH, "force (mN)": 1e3 * FORCE}


def read(path, **given):
    return read_curve(path, Reading(**given))


def is_the_approach(curve) -> bool:
    """Tell whether a curve is the one that was written, but for an offset of the depth."""
    assert curve.time is not None
    np.testing.assert_allclose(curve.time, TIME, atol=1e-4)
    np.testing.assert_allclose(curve.depth - curve.depth[0], DEPTH, atol=1e-8)
    np.testing.assert_allclose(curve.force, FORCE, atol=1e-7)
    return True


def quoted(lines):
    """Return the lines with every field in quotation marks, and the units in a row of their own."""
    rows = [",".join(f'"{field}"' for field in line.split(";")) for line in lines[1:]]
    return ['"Elapsed Time","Disp","Load"', '"Sec","mm","mN"', *rows]


# How a file is written; "change" is made to its lines.
LAYOUTS = {
    "csv": {},
    "tabs": {"separator": "\t"},
    "semicolons and decimal commas": {"separator": ";", "decimal": ","},
    "tabs and decimal commas": {"separator": "\t", "decimal": ","},
    "comma and space": {"separator": ", "},
    "aligned": {"separator": "\t  "},
    "bars": {"separator": " | "},
    "UTF-16": {"encoding": "utf-16"},
    "UTF-8 with its mark": {"encoding": "utf-8-sig", "separator": ";"},
    "preamble": {"before": "Machine: press 7;\nOperator,me\nBall (mm),3\nSpeed 0.1 mm/s, twice\n\n"},
    "preamble as long as rows": {"before": "Date,2025-10-30,12:21\nWell,E5,x\n\n"},
    "comment": {"before": "# made by hand\n# "},
    "Excel's separator": {"before": "sep=;\n", "separator": ";"},
    "separator at the end of the header": {"change": lambda lines: [f"{lines[0]},", *lines[1:]]},
    "separators at the ends of rows": {"change": lambda lines: [lines[0], *(f"{row}," for row in lines[1:])]},
    "units below": {"change": lambda lines: ["Time,Extension,Load", "(s),(mm),(mN)", *lines[1:]]},
    "a column of words": {"change": lambda lines: [f"{lines[0]},phase", *(f"{row},loading" for row in lines[1:])]},
    "quotation marks": {"separator": ";", "change": quoted},
    "quotation marks and decimal commas": {"separator": ";", "decimal": ",", "change": quoted},
    "a summary above the table": {
        "before": '"Results 1"\n,"Specimen","Maximum load (N)"\n1,"A","0.06"\n\n"Time","Extension","Load"\n'
        '"(s)","(mm)","(mN)"\n',
        "change": lambda lines: lines[1:],
    },
    "German, with units below": {
        "before": '"Prüfzeit";"Traversenweg absolut";"Standardkraft"\ns;mm;mN\n',
        "separator": ";", "decimal": ",", "change": lambda lines: lines[1:],
    },
    "tabs at the ends, and seconds": {
        "before": "Test: x\nElapsed Time \tDisp\tLoad\t\nSec\tmm\tmN\t\n",
        "separator": "\t", "change": lambda lines: [f"{row}\t" for row in lines[1:]],
    },
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts(tmp_path, layout):
    path = write(tmp_path / "a.csv", IN_MM, **LAYOUTS[layout])
    assert is_the_approach(read(path))


HEADERS = [
    ("t / s", "z / mm", "F / mN"),
    ("Time [s]", "Indentation [mm]", "Load [mN]"),
    ("time_s", "displacement_mm", "force_mN"),
    ("Zeit in s", "Weg in mm", "Kraft in mN"),
    ("Timestamp(s)", "Z_Position(mm)", "Normal Force(mN)"),
    ("elapsed {s}", "Extension {mm}", "Load {mN}"),
]


@pytest.mark.parametrize("names", HEADERS)
def test_headers_with_units(tmp_path, names):
    curve = read(write(tmp_path / "a.csv", dict(zip(names, IN_MM.values(), strict=True))))
    assert is_the_approach(curve)
    assert any(f"depth is column `{names[1]}`" in note for note in curve.notes)


UNITS = [
    ("in", 25.4e-3, "gf", 9.80665e-3),
    ("inch", 25.4e-3, "lbf", 4.4482216152605),
    ("micron", 1e-6, "microN", 1e-6),
    ("millimeters", 1e-3, "g", 9.80665e-3),
    ("mil", 25.4e-6, "kgf", 9.80665),
]


@pytest.mark.parametrize(("length", "metres", "unit", "newtons"), UNITS)
def test_units_of_machines_and_scales(tmp_path, length, metres, unit, newtons):
    columns = {"time (s)": TIME, f"Extension ({length})": DEPTH / metres, f"Load ({unit})": FORCE / newtons}
    assert is_the_approach(read(write(tmp_path / "a.csv", columns)))
    plain = dict(zip("tzF", columns.values(), strict=True))
    names = {"time": "t", "depth": "z", "force": "F"}
    units = ColumnUnits.model_validate({"time": "s", "depth": length, "force": unit}).model_dump(exclude_none=True)
    curve = read(write(tmp_path / "b.csv", plain), columns=names, units=units)
    assert is_the_approach(curve)
    assert any("1 g is 0.00980665 N" in note for note in curve.notes) == (unit == "g")


def test_headers_of_rows_with_a_name_or_a_number(tmp_path):
    """As R writes tables: the names of rows have no header."""
    for name in ("{}", "row{}"):
        rows = lambda lines: [lines[0], *(f"{name.format(n)},{row}" for n, row in enumerate(lines[1:], 1))]  # noqa: B023, E731
        curve = read(write(tmp_path / "a.csv", IN_MM, change=rows))
        assert is_the_approach(curve)
        assert any("the first column has the names of rows" in note for note in curve.notes)


def test_micro_in_a_western_encoding(tmp_path):
    columns = {"Zeit (s)": TIME, "Weg (µm)": 1e6 * DEPTH, "Kraft (mN)": 1e3 * FORCE}
    assert is_the_approach(read(write(tmp_path / "a.txt", columns, encoding="latin-1", separator=";", decimal=",")))


def test_no_header_but_numbers_and_units(tmp_path):
    path = write(tmp_path / "a.txt", IN_MM, separator=" ", change=lambda lines: lines[1:])
    columns, units = {"time": 1, "depth": 2, "force": 3}, {"time": "s", "depth": "mm", "force": "mN"}
    assert is_the_approach(read(path, columns=columns, units=units))


def test_columns_by_name_without_their_unit_or_with_it(tmp_path):
    columns = {"t": TIME, "z": 1e3 * DEPTH, "raw": 0 * TIME, "F": 1e3 * FORCE}
    path = write(tmp_path / "a.csv", columns)
    assert is_the_approach(read(path, columns={"depth": "z / mm", "force": "F (mN)", "time": "T [s]"}))
    path = write(tmp_path / "b.csv", IN_MM | {"other (mm)": TIME})
    assert is_the_approach(read(path, columns={"depth": "depth", "force": "Force (mN)"}))


def test_a_spring_and_its_deflection(tmp_path):
    stiffness = 50.0
    deflection = FORCE / stiffness
    columns = {"t (s)": TIME, "Z (mm)": 1e3 * (DEPTH + deflection), "deflection (mm)": 1e3 * deflection}
    names = {"piezo": "Z", "deflection": "deflection", "time": "t"}
    assert is_the_approach(read(write(tmp_path / "a.csv", columns), columns=names, spring=stiffness))


def test_two_forces_that_differ_by_a_constant_are_one(tmp_path):
    curve = read(write(tmp_path / "a.csv", IN_MM | {"less baseline (mN)": 1e3 * FORCE - 3}, change=lambda lines: [
        lines[0].replace("less baseline", "corrected force"), *lines[1:]]))  # fmt: skip
    assert is_the_approach(curve)
    assert any("no more than a constant" in note for note in curve.notes)


def test_segments_of_a_ramp_and_hold(tmp_path):
    time, depth, force = cycle(hold=100)
    path = write(tmp_path / "a.csv", {"time (s)": time, "depth (mm)": 1e3 * depth, "force (mN)": 1e3 * force})
    up, hold, both, down = (read(path, segment=s) for s in ("approach", "hold", "approach+hold", "retract"))
    assert abs(len(up.depth) - 200) <= 3 and abs(len(hold.depth) - 100) <= 6 and abs(len(down.depth) - 200) <= 3
    assert len(both.depth) == len(up.depth) + len(hold.depth)
    assert np.ptp(hold.depth) < 0.02 * DEEP
    assert up.time is not None and hold.time is not None and hold.time[0] == pytest.approx(RAMP, abs=0.5)
    assert hold.force[-1] < 0.8 * up.force[-1]


def test_cycles_are_apart(tmp_path):
    time, depth, force = cycle()
    columns = {
        "time (s)": np.concatenate([time, time + time[-1] + 0.1, time + 2 * time[-1] + 0.2]),
        "depth (mm)": 1e3 * np.tile(depth, 3),
        "force (mN)": np.concatenate([1e3 * force, 900 * force, 800 * force]),
    }
    path = write(tmp_path / "a.csv", columns)
    curves = [read(path, cycle=number) for number in (1, 2, 3)]
    assert [round(c.force.max() / force.max(), 2) for c in curves] == [1.0, 0.9, 0.8]
    assert any("3 cycles" in note for note in curves[0].notes)


def test_a_window_of_depth_or_time_as_recorded(tmp_path):
    path = write(tmp_path / "a.csv", {"time (s)": TIME + 1000, "z (mm)": -1e3 * DEPTH, "F (mN)": 1e3 * FORCE})
    curve = read(path, window=Window(-1.5e-3, -0.5e-3, "m"))
    assert np.ptp(curve.depth) == pytest.approx(1e-3, rel=0.02)
    curve = read(path, window=Window(0.0, 15.0, "s"))
    assert curve.time is not None and curve.time[-1] == pytest.approx(15, abs=0.1)


def test_air_far_longer_than_contact_is_cut(tmp_path):
    far = np.linspace(-9e-3, 0, 900, endpoint=False)
    noise = np.random.default_rng(3).normal(0, 2e-5, len(far))
    depth, force = np.concatenate([far, DEPTH]), np.concatenate([noise, FORCE])
    curve = read(write(tmp_path / "a.csv", {"depth (mm)": 1e3 * depth, "force (mN)": 1e3 * force}))
    air = AIR - (curve.depth[0])
    assert DEEP < air < 3 * DEEP
    assert any("air" in note for note in curve.notes)
    whole = read(tmp_path / "a.csv", window=Window(-9e-3, 2e-3, "m"))
    assert len(whole.depth) == len(depth)  # a window is the user's


def test_a_folder_of_curves_in_the_order_of_their_numbers(tmp_path):
    (tmp_path / "curves").mkdir()
    for number in (1, 2, 10):
        write(tmp_path / "curves" / f"well_{number}.csv", IN_MM | {"force (mN)": number * 1e3 * FORCE})
    curves = read_curves("curves/*.csv", Reading(), tmp_path)
    assert [curve.name for curve in curves] == ["well_1", "well_2", "well_10"]
    assert [round(curve.force.max() / FORCE.max()) for curve in curves] == [1, 2, 10]
    assert files_of(str(tmp_path / "curves" / "*.csv"), Path("elsewhere")) == files_of("curves/*.csv", tmp_path)
    (tmp_path / "gels [2025] a?").mkdir()
    for name in ("gel [1].csv", "gel [2].csv"):
        write(tmp_path / "gels [2025] a?" / name, IN_MM)
    for pattern, folder in (("*.csv", tmp_path / "gels [2025] a?"), ("gels [2025] a?/*.csv", tmp_path)):
        assert [path.name for path in files_of(pattern, folder)] == ["gel [1].csv", "gel [2].csv"]
    (tmp_path / "curves" / "well_2.csv").write_text("nothing")
    first, second, third = read_curves("curves/*.csv", Reading(), tmp_path)
    assert (first.name, third.name) == ("well_1", "well_10")
    assert isinstance(second, ExperimentError) and "well_2" in str(second)
    for number in (1, 10):
        (tmp_path / "curves" / f"well_{number}.csv").write_text("nothing")
    with pytest.raises(ExperimentError, match=r"3 files, and none has such a curve(.|\n)*well_2"):
        read_curves("curves/*.csv", Reading(), tmp_path)


REAL = Path(os.environ.get("EPSMESH_CURVES", "nowhere"))


@pytest.mark.skipif(not REAL.is_dir(), reason="EPSMESH_CURVES names no folder of measured curves")
def test_measured_curves_are_read_as_they_are():
    for well, force in (("E5", 10.0), ("E6", 10.3), ("E7", 10.2)):
        curve = read(REAL / "asmi" / f"well_{well}.csv")
        assert curve.time is not None and 0.15e-2 < np.ptp(curve.depth) < 0.2e-2
        assert np.ptp(curve.force) == pytest.approx(force, rel=0.02)
    for curve in read_curves("ecoflex/EF*.csv", Reading(), REAL):
        assert np.ptp(curve.depth) == pytest.approx(20e-3, rel=1e-3)
        assert len(curve.depth) == 1202


MICROSCOPE = """# xPosition: 0.0
# springConstant: 0.05
#
# columns: height vDeflection seriesTime
# fancyNames: "Height (measured)" "Vertical deflection" "Series Time"
# units: m N s
"""
AFTER = ["", "# segmentIndex: 1", "# segment: pause"]


def test_a_file_of_a_force_microscope(tmp_path):
    columns = {"a": 9e-3 - DEPTH, "b": FORCE, "c": TIME}
    change = lambda lines: [*lines[1:150], *AFTER, *lines[150:]]  # noqa: E731
    curve = read(write(tmp_path / "a.txt", columns, separator=" ", before=MICROSCOPE, change=change))
    assert is_the_approach(curve)
    assert "depth is column `Height (measured)" in " ".join(curve.notes)


def test_the_mark_of_a_comment_is_no_part_of_a_header(tmp_path):
    path = write(tmp_path / "a.csv", IN_MM, before="# ")
    assert any("column `time (s)`" in note for note in read(path).notes)
    assert is_the_approach(read(path, columns={"time": "# time (s)"}))


def test_a_retract_alone_without_air_is_a_retract(tmp_path):
    way = np.linspace(1, 0, 100)
    curve = read(write(tmp_path / "a.csv", {"z (mm)": way, "F (N)": 10 * way}), segment="retract")
    assert curve.force[0] == pytest.approx(10) and curve.depth[0] > curve.depth[-1]


LABVIEW = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t.
X_Columns\tOne
Date\t2025/10/30
Time\t12:21:07.250
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t200\t200\t
Y_Unit_Label\tMillimeters\tmN\t
X_Dimension\tTime\tTime\t
X0\t0.0E+0\t0.0E+0\t
Delta_X\t0.1\t0.1\t
***End_of_Header***\t\t\t
X_Value\tDisplacement\tForce\tComment
"""


@pytest.mark.parametrize("ending", ["", "\t"])
def test_files_of_labview(tmp_path, ending):
    change = lambda lines: [f"{row}{ending}" for row in lines[1:]]  # noqa: E731
    curve = read(write(tmp_path / "a.lvm", IN_MM, separator="\t", before=LABVIEW, change=change))
    assert is_the_approach(curve)
    assert any("time is column `X_Value (s)`" in note for note in curve.notes)


@pytest.mark.parametrize(
    ("form", "begin", "longer"),
    [
        ("%H:%M:%S.%f", "2025-10-30 23:59:50", 1),
        ("%Y-%m-%d %H:%M:%S.%f", "2025-10-30 23:59:50", 1),
        ("%Y-%m-%dT%H:%M:%S.%f", "2025-10-31 10:00:00", 9000),  # over two nights
        ("%d.%m.%Y %H:%M:%S,%f", "2025-02-28 23:00:00", 4500),  # 25 hours
        ("%m/%d/%Y %H:%M:%S.%f", "2025-10-11 20:00:00", 4500),
        ("%d/%m/%Y %H:%M:%S.%f", "2025-10-11 20:00:00", 4500),
        ("%m/%d/%Y %I:%M:%S.%f %p", "2025-10-11 11:59:50", 4500),
        ("%Y-%m-%dT%H:%M:%S.%f+02:00", "2025-10-31 10:00:00", 9000),
        ("%d.%m.%Y;%H:%M:%S.%f", "2025-02-28 23:00:00", 4500),  # date and time in two columns
    ],
)
def test_clock_times_over_midnight(tmp_path, form, begin, longer):
    def clock(lines):
        rows = [line.split(",") for line in lines[1:]]
        times = [datetime.fromisoformat(begin) + timedelta(seconds=longer * float(row[0])) for row in rows]
        head = "Date;" * (";" in form) + lines[0].replace("time (s)", "Time").replace(",", ";")
        return [head, *(";".join([t.strftime(form), *row[1:]]) for t, row in zip(times, rows, strict=True))]

    curve = read(write(tmp_path / "a.csv", IN_MM, change=clock))
    assert curve.time is not None
    np.testing.assert_allclose(curve.time, longer * TIME, atol=2e-3 * longer)
    np.testing.assert_allclose(curve.force, FORCE, atol=1e-7)
