"""The report of a study: one HTML page that holds all it needs, made from the dataset alone."""

import re
from pathlib import Path
from shlex import quote as shell
from typing import Any
from urllib.parse import quote

import xarray as xr

from pipeline.files import write_whole
from pipeline.pages import joined, render_page
from pipeline.report.figures import choose, describe, figure
from pipeline.report.page.cases import FIRST_ROWS, case_table
from pipeline.report.page.facts import facts, failures, provenance, reproduce, without_exact
from pipeline.report.page.guideline import guide_section
from pipeline.report.page.inline import inline_svg
from pipeline.report.page.skipped import origins, skipped, struck

# What the answer says of times, and the headlines need not say again.
_TOLD = "speed-ups"
_TEMPLATES = Path(__file__).parent / "templates"
_SCRIPT = re.compile(r"'sha256-[A-Za-z0-9+/=]+'")


def write_page(dataset: xr.Dataset, path: Path, scene: str = "") -> Path:
    """Write the report of ``dataset`` to ``path``, in place of an earlier one only once it is whole.

    ``scene`` is the page of one case, to stand in the report.
    """
    return write_whole(path, render(dataset, path.stem, scene))


def render(dataset: xr.Dataset, name: str, scene: str = "") -> str:
    """Return the report of ``dataset`` as HTML; ``name`` is the study's, for files and commands.

    A page in a page is bound by the policies of both: the report's must allow the scripts of the ``scene``.
    """
    study = str(dataset.attrs.get("study", ""))
    guide = guide_section(dataset)
    table = case_table(dataset)
    return render_page(
        _TEMPLATES / "page.html.j2", joined(_TEMPLATES / "page.js"),
        title=dataset.attrs.get("title", name), name=name, style=joined(_TEMPLATES / "page.css"),
        scene=scene, scene_scripts=_SCRIPT.findall(scene)[:2],
        facts=[fact for fact in facts(dataset) if not (guide and fact[0] == _TOLD)],
        failures=failures(dataset), without_exact=without_exact(dataset),
        figures=_figures(dataset), guide=guide, table=table, first_rows=FIRST_ROWS,
        struck=struck(dataset), origins=origins(dataset), skipped=skipped(dataset),
        study=study, study_link=f"data:text/plain;charset=utf-8,{quote(study)}",
        provenance=provenance(dataset), commands=reproduce(dataset, name),
        turn=f"epsmesh report {shell(f'results/{name}.nc')} --scene answer",
    )  # fmt: skip


def _figures(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the figures that suit the study, as SVG to stand in the page, with what they show."""
    found: list[dict[str, Any]] = []
    for kind in choose(dataset):
        if kind != "nothing":
            svg, width = inline_svg(figure(dataset, kind, titled=False), kind)
            found.append({"kind": kind, "caption": describe(kind), "svg": svg, "width": width})
    return found
