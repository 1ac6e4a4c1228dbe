"""The model of an insertion: force over depth with its phases, in microseconds. `c/src/insertion.c` has the formulas.

Arrays of its file, in SI units (`epsmesh_realtime.file` has their container):

    path_advance      (knot, 8): depth, elastic force, force of cutting, friction, error bar of their sum, depth of the
                      crack, 1 where it cuts up to this knot, largest error of a line from the knot before; two knots of
                      one depth are the states before and after a puncture
    path_back         (back_knot, 5) in the channel: depth, elastic force, friction, error bar, error of the line;
                      optional: without it there is no withdrawal
    path_punctures    (puncture, 5): depth, its bar, force before, its bar, force after; optional
    path_slip         distance over which friction reverses (m)
"""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan
from pathlib import Path
from struct import Struct
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from epsmesh_realtime.evaluator import FLAWS, Array, aligned, word, words
from epsmesh_realtime.file import ModelError, pack, unpack
from epsmesh_realtime.library import library
from epsmesh_realtime.touch import SENTENCES

ARRAYS = ("path_advance", "path_back", "path_punctures", "path_slip")
STAGES = ("above", "indentation", "cutting", "channel")
_NUMBERS = ("force", "force_error", "elastic", "cutting", "friction", "stiffness", "crack_depth")
_RESISTANCE = np.dtype(
    [(name, np.int32) for name in ("status", "stage", "punctures", "padding")] + [(name, float) for name in _NUMBERS]
)
_PACKED = Struct("@4i7d")
_MESSAGES = dict(SENTENCES) | {
    "deep": "The tip is deeper than the model: export a study with a larger `to`.",
    "history": "The depth of the crack is not known: the tip was deeper than the model; or it is pulled back in its "
    "channel, and the model has no withdrawal.",
}


@dataclass(frozen=True)
class Resistance:
    """The force at one depth; numbers are NaN unless ``status`` is "ok" or "no contact", and ``message`` says why.

    ``force`` (N) is that of the tissue against the advance, ``force_error`` (N) its bar; ``elastic``, ``cutting`` and
    ``friction`` are its parts. ``stage`` is "above", "indentation", "cutting", or "channel" if the tool is in the
    channel that it has cut. ``punctures`` is the number of layers that are pierced, ``crack_depth`` in m. ``stiffness``
    (N/m) is dF/dd for a motion as the last one.
    """

    status: str
    stage: str
    punctures: int = 0
    force: float = nan
    force_error: float = nan
    elastic: float = nan
    cutting: float = nan
    friction: float = nan
    stiffness: float = nan
    crack_depth: float = nan

    @property
    def message(self) -> str:
        """A sentence on the status, "" if it is "ok"."""
        return _MESSAGES[self.status]


@dataclass(frozen=True, eq=False)
class Resistances:
    """The forces at n depths, one after the other, as arrays (n,): see :class:`Resistance`."""

    status: NDArray[np.str_]
    stage: NDArray[np.str_]
    punctures: NDArray[np.int32]
    force: Array
    force_error: Array
    elastic: Array
    cutting: Array
    friction: Array
    stiffness: Array
    crack_depth: Array


class PathModel:
    """The model of an insertion's path; ``data`` are the bytes of its file. Many threads may use it.

    Raises:
        ModelError: if they are no such model, of another version, or damaged.
    """

    def __init__(self, data: bytes):
        self._data, sizes = aligned(data), (ctypes.c_size_t * 3)()  # C points into the data
        self._c = library()
        self._c.epsmesh_insertion_sizes(sizes)
        if sizes[2] != _RESISTANCE.itemsize:
            raise ModelError("the evaluator in C is not the one of this package: install it again")
        self.pointer, self.size_of_state = ctypes.create_string_buffer(sizes[0]), int(sizes[1])
        if self._c.epsmesh_path_load(self.pointer, self._data.ctypes.data, len(data)):
            name = ctypes.c_char_p()
            flaw = self._c.epsmesh_path_flaw(self.pointer, ctypes.byref(name))
            raise ModelError(FLAWS[flaw].format(name=(name.value or b"").decode()))
        self.arrays = unpack(data)

    @staticmethod
    def of(arrays: Mapping[str, ArrayLike]) -> "PathModel":
        """Return the model of arrays by name.

        Raises:
            ModelError: if they are no model.
        """
        return PathModel(pack(arrays))

    def __reduce__(self) -> tuple[type["PathModel"], tuple[bytes]]:
        """Copies, also in other processes, load the file's bytes again: C's model points into them."""
        return PathModel, (self._data.tobytes(),)

    def __repr__(self) -> str:
        pierced = ", ".join(
            f"punctures at {1e3 * depth:.3g} ± {1e3 * bar:.2g} mm with {1e3 * force:.3g} ± {1e3 * error:.2g} mN"
            for depth, bar, force, error, _ in self.punctures.tolist()
        )
        back = "with withdrawal" if self.has_withdrawal else "without withdrawal"
        return f"PathModel to {1e3 * self.deepest:.4g} mm, {pierced or 'no puncture'}, {back}"

    @property
    def deepest(self) -> float:
        """The last depth (m)."""
        return float(self.arrays["path_advance"][-1, 0])

    @property
    def slip(self) -> float:
        """The distance (m) over which friction reverses."""
        return float(self.arrays["path_slip"])

    @property
    def punctures(self) -> Array:
        """Depth (m), its bar, force before (N), its bar, force after, of each puncture (n, 5)."""
        found: Array = self.arrays.get("path_punctures", np.zeros((0, 5)))
        return found

    @property
    def has_withdrawal(self) -> bool:
        """Whether the tool may be pulled back in its channel."""
        return "path_back" in self.arrays


@dataclass(eq=False)
class Insertion:
    """A tool that is moved along the path of a ``model``, at first above intact tissue. One for each tool and thread.

    The tool may be pulled back and pushed in again, through the same channel. ``slip`` (m) is the distance over which
    friction reverses, by default the model's. Coulomb's law has none: until friction has reversed, the bar includes the
    difference.

    Raises:
        ValueError: if the slip is not positive.
    """

    model: PathModel
    slip: float | None = None
    _state: Any = field(init=False, repr=False)
    _c: Any = field(init=False, repr=False)
    _depth: Any = field(init=False, repr=False)
    _at: int = field(init=False, repr=False)
    _found: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.slip is None:
            self.slip = self.model.slip
        if not 0 < self.slip < np.inf:
            raise ValueError(f"the slip must be a positive length (m), not {self.slip}")
        self._state = ctypes.create_string_buffer(self.model.size_of_state)
        self._c, self._depth = library().epsmesh_insertion_each, ctypes.c_double()
        self._at, self._found = ctypes.addressof(self._depth), ctypes.create_string_buffer(_PACKED.size)
        library().epsmesh_insertion_begin(self._state, self.model.pointer, self.slip)

    def __reduce__(self) -> NoReturn:
        """Refuse a copy: C's state is of this object."""
        raise TypeError("an Insertion cannot be copied: begin a new one, and repeat its depths")

    def query(self, depth: float) -> Resistance:
        """Move the tip straight to a ``depth`` (m) below the undeformed face, and return the force there.

        Raises:
            TypeError: if the depth is no number.
        """
        self._depth.value = depth
        self._c(self._state, self.model.pointer, 1, self._at, self._found)
        status, stage, punctures, _, *numbers = _PACKED.unpack(self._found)
        return Resistance(word(status), STAGES[stage], punctures, *numbers)

    def query_many(self, depths: ArrayLike) -> Resistances:
        """Move the tip through ``depths`` (n,) in m, one after the other, and return the forces there.

        Raises:
            ValueError: if the depths are no array (n,).
        """
        through = np.ascontiguousarray(depths, dtype=float)
        if through.ndim != 1:
            raise ValueError(f"depths of an insertion have shape (n,), not {through.shape}")
        found = self._to(through)
        texts = words()[found["status"]], np.array(STAGES)[found["stage"]]
        return Resistances(*texts, found["punctures"], *(found[name] for name in _NUMBERS))

    def _to(self, depths: Array) -> NDArray[Any]:
        found = np.zeros(len(depths), _RESISTANCE)
        state, path, places = self._state, self.model.pointer, depths.ctypes.data
        self._c(state, path, len(depths), places, found.ctypes.data)
        return found


def read_path(path: str | Path) -> PathModel:
    """Return the model of an insertion at ``path``.

    Raises:
        ModelError: if it is no such model, of another version, or damaged; OSError if it cannot be read.
    """
    return PathModel(Path(path).read_bytes())
