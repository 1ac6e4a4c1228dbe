"""The answer of a query: a force with its error bar, or a status and a sentence."""

from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import NDArray

SENTENCES = {
    "ok": "",
    "no contact": "The tool does not touch.",
    "outside": "The place is outside the model's region: move the tool into it; `print(model)` tells its size.",
    "large": "The tool, or its contact, is too large here: a side, the bottom or other tissue is too near.",
    "deep": "The depth exceeds the model's range.",
    "tool": "The model has no such tool, or a size is missing: disc(radius), sphere(radius), cone(radius, angle), "
    "blade(length, width). At large displacements it has the sphere alone.",
    "input": "A number of the query is not finite, or must be positive.",
    "poisson": "Poisson's ratio is outside the model's range.",
    "tilted": "The tool must press along the face's inward normal.",
    "off": "The place is not on the face.",
    "damaged": "The model's numbers are inconsistent here: export it again.",
    "near": "Two tools are too close: the distance of their middles must be twice the sum of both contact radii.",
    "others": "There is no answer for another tool, on whose force this one depends.",
    "alone": "The model answers for one tool at a time: its file has no pair_modes.",
    "history": "The force depends on an earlier contact that is not known. Place, tool or tissue have changed while it "
    "remembers; the contact of a round tool has grown again, or too often; or a query in contact was refused: begin a "
    "new History.",
}


@dataclass(frozen=True, eq=False)
class Touch:
    """The answer of a query; all numbers are NaN unless ``status`` is "ok" or "no contact", and ``message`` says why.

    ``force`` (3,), in N, is the force of the tissue on the tool, in the body's coordinates. ``force_error`` (N)
    is the 95 % error bar of its normal component; it also covers the lateral force on a bonded disc. ``stiffness``
    (N/m) is dF/dd at a fixed place; ``contact_radius`` is in m.
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
        return f"Touch({self.status!r}: ({x:.6g}, {y:.6g}, {z:.6g}) ± {self.force_error:.2g} N, {of_contact})"

    @property
    def message(self) -> str:
        """A sentence on the status, "" if it is "ok"."""
        return SENTENCES[self.status]


@dataclass(frozen=True, eq=False)
class Touches:
    """The answers of n queries, as arrays: ``status`` (n,), ``force`` (n, 3), and the other numbers of a touch (n,)."""

    status: NDArray[np.str_]
    force: NDArray[np.float64]
    force_error: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    contact_radius: NDArray[np.float64]
