"""What `epsmesh view` does with a label map: a table of its labels, a section for a study, and a page."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from epsmesh.cli.console import say, warning
from epsmesh.cli.faults import Fault, fail, of_option
from epsmesh.cli.words import check_output

if TYPE_CHECKING:
    from epsmesh.shapes.files.label_map import LabelMap
    from epsmesh.view.segments import Segment

_HOWTO = "docs/guide/bodies.md"
_HEADS = ("label", "name", "cm³", "extent, mm", "pieces", "x, mm", "y, mm", "z, mm")
_MM = 1e3


@dataclass(frozen=True)
class Given:
    """What a command says of a label map: ``unit`` and ``names`` as in a study, "" if not; the chosen label."""

    file: Path
    unit: str
    names: str
    label: str

    @property
    def keys(self) -> dict[str, str]:
        """The keys of a study's body."""
        return {"file": str(self.file), "unit": self.unit, "names": self.names}


def view_image(given: Given, output: Path) -> None:
    """Print what labels an image has, and a ``[body]`` of one; write the page of all."""
    from epsmesh.shapes.files.labels import read_labels
    from epsmesh.shapes.files.loaded import UNITS
    from epsmesh.shapes.triangles import SurfaceError
    from epsmesh.view.image import write_image_page
    from epsmesh.view.segments import block, segments_of

    path = output / f"{given.file.name.split('.')[0]}.html"
    check_output(path)
    if given.unit and given.unit not in UNITS:
        fail(of_option("--unit", given.unit, f"must be one of {', '.join(UNITS)}"))
    try:
        found = read_labels(given.file, UNITS[given.unit] if given.unit else None, given.names)
        segments = segments_of(found)
        chosen = _chosen(found, segments, given.label)
    except (SurfaceError, OSError) as wrong:
        fail(Fault(f"{given.file}: {wrong}", file=str(given.file), howto=_HOWTO))
    write_image_page(found, segments, path, given.keys)
    for notice in found.notices:
        warning(f"{given.file}: {notice}")
    text = block(chosen, **given.keys)
    say(
        {"labels": [_data(one) for one in segments], "body": text, "files": [str(path)]},
        *_table(segments),
        "",
        f"# {chosen.title}: `file` is its path from the study's folder",
        text,
        "",
        f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB), to be opened in a browser",
    )


def _chosen(found: "LabelMap", segments: "list[Segment]", label: str) -> "Segment":
    """Return the label that a number or a name means, or else the largest one."""
    from epsmesh.shapes.files.label_map import of_label

    if not label:
        return max(segments, key=lambda one: one.volume)
    number = found.number(int(label) if label.isdecimal() else label)
    of_label(found, number)
    return next(one for one in segments if one.label == number)


def _data(one: "Segment") -> dict[str, Any]:
    """Return what a script gets of a label, in SI units."""
    return {
        "label": one.label,
        "name": one.name,
        "volume": one.volume,
        "box": one.box.tolist(),
        "pieces": one.pieces,
        "share_of_largest_piece": one.share,
        "sides_at_the_image_end": one.cut,
    }


def _table(segments: "list[Segment]") -> list[str]:
    rows = [_HEADS, *(_row(one) for one in segments)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_HEADS))]
    left = (1,)
    aligned = [
        "  ".join(
            cell.ljust(w) if k in left else cell.rjust(w) for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
    ends = [" *" if one.cut else "" for one in segments]
    lines = [aligned[0], *(line + end for line, end in zip(aligned[1:], ends, strict=True))]
    return [*lines, "* reaches the image's end"] if any(ends) else lines


def _row(one: "Segment") -> tuple[str, ...]:
    pieces = str(one.pieces) if one.pieces == 1 else f"{one.pieces} (largest {100 * one.share:.3g} %)"
    ranges = (f"{_MM * low:.0f} … {_MM * high:.0f}" for low, high in one.box.T)
    extent = " × ".join(f"{_MM * side:.0f}" for side in one.extent)
    return (str(one.label), one.name, f"{1e6 * one.volume:.4g}", extent, pieces, *ranges)
