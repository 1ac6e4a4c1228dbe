"""A model that answers queries of forces; outside its range it refuses with a status, and never extrapolates."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from epsmesh_realtime.evaluator import MOST_TOOLS, Array, Evaluator, Spot
from epsmesh_realtime.file import ModelError, is_path, unpack
from epsmesh_realtime.gradient import Gradient, gradient
from epsmesh_realtime.query import Query, packed_each
from epsmesh_realtime.table import Face, Near, Pairs, Table
from epsmesh_realtime.touch import Touch, Touches

# Numbers of a file that are fields of a model.
_NUMBERS = ("thickness", "young", "poisson", "largest", "off", "aligned", "bend_error")


@dataclass(frozen=True, eq=False)
class Model:
    """A real-time model of a body's face. Sizes are in m, E in Pa.

    - ``origin`` (3,), ``axes`` (3, 3): the middle of the face, and rows x, y and outward normal.
    - ``sides``: half extents of the face; ``thickness``: depth of the support, or of other tissue.
    - ``largest``: largest contact radius, in units of the distance to the nearest side or of the thickness.
    - ``bar``: errors of c, of h's part, of higher orders, and of F.
    - ``face``: height and curvature of a curved face; ``bend_error`` (1/m): error of its mean curvature.
    - ``off`` (m), ``aligned`` (rad): tolerances of a query, distance from the face and angle to the normal.
    - ``pairs``: interaction of several tools; without it, the model answers for one tool at a time.
    - ``relaxation``: shares of the modulus at once, and their times (s). A query is answered for a sudden touch;
      for forces over time see :class:`epsmesh_realtime.history.History`.
    - ``tool``: shape, sizes and depth of the study's own tool, as `epsmesh_realtime.file` has them; () if not known.
    - ``near``: a ball at large displacements on a half-space; without it, displacements are small.
    """

    table: Table
    origin: NDArray[np.float64]
    axes: NDArray[np.float64]
    sides: tuple[float, float]
    thickness: float
    young: float
    poisson: float
    largest: float
    bar: tuple[float, float, float, float]
    face: Face = field(default_factory=Face)
    off: float = 1e-9
    aligned: float = 1e-6
    bend_error: float = 0.0
    pairs: Pairs | None = None
    relaxation: tuple[tuple[float, float], ...] = ()
    near: Near | None = None
    tool: tuple[float, ...] = ()

    def __repr__(self) -> str:
        x, y = (2e3 * size for size in self.table.reach)
        region = f"a region of {x:.3g} mm across" if self.table.is_round else f"a region of {x:.3g} × {y:.3g} mm"
        deep = f"{1e3 * self.thickness:.3g} mm of the same tissue below"
        tissue = f"{deep}, E = {self.young:.4g} Pa, ν = {self.poisson:.3g}"
        low, high = self.table.poisson
        large = ", at large displacements" if self.near else ""
        return f"Model of {region}, {tissue}{f' ({low:.3g} to {high:.3g})' if high > low else ''}{large}"

    @cached_property
    def evaluator(self) -> Evaluator:
        """The model in C.

        Raises:
            ModelError: if the numbers are no model.
        """
        return Evaluator.of(self.numbers())

    def query(self, tool: str, **asked: Any) -> Touch:
        """Return the force on a ``tool``; ``asked`` are the fields of :class:`epsmesh_realtime.query.Query`.

        A refused query raises no error: see ``status``.

        Raises:
            TypeError: if a keyword is unknown, place or depth is missing, or a size, the depth, E or ν is no number.
        """
        return self.answer(Query(tool, **asked))

    def answer(self, query: Query) -> Touch:
        """Return the answer of a ``query``."""
        return self.evaluator.touch(query.packed(self.young, self.poisson))

    def query_many(self, tool: str, *, threads: int = 1, **asked: Any) -> Touches:
        """Return the force on a ``tool`` in n queries, each by itself, in one call of C for each of ``threads``.

        ``asked`` are the keywords of a query; numbers may be arrays (n,), places and directions arrays (n, 3). Answers
        are those of n single queries, bit for bit, of the sudden touch where tissue relaxes. Python runs meanwhile.

        Raises:
            TypeError: if a keyword is unknown, or place or depth is missing.
            ValueError: if shapes do not go together, or ``threads`` is not positive.
        """
        return self.evaluator.touch_each(packed_each(Query(tool, **asked), self.young, self.poisson), threads)

    query_each = query_many  # the name of the first release

    def gradient(self, tool: str, *, by: Sequence[str] = ("at", "depth"), threads: int = 1, **asked: Any) -> Gradient:
        """Return the force on a ``tool`` in n queries, and its derivatives with the numbers named in ``by``.

        These are place, depth, E and ν (``at``, ``depth``, ``young``, ``poisson``), and the tool's sizes. They are
        exact derivatives of the evaluator's formulas. ``asked`` as in :meth:`query_many`.

        Raises:
            ValueError: if the force is no function of a number: of the axis, of ν in a model of one ν, of another
                tool's size; or if shapes do not go together.
            TypeError: if a keyword is unknown, or place or depth is missing.
            BuildError: if the derivatives' library is not built, and cannot be: it is C++.
        """
        query, (low, high) = Query(tool, **asked), self.table.poisson
        tissue = (self.young, self.poisson)
        return gradient(self.evaluator, query, by, *tissue, is_fixed=low == high, threads=threads)

    def query_all(
        self, tools: Sequence[Mapping[str, Any]], *, young: float | None = None, poisson: float | None = None
    ) -> list[Touch]:
        """Return the force on each of ``tools`` while all press at once; each has the keywords of a query but E and ν.

        The forces derive from one energy of all places and depths. ``stiffness`` is for one tool at fixed depths of the
        others. If one tool has no answer, the status of the others is "others". Refused queries raise no error.

        Raises:
            ValueError: if there are more than 16 tools.
        """
        if len(tools) > MOST_TOOLS:
            raise ValueError(f"at most {MOST_TOOLS} tools press at once, not {len(tools)}")
        asked = [Query(**tool, young=young, poisson=poisson) for tool in tools]
        return self.evaluator.touch_all([query.packed(self.young, self.poisson) for query in asked])

    def foot(self, tip: Sequence[float]) -> tuple[str, Array, float]:
        """Return "ok", the place (3,) of the face for a tool's lowest point ``tip`` (m), and its depth (m) below it.

        Otherwise "no contact" above the face, "outside" beside the region of a curved face, or "deep" if the place is
        not unique.
        """
        return self.evaluator.foot(tip)

    def spot(self, x: float, y: float) -> Spot:
        """Return the face at a place (m along its axes) of the region."""
        return self.evaluator.spot(x, y)

    def room(self, x: float, y: float) -> float:
        """Return the distance (m) from a place to the nearest side, or to the bottom; NaN outside the region."""
        return self.evaluator.room(x, y)

    def holds(self, x: float, y: float) -> bool:
        """Return whether a place (m along the face's axes) is in the region."""
        return isfinite(self.room(x, y))

    def numbers(self) -> dict[str, ArrayLike]:
        """Return the arrays of the model's file, by name, without its surface."""
        own = {name: getattr(self, name) for name in (*_NUMBERS, "sides", "origin", "axes", "bar")}
        found = own | self.table.numbers() | self.face.numbers()
        for part in (self.pairs, self.near):
            found |= part.numbers() if part else {}
        for name, terms in zip(
            ("relaxation_share", "relaxation_time"), zip(*self.relaxation, strict=True), strict=False
        ):
            found[name] = terms
        found |= {"tool": self.tool} if self.tool else {}
        return {name: np.asarray(value, dtype=float) for name, value in found.items()}


def read(path: str | Path) -> Model:
    """Return the model at ``path``.

    Raises:
        ModelError: if it is no model, of another version, or damaged; OSError if it cannot be read.
    """
    return model_of(Path(path).read_bytes())


def model_of(data: bytes) -> Model:
    """Return the model in the bytes of a file.

    Raises:
        ModelError: if they are no model, of another version, or damaged.
    """
    if is_path(data):
        raise ModelError("this is the model of an insertion: `read_path` reads it")
    return loaded(data, Evaluator(data))[0]


def loaded(data: bytes, evaluator: Evaluator) -> tuple[Model, dict[str, NDArray[Any]]]:
    """Return the model in the bytes of a file, which ``evaluator`` has loaded, and all arrays of the file.

    Raises:
        ModelError: if an array that no query needs is damaged.
    """
    found = unpack(data)
    model = Model(
        Table.of(found),
        found["origin"],
        found["axes"],
        bar=tuple(found["bar"].tolist()),
        sides=tuple(found["sides"].tolist()),
        face=Face(found["height"], found["bend"]),
        pairs=Pairs.of(found),
        near=Near.of(found),
        relaxation=_relaxation(found),
        tool=_tool(found),
        **{name: float(found[name]) for name in _NUMBERS if name in found},
    )
    vars(model)["evaluator"] = evaluator
    return model, found


def _relaxation(found: Mapping[str, NDArray[Any]]) -> tuple[tuple[float, float], ...]:
    """Return shares and times (s) in a file's arrays."""
    shares, times = (
        found[f"relaxation_{kind}"].tolist() if "relaxation_share" in found else [] for kind in ("share", "time")
    )
    return tuple(zip(shares, times, strict=True))


def _tool(found: Mapping[str, NDArray[Any]]) -> tuple[float, ...]:
    """Return the study's tool in a file's arrays, () if there is none.

    Raises:
        ModelError: if it is damaged.
    """
    if "tool" not in found:
        return ()
    tool = found["tool"]
    if tool.shape != (7,) or not np.isfinite(tool).all() or tool[0] not in range(5) or tool[1:6].min() < 0:
        raise ModelError("tool has impossible numbers: the file is damaged")
    return tuple(tool.tolist())


def about(found: Mapping[str, NDArray[Any]]) -> dict[str, str]:
    """Return the texts in a file's arrays: body, tools, version and study.

    Raises:
        ModelError: if they are no JSON object of texts.
    """
    if "about" not in found:
        return {}
    try:
        texts = json.loads(found["about"].tobytes())
    except (ValueError, RecursionError):
        texts = None
    if not isinstance(texts, dict) or not all(isinstance(text, str) for text in texts.values()):
        raise ModelError("about is no JSON object of texts: the file is damaged")
    return texts
