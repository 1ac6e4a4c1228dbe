"""Names of labels: in headers of NIfTI and NRRD, in files beside the image, and those of TotalSegmentator."""

import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from epsmesh.class_maps import CLASS_MAPS
from epsmesh.printable import printable
from epsmesh.shapes.triangles import SurfaceError

Names = dict[int, str]
_CLASSES = Path(__file__).parent / "totalsegmentator.toml"
_LARGEST = 10_000_000  # bytes of a file of names
_LONGEST = 100  # letters of a name
_BACKGROUND = 0
# `1  230 165 145  1 1 1 "liver"` of ITK-SNAP, `1 liver 230 165 145 255` of 3D Slicer and FreeSurfer.
_SNAP = re.compile(r'^\s*(\d+)\s+\d+\s+\d+\s+\d+\s+[\d.]+\s+\d+\s+\d+\s+"(.*)"\s*$')
_TABLE = re.compile(r"^\s*(\d+)\s+(\S.*?)\s+\d+\s+\d+\s+\d+\s+\d+\s*$")
_SEGMENT = re.compile(r"^Segment(\d+)_Name$")


@cache
def _class_map(task: str) -> Names:
    names = tomllib.loads(_CLASSES.read_text(encoding="utf-8"))[task]["names"]
    return dict(enumerate(names, start=1))


def read_names(given: str) -> Names:
    """Return the names that the key ``names`` gives: a file, or a word for those of TotalSegmentator.

    Raises:
        SurfaceError: if the file cannot be read, or holds no names.
    """
    if given in CLASS_MAPS:
        return _class_map(given)
    path = Path(given)
    try:
        if not path.is_file() or path.stat().st_size > _LARGEST:
            raise SurfaceError(f"`names`: {path} is no file of up to {_LARGEST / 1e6:g} MB; {_ALLOWED}")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise SurfaceError(f"`names`: {path} cannot be read: {error}") from None
    found = _of_json(text) if text.lstrip()[:1] in "{[" else _of_lines(text)
    if not found:
        raise SurfaceError(f"`names`: {path} has no names of labels; {_ALLOWED}")
    return found


_ALLOWED = (
    "allowed are JSON with `labels` (nnU-Net's dataset.json), label descriptions of ITK-SNAP, "
    "colour tables of 3D Slicer (.ctbl, .txt), and totalsegmentator"
)


def names_of_extensions(contents: Iterable[bytes]) -> Names:
    """Return the names in extensions of a NIfTI header: a label table in XML (TotalSegmentator) or JSON."""
    found: Names = {}
    for content in contents:
        text = bytes(content).decode("utf-8", "replace").strip("\0 \r\n\t")
        if text.startswith("{"):
            found |= _of_json(text)
        # An entity may stand for any amount of text.
        elif text.startswith("<") and "<Label" in text and "<!" not in text.replace("<![CDATA[", ""):
            found |= _of_xml(text)
    return found


def segments_of_header(header: Mapping[str, Any]) -> list[tuple[int, int, str]]:
    """Return layer, label and name of the segments in a NRRD header of 3D Slicer."""
    found = []
    for number in sorted(int(key[1]) for key in map(_SEGMENT.match, header) if key):
        # Files of 3D Slicer 4.10 and before have a layer for each segment, and no fields of label and layer.
        layer, label = (header.get(f"Segment{number}_{what}") for what in ("Layer", "LabelValue"))
        name = clean(header[f"Segment{number}_Name"])
        found.append((number if layer is None else int(layer), 1 if label is None else int(label), name))
    return found


def _of_json(text: str) -> Names:
    """Return the names of ``{"labels": {"liver": 1}}`` or ``{"labels": {"1": "liver"}}``, or of the table alone."""
    try:
        table = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    table = table.get("labels", table) if isinstance(table, dict) else None
    found: Names = {}
    for key, value in table.items() if isinstance(table, dict) else ():
        if isinstance(value, int) and not isinstance(value, bool):
            found[value] = clean(key)
        elif isinstance(value, str) and key.isdecimal():
            found[int(key)] = clean(value)
    return _without_background(found)


def _of_lines(text: str) -> Names:
    rows = (match for line in text.splitlines() if (match := _SNAP.match(line) or _TABLE.match(line)))
    return _without_background({int(match[1]): clean(match[2]) for match in rows})


def _of_xml(text: str) -> Names:
    try:
        labels = ElementTree.fromstring(text).iter("Label")
    except ElementTree.ParseError:
        return {}
    found = ((one.get("Key", ""), "".join(one.itertext())) for one in labels)
    return _without_background({int(key): clean(name) for key, name in found if key.isdecimal()})


def _without_background(names: Names) -> Names:
    return {label: name for label, name in names.items() if label > _BACKGROUND and name}


def clean(name: Any) -> str:
    """Return a name that others wrote as one line that can be shown."""
    return printable(str(name).strip())[:_LONGEST]
