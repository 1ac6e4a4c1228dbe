"""What a report says beside tables: how many cases, what failed or was not done, and how to run it again."""

import json
import re
from collections import defaultdict
from datetime import datetime
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np
import xarray as xr

from epsmesh.report.times import doubts
from epsmesh.report.values import by_case, relative
from epsmesh.report.words import choices, ranged
from epsmesh.states import FAILED, NO_CONTACT, OK, PARTIAL, PENDING, SKIPPED

# Of git, with a sign for changes that were not committed.
_COMMIT = re.compile(r"[0-9a-f]{7,64}\+?")
_STUDIES = Path(__file__).resolve().parents[4] / "studies"
# Cases that a message names; the table shows all of them.
_MOST_NAMED = 5
_STATES = {
    OK: "with a force",
    FAILED: "failed",
    PARTIAL: "ended before the depth",
    SKIPPED: "skipped",
    NO_CONTACT: "without contact",
    PENDING: "not yet run",
}

_ORIGINS = {
    "solved": "solved for themselves, on the whole body",
    "symmetric": "solved on a half, a quarter or an eighth of the body",
    "axisymmetric": "solved on the meridian of a round scene",
    "scaled": "F of another case, in proportion to Young's modulus and depth",
    "mirrored": "F of another place, onto which a symmetry of the body maps this one",
    "reduced": "from a reduced basis in Poisson's ratio, with a bound on the error",
    "interpolated": "interpolated between solved places of the path, with an error bar",
    "stored": "read back from the case store",
}


def facts(dataset: xr.Dataset) -> list[tuple[str, str]]:
    """Return the headlines of a study: name and value."""
    counts = {word: int((dataset["status"] == state).sum()) for state, word in _STATES.items()}
    found = [("cases", f"{dataset['status'].size}"), *((word, f"{count}") for word, count in counts.items() if count)]
    if dataset["force"].notnull().any():
        found.append(("force", ranged(dataset, "force")))
    for values, text, unit in (
        (100 * relative(dataset, "force_error").values, "largest error bar", " %"),
        (dataset["balance"].values, "worst imbalance", ""),
        (dataset["speedup"].values, "largest speed-up", " ×"),
    ):
        if np.isfinite(values).any() and not (unit == " ×" and np.nanmax(values) == 1):
            found.append((text, f"{np.nanmax(values):.2g}{unit}"))
    if "depth_error" in dataset and dataset["depth"].notnull().any():
        found.insert(1, ("depth", ranged(dataset, "depth")))
    if any(name == "largest speed-up" for name, _ in found):
        found += [("speed-ups", text) for text in doubts(dataset)]
    if taken := _taken(dataset):
        found.append(("run", taken))
    return found


def by_status(dataset: xr.Dataset, status: str) -> list[dict[str, Any]]:
    """Return the messages of the cases of a status, the most frequent first, with some of their cases."""
    return _by_message(dataset, status, "message")


def without_exact(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return why scenes that the tool touches have no F_exact, with some of their cases."""
    return _by_message(dataset, "", "force_exact_message")


def reductions(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return what the run's plan skipped: name, how many solves, reason."""
    return list(json.loads(dataset.attrs["reductions"]))


def origins(dataset: xr.Dataset) -> list[tuple[int, str, str]]:
    """Return how forces were obtained: number of cases, word, what it means."""
    names, counts = np.unique([name for name in dataset["origin"].values.ravel() if name], return_counts=True)
    found = [(int(count), str(name), _meaning(str(name))) for name, count in zip(names, counts, strict=True)]
    return sorted(found, reverse=True)


def _meaning(origin: str) -> str:
    return "; ".join(meaning for word in origin.split(", ") if (meaning := _ORIGINS.get(word, "")))


def provenance(dataset: xr.Dataset) -> list[tuple[str, str]]:
    """Return with what, where and when the dataset was computed."""
    attributes = {str(name): str(value) for name, value in dataset.attrs.items() if str(value)}
    versions = [(name.removeprefix("version_"), v) for name, v in attributes.items() if name.startswith("version_")]
    for name in ("start", "end"):
        attributes[name] = attributes.get(name, "").replace("T", " ")
    known = (
        ("git_commit", "git commit"),
        ("host", "host"),
        ("ranks", "ranks"),
        ("start", "start"),
        ("end", "end"),
        ("study_hash", "study hash"),
    )
    return versions + [(text, attributes[name]) for name, text in known if attributes.get(name)]


def study_path(dataset: xr.Dataset, name: str) -> str:
    """Return the path of the dataset's study in a command: one of the project's studies by its path in a clone.

    The command is to be pasted into a shell, and the dataset may be a stranger's: the path is quoted.
    """
    attributes = dataset.attrs
    file = Path(str(attributes.get("study_folder", "."))) / str(attributes.get("study_file", f"{name}.toml"))
    own = _STUDIES / file.name
    is_own = own.is_file() and own.read_text(encoding="utf-8") == attributes.get("study")
    return quote(str(own.relative_to(_STUDIES.parent) if is_own else file))


def reproduce(dataset: xr.Dataset, name: str) -> list[str]:
    """Return the commands that make the dataset and this page again."""
    commit = str(dataset.attrs.get("git_commit", ""))
    ranks = str(dataset.attrs.get("ranks", "1"))
    lines = []
    if _COMMIT.fullmatch(commit):
        changed = "  # and changes that were not committed" if commit.endswith("+") else ""
        lines.append(f"git checkout {commit.rstrip('+')}{changed}")
    launcher = f"mpirun -n {ranks} " if ranks.isdigit() and int(ranks) > 1 else ""
    return [
        *lines,
        "make setup",
        f"{launcher}.venv/bin/epsmesh run {study_path(dataset, name)} --fresh",
        f".venv/bin/epsmesh report {quote(f'results/{name}.nc')}",
    ]


def _by_message(dataset: xr.Dataset, status: str, variable: str) -> list[dict[str, Any]]:
    dims = [str(dim) for dim in dataset["status"].dims]
    states, messages = dataset["status"].values, by_case(dataset, variable).values
    found: dict[str, list[tuple[int, ...]]] = defaultdict(list)
    for index in np.ndindex(states.shape):
        if states[index] == status if status else messages[index] and states[index] != NO_CONTACT:
            found[str(messages[index])].append(index)
    groups = sorted(found.items(), key=lambda item: -len(item[1]))
    return [
        {
            "message": message or "no message",
            "count": len(cases),
            "more": max(0, len(cases) - _MOST_NAMED),
            "cases": [_name(dataset, dims, index) for index in cases[:_MOST_NAMED]],
        }
        for message, cases in groups
    ]


def _name(dataset: xr.Dataset, dims: list[str], index: tuple[int, ...]) -> str:
    return choices(dataset, {dim: dataset[dim].values[i] for dim, i in zip(dims, index, strict=True)}) or "the one case"


def _taken(dataset: xr.Dataset) -> str:
    """Return how long the last run took, '' where it only read back what was stored."""
    try:
        start, end = (datetime.fromisoformat(str(dataset.attrs[name])) for name in ("start", "end"))
    except (KeyError, ValueError):
        return ""
    seconds = (end - start).total_seconds()
    if seconds < 1:
        return ""
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
