"""The text of a file of a testing machine, whatever its encoding."""

from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from pathlib import Path

from epsmesh_identify.experiment.reading import ExperimentError

# A curve of a million rows has some 50 MB.
_MOST_BYTES = 200_000_000
# Files of programs by their names' endings, and how they are exported as text.
_CSV = "save the table as CSV"
_JPK = "is a file of a JPK microscope: export the curve as text (.txt) in its program"
_HDF5 = "is an HDF5 file: write time, depth and force as CSV, as by numpy.savetxt"
_FORMATS = {
    **dict.fromkeys((".xls", ".xlsx", ".xlsm", ".ods", ".numbers"), f"is a spreadsheet: {_CSV}"),
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), _HDF5),
    **dict.fromkeys((".jpk-force", ".jpk-force-map", ".jpk-qi-data"), _JPK),
    ".mat": "is a MATLAB file: write the columns with writematrix([time depth force], 'curve.csv')",
    ".tdms": "is a TDMS file of LabVIEW: write it as a text file (.lvm), or save it as CSV",
    ".ibw": "is a wave of Igor: write it with Save Waves, Save Delimited Text",
    ".pdf": f"is a PDF: {_CSV}",
}
# Beginnings of such files.
_BINARY = {
    b"PK\x03\x04": f"is a spreadsheet or an archive: {_CSV}",
    b"\xd0\xcf\x11\xe0": _FORMATS[".xls"],
    b"\x89HDF": _HDF5,
    b"%PDF": _FORMATS[".pdf"],
    b"MATLAB": _FORMATS[".mat"],
    b"TDSm": _FORMATS[".tdms"],
}
# What word processors and tables write for signs of numbers.
_SIGNS = str.maketrans({"\N{MINUS SIGN}": "-", "\N{NO-BREAK SPACE}": " ", "\N{NARROW NO-BREAK SPACE}": " "})


def read_lines(path: Path) -> list[str]:
    """Return the lines of a text file.

    Raises:
        ExperimentError: if it is missing, empty, binary or too large.
    """
    try:
        size = path.stat().st_size
        data = path.read_bytes() if path.is_file() and size <= _MOST_BYTES else b""
    except (OSError, ValueError) as error:  # a name with a NUL is a ValueError
        raise ExperimentError(str(path), getattr(error, "strerror", None) or str(error)) from None
    if not path.is_file():
        raise ExperimentError(str(path), "is no file")
    if why := _FORMATS.get(path.suffix.lower()):
        raise ExperimentError(str(path), why)
    if size > _MOST_BYTES:
        raise ExperimentError(str(path), f"is larger than {_MOST_BYTES / 1e6:g} MB")
    if not data.strip():
        raise ExperimentError(str(path), "is empty")
    return _decoded(data, str(path)).translate(_SIGNS).splitlines()


def _decoded(data: bytes, file: str) -> str:
    """Return the text of UTF-8, UTF-16 with its mark, or the code page of Western Europe."""
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        try:
            return data.decode("utf-16")
        except UnicodeDecodeError as error:
            raise ExperimentError(file, f"is no text: {error}") from None
    for start, why in _BINARY.items():
        if data.startswith(start):
            raise ExperimentError(file, why)
    if b"\0" in data:
        raise ExperimentError(file, "is binary: export it as text, such as CSV")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
