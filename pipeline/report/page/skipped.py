"""What was not done, and why: the plan's reductions, where forces came from, cases that were not run."""

import json
from typing import Any

import numpy as np
import xarray as xr

from pipeline.report.page.facts import by_status

_ORIGINS = {
    "solved": "solved for themselves, on the whole body",
    "symmetric": "solved on a half or a quarter of the body",
    "axisymmetric": "solved on the meridian of a round scene",
    "scaled": "F of another case, in proportion to Young's modulus and depth",
    "image": "F of another place, of which this one is the image",
    "reduced": "from a reduced basis in Poisson's ratio, with a bound on the error",
    "stored": "read back from the case store",
}


def struck(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return what the run's plan struck out: name, how many solves, reason."""
    return list(json.loads(dataset.attrs["reductions"]))


def origins(dataset: xr.Dataset) -> list[tuple[int, str, str]]:
    """Return how forces were obtained: number of cases, word, what it means."""
    names, counts = np.unique([name for name in dataset["origin"].values.ravel() if name], return_counts=True)
    found = [(int(count), str(name), _meaning(str(name))) for name, count in zip(names, counts, strict=True)]
    return sorted(found, reverse=True)


def _meaning(origin: str) -> str:
    return "; ".join(meaning for word in origin.split(", ") if (meaning := _ORIGINS.get(word, "")))


def skipped(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return why cases were skipped, with some of them."""
    return by_status(dataset, "skipped")
