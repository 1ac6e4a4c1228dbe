"""What a query found: a force with its bar, or a status and a sentence."""

from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import NDArray

SENTENCES = {
    "ok": "",
    "lost": "The tool does not touch.",
    "outside": "The place is outside the model's region: move the tool into it; `print(model)` tells its size.",
    "large": "The tool, or its contact, is too large for a place so near to a side or the bottom.",
    "deep": "The depth is more than the model was made for.",
    "tool": "The model knows no such tool, or it lacks a size: disc(radius), sphere(radius), cone(radius, angle), "
    "blade(length, width).",
    "input": "A number of the query is not finite, or not positive where it must be.",
    "poisson": "Poisson's ratio is outside the model's range.",
    "tilted": "The tool must press along the face's inward normal.",
    "off": "The place is not on the face.",
    "damaged": "The model's numbers make no sense here: export it again.",
    "near": "Two tools are too near to each other: their middles must be twice as far apart as both contacts measure.",
    "others": "Another tool has no answer, and without its force there is none here.",
    "alone": "The model answers for one tool at a time: its face is curved, or it was exported by an earlier version.",
}


@dataclass(frozen=True, eq=False)
class Touch:
    """What a query found; all numbers are NaN unless ``status`` is "ok" or "lost", and ``message`` says why.

    ``force`` (3,), in N, is what the tissue does to the tool, in the body's coordinates; ``force_error`` is relative,
    of its length along the normal, and holds for the force aside on a bonded disc, too; ``stiffness`` (N/m) is dF/dd at
    fixed place; ``contact_radius`` is in m.
    """

    status: str
    force: NDArray[np.float64]
    force_error: float = nan
    stiffness: float = nan
    contact_radius: float = nan

    def __repr__(self) -> str:
        if self.message:
            return f"Touch({self.status!r}: {self.message})"
        x, y, z = self.force
        of_contact = f"{self.stiffness:.6g} N/m, contact radius {self.contact_radius:.6g} m"
        return f"Touch({self.status!r}: ({x:.6g}, {y:.6g}, {z:.6g}) N ± {100 * self.force_error:.2g} %, {of_contact})"

    @property
    def message(self) -> str:
        """A sentence on the status, or nothing if it is "ok"."""
        return SENTENCES[self.status]


def refused(status: str) -> Touch:
    """Return what there is of a query without an answer: NaN, or of a tool that does not touch 0."""
    if status == "lost":
        return Touch(status, np.zeros(3), 0.0, 0.0, 0.0)
    return Touch(status, np.full(3, nan))
