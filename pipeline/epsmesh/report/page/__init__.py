"""The report of a study: one HTML page that holds all it needs, made from the dataset alone."""

import re
from pathlib import Path
from shlex import quote as shell
from urllib.parse import quote

import xarray as xr

from epsmesh.files import write_whole
from epsmesh.pages import joined, render_page
from epsmesh.printable import counted
from epsmesh.report.figures import choose, figure
from epsmesh.report.guide import guide_if_any
from epsmesh.report.guide_tables import settings
from epsmesh.report.headline import headline
from epsmesh.report.page.cases import FIRST_ROWS, case_table
from epsmesh.report.page.facts import (
    by_status,
    facts,
    origins,
    provenance,
    reductions,
    reproduce,
    without_exact,
)
from epsmesh.report.page.inline import in_page
from epsmesh.report.study import warnings_of
from epsmesh.report.uncertainty import bars, next_step
from epsmesh.report.values import at_peak
from epsmesh.states import FAILURES, SKIPPED

# Facts that the answer has already: of a guide, and of other studies.
_TOLD = {True: {"speed-ups"}, False: {"force", "depth", "largest error bar"}}
_TEMPLATES, _VENDOR = Path(__file__).parent / "templates", Path(__file__).parent / "vendor"
# jQuery, which DataTables needs, comes before it.
_SCRIPTS = (_VENDOR / "jquery.slim.min.js", _VENDOR / "dataTables.min.js", _TEMPLATES / "page.js")
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
    over_time, dataset = dataset, at_peak(dataset)
    study = str(dataset.attrs.get("study", ""))
    guide = guide_if_any(over_time)
    table, known = case_table(dataset), bars(dataset)
    failures = [line for state in FAILURES for line in by_status(dataset, state)]
    return render_page(
        _TEMPLATES / "page.html.j2",
        joined(*_SCRIPTS),
        title=dataset.attrs.get("title", name),
        name=name,
        style=joined(_VENDOR / "dataTables.min.css", _TEMPLATES / "page.css"),
        scene=scene,
        is_one=over_time["force"].size == 1,  # seen rather than drawn over nothing
        scene_scripts=_SCRIPT.findall(scene)[:2],
        facts=[fact for fact in facts(dataset) if fact[0] not in _TOLD[bool(guide)]],
        failures=failures,
        without_exact=without_exact(dataset),
        warnings=warnings_of(dataset),
        figures=[
            in_page(figure(over_time, kind, titled=False), kind) for kind in choose(over_time) if kind != "nothing"
        ],
        guide=guide,
        settings=settings(guide.verdicts, guide.scenes, has_full=guide.has_full) if guide else None,
        answer=[guide.sentence] if guide else headline(over_time),
        bars=[[one.cause, one.size, one.source] for one in known] if len(known) > 1 else [],
        next_step=next_step(known),
        table=table,
        many_cases=counted(len(table.order), "case") + (", failed ones first" if failures else ""),
        first_rows=FIRST_ROWS,
        reductions=reductions(dataset),
        origins=origins(dataset),
        skipped=by_status(dataset, SKIPPED),
        study=study,
        study_link=f"data:text/plain;charset=utf-8,{quote(study)}",
        provenance=provenance(dataset),
        commands=reproduce(dataset, name),
        turn=f"epsmesh report {shell(f'results/{name}.nc')} --scene answer",
    )
