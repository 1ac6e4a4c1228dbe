"""The reports of an identification and of Sobol's indices: one HTML page with answer, figure, values, and study."""

from pathlib import Path
from shlex import quote
from typing import Any

import matplotlib as mpl
import xarray as xr

from epsmesh.files import write_whole
from epsmesh.pages import joined, render_page
from epsmesh.report.figures.style import STYLE
from epsmesh.report.page.facts import provenance, study_path
from epsmesh.report.page.inline import PAGE_CSS, in_page
from epsmesh.study.identified import FITS
from epsmesh_identify.report.figures.identification import identification
from epsmesh_identify.report.figures.sensitivity import sensitivity
from epsmesh_identify.report.identified import (
    answer,
    bar,
    estimated,
    if_undeclared,
    is_passed_on,
    material,
    parts,
    title,
    wanted,
)
from epsmesh_identify.report.sensitivity import rows_of, sentences

_TEMPLATES = Path(__file__).parent / "templates"


def write_page(dataset: xr.Dataset, path: Path) -> Path:
    """Write the report of an identification to ``path``, in place of an earlier one only once it is whole."""
    return write_whole(path, render(dataset, path.stem))


def render(dataset: xr.Dataset, name: str) -> str:
    """Return the report of an identification as HTML; ``name`` is the study's, for files and commands."""
    is_one = "file" not in dataset.dims
    fits = not is_one or dataset.attrs["verdict"] == FITS
    columns, rows = _of_one(dataset) if is_one else _of_files(dataset)
    return _page(
        dataset,
        name,
        f"epsmesh identify {study_path(dataset, name)}",
        f"results/{name}.nc",
        heading="Values and their error bars",
        answer=answer(dataset),
        fits=fits,
        figure=_figure(dataset),
        columns=columns,
        rows=rows,
        is_beside=is_one,
        parts=[parts(dataset, one) for one in wanted(dataset)] if is_one and fits else [],
        material=material(dataset),
        is_passed_on=is_passed_on(dataset),
    )


def write_sensitivity(dataset: xr.Dataset, path: Path) -> Path:
    """Write the report of Sobol's indices to ``path``, in place of an earlier one only once it is whole."""
    with mpl.rc_context(STYLE):
        figure = in_page(sensitivity(dataset.assign_attrs(title="")), "sensitivity")
    name = path.stem.removesuffix("_sensitivity")
    page = _page(
        dataset,
        name,
        f"epsmesh run {study_path(dataset, name)}",
        f"results/{path.stem}.nc",
        heading="Shares of the variance and their error bars",
        answer=sentences(dataset),
        fits=True,
        figure=figure,
        columns=["of", "parameter", "range", "alone", "in all"],
        rows=rows_of(dataset),
    )
    return write_whole(path, page)


def _page(dataset: xr.Dataset, name: str, command: str, file: str, **content: Any) -> str:
    """Return a page of ``content``; the ``command`` makes the ``file`` that it shows."""
    return render_page(
        _TEMPLATES / "identification.html.j2",
        "",
        PAGE_CSS.parent,
        title=dataset.attrs.get("title", name),
        name=name,
        style=joined(PAGE_CSS),
        study=str(dataset.attrs.get("study", "")),
        commands=[command, f"epsmesh report {quote(file)}"],
        provenance=provenance(dataset),
        **{"is_beside": False, "parts": [], "material": ""} | content,
    )


def _figure(dataset: xr.Dataset) -> dict[str, Any]:
    with mpl.rc_context(STYLE):
        return in_page(identification(dataset, "", answered=False), "identification")


def _of_one(dataset: xr.Dataset) -> tuple[list[str], list[list[str]]]:
    """Return the table of all unknowns: heads, and rows of words."""
    names = [*wanted(dataset), *(one for one in map(str, dataset["unknown"].values) if one not in wanted(dataset))]
    rows = []
    for name in names:
        value = estimated(dataset, name)
        seen = bool(dataset["seen"].sel(unknown=name))
        unseen = "not in the curves" if name in wanted(dataset) else "as known before"
        bars = [bar(dataset, name), bar(dataset, name, hidden=True)] if seen else [unseen, ""]
        rows.append([title(name), value, *bars])
    return ["", "value", "as declared", "undeclared" if if_undeclared(dataset) else "the same"], rows


def _of_files(dataset: xr.Dataset) -> tuple[list[str], list[list[str]]]:
    """Return the table of all files: heads, and rows of words."""
    names, rows = wanted(dataset), []
    for number, file in enumerate(dataset["file"].values):
        one = dataset.isel(file=number)
        verdict = str(one["verdict"].values) or f"failed: {one['message'].values}"
        cells = [str(file)]
        for name in names:
            value = estimated(one, name) if str(one["verdict"].values) else ""
            cells += [value, bar(one, name), bar(one, name, hidden=True)] if verdict == FITS else [value, "", ""]
        rows.append([*cells, verdict])
    heads = [head for name in names for head in (title(name), "as declared", "undeclared")]
    return ["file", *heads, "law"], rows
