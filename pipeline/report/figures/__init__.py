"""The figures of a study, drawn from its dataset alone."""

from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib as mpl
import xarray as xr
from matplotlib.figure import Figure

from pipeline.files import FIGURE_FORMATS
from pipeline.report.figures.accuracy import accuracy
from pipeline.report.figures.choose import KINDS, choose, lacks
from pipeline.report.figures.compliance import compliance
from pipeline.report.figures.contact import contact
from pipeline.report.figures.convergence import convergence
from pipeline.report.figures.epsilon import epsilon, ratio, speedup
from pipeline.report.figures.exact import exact
from pipeline.report.figures.force import force, nothing
from pipeline.report.figures.linear import linear
from pipeline.report.figures.loads import loads
from pipeline.report.figures.map import force_map
from pipeline.report.figures.parts import parts
from pipeline.report.figures.style import STYLE, save
from pipeline.report.figures.text import shortened
from pipeline.report.words import is_numeric

__all__ = ["FIGURES", "KINDS", "STYLE", "choose", "draw", "figure", "files", "lacks", "save"]

FIGURES: dict[str, Callable[[xr.Dataset, str, str], Figure]] = {
    "epsilon": epsilon, "exact": exact, "convergence": convergence, "accuracy": accuracy, "map": force_map,
    "force": force, "compliance": compliance, "linear": linear, "contact": contact, "loads": loads,
    "nothing": nothing, "ratio": ratio, "speedup": speedup,
}  # fmt: skip


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
            for number, (words, part) in enumerate(parts(dataset, kind) if rest else [], start=2):
                titled = part.assign_attrs(title=" – ".join(filter(None, (str(part.attrs.get("title", "")), words))))
                drawn = figure(titled, kind)
                written += [save(drawn, stem.with_name(f"{stem.name}_{kind}_{number}.{suffix}")) for suffix in formats]
    return written


def files(
    dataset: xr.Dataset, stem: Path, formats: Sequence[str] = FIGURE_FORMATS, kinds: Sequence[str] | None = None
) -> dict[str, list[Path]]:
    """Return by kind the files that :func:`draw` writes, without the rest."""
    main = choose(dataset)[0]
    names = {
        kind: stem.name if kind == main else f"{stem.name}_{kind}" for kind in ([main] if kinds is None else kinds)
    }
    return {kind: [stem.with_name(f"{name}.{suffix}") for suffix in formats] for kind, name in names.items()}


def figure(dataset: xr.Dataset, kind: str, *, titled: bool = True) -> Figure:
    """Draw the figure of one ``kind``, with the study's title or without."""
    title = _plain(str(dataset.attrs.get("title", ""))) if titled else ""
    dataset = _with_short_names(dataset)
    with mpl.rc_context(STYLE):
        return FIGURES[kind](dataset, title, _missing(dataset))


def _with_short_names(dataset: xr.Dataset) -> xr.Dataset:
    """Return ``dataset`` with names that fit a figure, and that are no formulas."""
    plain = {}
    for dim, values in dataset.indexes.items():
        names = [str(value) for value in values]
        shown = [_plain(name) for name in shortened(names)]
        if not is_numeric(dataset[dim]) and shown != names:
            plain[dim] = (dim, shown, dataset[dim].attrs)
    return dataset.assign_coords(plain) if plain else dataset


def _plain(text: str) -> str:
    """Return ``text`` so that it is no formula, whatever stands in it."""
    return text.replace("$", r"\$")


def _missing(dataset: xr.Dataset) -> str:
    """Say which cases have no force, and what error bars leave out."""
    words = {"failed": "failed (×)", "skipped": "skipped", "pending": "not yet run", "lost": "contact lost"}
    counts = {word: int((dataset["status"] == state).sum()) for state, word in words.items()}
    text = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    comment = str(dataset["force_error"].attrs.get("comment", "")) if "force_error" in dataset else ""
    return "; ".join(filter(None, (f"cases: {text}" if text else "", comment)))
