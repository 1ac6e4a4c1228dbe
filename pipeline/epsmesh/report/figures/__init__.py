"""The figures of a study, drawn from its dataset alone."""

import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from epsmesh.files import FIGURE_FORMATS
from epsmesh.printable import counted
from epsmesh.report.figures.compliance import compliance, shows_tools
from epsmesh.report.figures.facets import Facets, is_meshed, rest, swept, with_error
from epsmesh.report.figures.influence import influence
from epsmesh.report.figures.insertion import insertion
from epsmesh.report.figures.map import force_map
from epsmesh.report.figures.style import STYLE, add_note, save
from epsmesh.report.figures.sweep import error, error_facets, force, history, nothing, ratio, ratio_facets
from epsmesh.report.study import study_of, warnings_of
from epsmesh.report.values import at_peak, has_path, of_path
from epsmesh.report.words import is_numeric, without_shared
from epsmesh.states import FAILED, NO_CONTACT, PARTIAL, PENDING, SKIPPED
from epsmesh.study.vocabulary import FIGURES

__all__ = ["KINDS", "STYLE", "choose", "describe", "draw", "figure", "files", "lacks", "save"]

# Kinds that show time, or the depth of an insertion; all others show those of the largest force.
_OVER_TIME = ("history", "insertion")
_DRAWN: dict[str, Callable[[xr.Dataset, str, str], Figure]] = {
    "insertion": insertion,
    "history": history,
    "ratio": ratio,
    "error": error,
    "force": force,
    "map": force_map,
    "compliance": compliance,
    "influence": influence,
    "nothing": nothing,
}
# What can be drawn on request.
KINDS = (*FIGURES, "nothing")
_FACETS: dict[str, Callable[[xr.Dataset], Facets]] = {"ratio": ratio_facets, "error": error_facets}
_NEEDS = {
    "insertion": "an insertion ([probe.insertion])",
    "history": "a history of the depth ([probe.history])",
    "ratio": "several ε, and the full order among them",
    "error": "swept meshes, and F_exact or F_max",
    "compliance": "several tools and ε, the full order among them, in scenes whose compliances add",
    "influence": "where F is decided ([solve] influence)",
    "map": "a raster of places ([probe.path])",
    "force": "several cases, and a force",
    "nothing": "that no case has a force",
}
_LONG_NAME = 34  # letters of a name that a figure shows
_SHARED = 24  # letters of a value beyond which words that all values share are left out
_NAMED = ("probe", "body")  # their values are names that a study gives


def choose(dataset: xr.Dataset) -> list[str]:
    """Return the kinds of figures that suit ``dataset``, its main one first: what its study asks for, if it suits.

    One case has a figure only of what it has over time, depth or place: its force is a number.
    """
    if not _known(dataset, "force"):
        return ["nothing"]
    is_over_time, is_path = "time" in dataset.dims, has_path(dataset)
    dataset = _still(dataset)
    is_of_depth = dataset.sizes.get("depth", 0) > 1
    suits = {
        "insertion": is_path,
        "history": is_over_time,
        "ratio": dataset.sizes.get("epsilon", 0) > 1 and _known(dataset, "force_ratio"),
        "error": is_meshed(dataset) and _has_errors(dataset),
        "map": all(dataset.sizes.get(name, 0) > 1 for name in ("x", "y")),
        "force": not is_path and bool(swept(dataset)),
    }
    kinds = [kind for kind, is_suited in suits.items() if is_suited]
    if is_of_depth and (_known(dataset, "linear_ratio") or _known(dataset, "contact_area")):
        kinds.sort(key=lambda kind: kind not in _OVER_TIME and kind != "force")
    kinds += ["influence"] if _known(dataset, "influence_radius") else []
    kinds += ["compliance"] if "ratio" in kinds and shows_tools(dataset) else []
    study = study_of(dataset)
    asked = study.drawing.kind if study else "auto"
    return sorted(dict.fromkeys(kinds), key=asked.__ne__)


def describe(kind: str) -> str:
    """Return what a kind of figure shows, in a sentence without its stop."""
    return (_DRAWN[kind].__doc__ or "").strip().rstrip(".")


def lacks(dataset: xr.Dataset, kind: str) -> str:
    """Return what ``dataset`` lacks for a figure of this kind, '' if nothing."""
    return "" if kind in choose(dataset) else f"needs {_NEEDS[kind]}"


def draw(
    dataset: xr.Dataset,
    stem: Path,
    formats: Sequence[str] = FIGURE_FORMATS,
    kinds: Sequence[str] | None = None,
    *,
    rest: bool = False,
) -> list[Path]:
    """Draw figures of ``dataset``, by default its main one; return the files written.

    The main figure goes to ``<stem>.png`` and ``.svg``, those of other ``kinds`` to ``<stem>_<kind>.png`` and ``.svg``,
    and, with the ``rest``, what each leaves out to ``<stem>_<kind>_2.png`` and so on.
    """
    written = []
    with mpl.rc_context(STYLE):
        for kind, paths in files(dataset, stem, formats, kinds).items():
            drawn = figure(dataset, kind)
            written += [save(drawn, path) for path in paths]
            for number, (words, part) in enumerate(_rest(dataset, kind) if rest else [], start=2):
                title = " – ".join(filter(None, (str(dataset.attrs.get("title", "")), words)))
                drawn = figure(part.assign_attrs(title=title), kind)
                written += [save(drawn, stem.with_name(f"{stem.name}_{kind}_{number}.{suffix}")) for suffix in formats]
    return written


def files(
    dataset: xr.Dataset, stem: Path, formats: Sequence[str] = FIGURE_FORMATS, kinds: Sequence[str] | None = None
) -> dict[str, list[Path]]:
    """Return by kind the files that :func:`draw` writes, without the rest."""
    main = choose(dataset)[:1]
    names = {kind: stem.name if kind in main else f"{stem.name}_{kind}" for kind in (main if kinds is None else kinds)}
    return {kind: [stem.with_name(f"{name}.{suffix}") for suffix in formats] for kind, name in names.items()}


def figure(dataset: xr.Dataset, kind: str, *, titled: bool = True) -> Figure:
    """Draw the figure of one ``kind``, with the study's title or without."""
    title = _plain(str(dataset.attrs.get("title", ""))) if titled else ""
    with mpl.rc_context(STYLE):
        shown = dataset if kind in _OVER_TIME else _still(dataset)
        missing = _missing(dataset)
        drawn = _DRAWN[kind](_with_short_names(shown), title, missing)
        if titled and (warnings := warnings_of(dataset)):
            add_note(drawn, f"{counted(len(warnings), 'warning')} about the model: see the report.", missing)
    return drawn


def _still(dataset: xr.Dataset) -> xr.Dataset:
    """Return what figures without time show: the largest force; of an insertion, what its path is judged by."""
    return of_path(dataset) if has_path(dataset) else at_peak(dataset)


def _rest(dataset: xr.Dataset, kind: str) -> list[tuple[str, xr.Dataset]]:
    dataset = _still(dataset)
    return list(rest(dataset, _FACETS[kind](dataset))) if kind in _FACETS else []


def _with_short_names(dataset: xr.Dataset) -> xr.Dataset:
    """Return ``dataset`` with names that fit a figure, differ from one another, and are no formulas."""
    plain = {}
    for dim in (dim for dim in swept(dataset) if not is_numeric(dataset[dim])):
        names = own = [str(value) for value in dataset[dim].values]
        if dim not in _NAMED and max(len(name) for name in names) > _SHARED:
            own = without_shared(names)
        short = [_plain(textwrap.shorten(name, _LONG_NAME, placeholder="…")) for name in own]
        if len(set(short)) == len(names) and short != names:
            plain[dim] = (dim, short, dataset[dim].attrs)
    return dataset.assign_coords(plain) if plain else dataset


def _plain(text: str) -> str:
    """Return ``text`` so that it is no formula, whatever is in it."""
    return text.replace("$", r"\$")


def _known(dataset: xr.Dataset, name: str) -> bool:
    return name in dataset and bool(np.isfinite(dataset[name]).any())


def _has_errors(dataset: xr.Dataset) -> bool:
    """Tell whether some F is off its reference: on a logarithmic axis, none is not drawn."""
    is_compared = _known(dataset, "force_exact_ratio") or _known(dataset, "force_ratio")
    return is_compared and _known(with_error(dataset)[1], "error")


def _missing(dataset: xr.Dataset) -> str:
    """Say which cases have no force, and what error bars leave out."""
    words = {
        FAILED: "failed (×)",
        PARTIAL: "ended before the depth (×)",
        SKIPPED: "skipped",
        PENDING: "not yet run",
        NO_CONTACT: "no contact",
    }
    counts = {word: int((dataset["status"] == state).sum()) for state, word in words.items()}
    text = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    comment = str(dataset["force_error"].attrs.get("comment", "")) if "force_error" in dataset else ""
    found = "; ".join(filter(None, (f"cases: {text}" if text else "", comment)))
    return f"{found[:1].upper()}{found[1:]}"
