"""What is known of the credibility of a study's answer, and what is not: one page.

Its tables follow the factors of ASME V&V 40-2018, the categories of evidence of FDA's guidance of November 2023, and
the ten rules of A. Erdemir et al., J. Transl. Med. 18, 369 (2020). Each statement is from the dataset, its study, or
the tables of :mod:`.near`.
"""

from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np
import xarray as xr

from epsmesh.files import write_whole
from epsmesh.pages import joined, render_page
from epsmesh.quantities import MESH_DIMENSIONS
from epsmesh.report.credibility import near
from epsmesh.report.credibility.inputs import inputs
from epsmesh.report.credibility.limits import largest, limits
from epsmesh.report.guide import guide_if_any
from epsmesh.report.headline import headline
from epsmesh.report.page.facts import provenance, reproduce
from epsmesh.report.page.inline import PAGE_CSS
from epsmesh.report.study import DatasetError, study_of, warnings_of
from epsmesh.report.validation import unchecked
from epsmesh.report.values import answer_of, at_peak
from epsmesh.report.words import percent
from epsmesh.states import OK
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.case import Case
from epsmesh.study.keys import keys_of
from epsmesh.study.sweep import Study

_TEMPLATES = Path(__file__).parent / "templates"
# Keys of [credibility] that the page begins with, and what they are called.
_ASKED = {
    "question": "question of interest",
    "context_of_use": "context of use",
    "decision_consequence": "consequence of a wrong decision",
    "model_influence": "influence of the model",
}
# What F is compared with, and its variable.
_FINER = {"F_exact": "force_exact_ratio", "F_max": "force_ratio"}
# Sources of references that other programs or methods computed.
_COMPUTED = ("integral equation", "boundary elements", "finer elements", "converged")


def path_of(dataset: Path) -> Path:
    """Return the file of the page beside a dataset."""
    return dataset.with_name(f"{dataset.stem}_credibility.html")


def write_page(dataset: xr.Dataset, path: Path, name: str) -> Path:
    """Write the page of the study ``name`` to ``path``, in place of an earlier one only once it is whole.

    Raises:
        DatasetError: if this version does not read the dataset's study, or a file that it names.
    """
    return write_whole(path, render(dataset, name))


def render(dataset: xr.Dataset, name: str) -> str:
    """Return the page as HTML; ``name`` is the study's, for files and commands.

    Raises:
        DatasetError: if this version does not read the dataset's study, or a file that it names.
    """
    study = study_of(dataset)
    if study is None:
        raise DatasetError("this version does not read its study, or a file that the study names is missing")
    cases, text, guide = near.scenes(study), str(dataset.attrs.get("study", "")), guide_if_any(dataset)
    if not cases:
        raise DatasetError("the tool touches the body in no case: there is no answer to be credible")
    kinds, here = near.kinds(study, cases), near.numbers(dataset, study, cases)
    nearest = near.measured(kinds[0], here)
    made, rows = near.verification()
    rows_of_inputs, commands = inputs(dataset, study, cases), reproduce(dataset, name)
    return render_page(
        _TEMPLATES / "credibility.html.j2",
        "",
        PAGE_CSS.parent,
        title=f"Credibility: {dataset.attrs.get('title', name)}",
        style=joined(PAGE_CSS, _TEMPLATES / "credibility.css"),
        answer=[guide.sentence] if guide else headline(dataset),
        asked=[(word, getattr(study.credibility, key) or "not stated") for key, word in _ASKED.items()],
        unstated=[word for key, word in _ASKED.items() if getattr(study.credibility, key) is None],
        paste=paste(study),
        stated=study.credibility,
        commit=str(dataset.attrs.get("git_commit", "")),
        same=[sum(kind.distance(other)[0] == 0 for other, _ in rows) for kind in kinds],
        rows=len(rows),
        of_others=sum(any(word in row["source"] for word in _COMPUTED) for _, row in rows),
        discretisation=discretisation(dataset),
        exact_asked=_asked_of_exact(dataset, study, cases),
        balances=balances(dataset),
        tolerance=study.solve.energy_tolerance,
        failed=int((dataset["status"] != OK).sum()),
        cases=dataset["status"].size,
        laws=sorted({kind.law for kind in kinds}),
        varied=[axis.path for axis in study.axes if axis.key in ("law", "contact", "friction", "fixed", "ends")],
        inputs=rows_of_inputs,
        known_inputs=sum(row[1] != "none stated" for row in rows_of_inputs),
        identified=study.identified.file,
        verified=near.verified(kinds),
        made=made,
        here=near.said(here),
        measured=[[one.name, near.far(kinds[0], here, one), near.result(one), near.evidence(one)] for one in nearest],
        is_measured=nearest[0].kind == "experiment",
        unchecked=[f"{one.name} ({one.source})" for one in unchecked()],
        limits=[*limits(dataset, study, cases)],
        warnings=len(warnings_of(dataset)),
        conventions=dataset.attrs.get("Conventions", "none"),
        study_hash=dataset.attrs.get("study_hash", ""),
        study=text,
        name=name,
        study_link=f"data:text/plain;charset=utf-8,{quote(text)}",
        provenance=provenance(dataset),
        commands=[*commands[:-1], f"{commands[-1]} --credibility"],
    )


def paste(study: Study) -> str:
    """Return the lines of [credibility] that the study lacks, with examples; "" if it has all."""
    lines = [
        f"{key.name} = {key.words.example}"
        for key in keys_of("credibility")
        if key.name in _ASKED and getattr(study.credibility, key.name) is None
    ]
    return "\n".join(["[credibility]", *lines]) if lines else ""


def discretisation(dataset: xr.Dataset) -> list[str]:
    """Return the largest error bars of the answer, and of punctures, and its largest distances from finer solutions."""
    peak, name = at_peak(dataset), answer_of(dataset)
    of_answer = ("F" if name == "force" else "the depth") + (" at its largest" if peak is not dataset else "")
    bars = {
        of_answer: largest(peak, f"{name}_error"),
        "the force of the puncture": largest(dataset, "puncture_force_error"),
        "its depth": largest(dataset, "puncture_depth_error"),
    }
    known = [f"{percent(bar)} of {what}" for what, bar in bars.items() if np.isfinite(bar)]
    found = [f"error bar (95 %) at most {', '.join(known)}"] if known else ["error bar not known"]
    of_all = "the meshes' F" if {*MESH_DIMENSIONS} & {*dataset["force"].dims} else "F"
    for of, ratio in _FINER.items():
        distance = largest(peak[ratio] - 1)
        said = f"{of_all} within {percent(distance)} of {of}" if distance else f"{of_all} is {of}, of the whole body"
        found.append(said if np.isfinite(distance) else f"{of} not known")
    return found


def _asked_of_exact(dataset: xr.Dataset, study: Study, cases: Sequence[Case]) -> str:
    """Say what gives the distance of F from a force without mesh error, if that is not known."""
    if np.isfinite(dataset["force_exact"]).any():
        return ""
    why = next(filter(None, (obstacle("F_exact", case) for case in cases)), "")
    if study.is_insertion or why:
        return f"a smaller `accuracy`{why and f': {why}'}"
    return "`exact = true` in [solve]"


def balances(dataset: xr.Dataset) -> list[str]:
    """Return by how much forces and energies of the cases do not balance, where that is known."""
    found = {
        "F d = 2 U and forces balance": largest(dataset, "balance"),
        "energies of the insertion balance": largest(dataset, "energy_balance"),
    }
    return [f"{what} to {value:.1g}" for what, value in found.items() if np.isfinite(value)]
