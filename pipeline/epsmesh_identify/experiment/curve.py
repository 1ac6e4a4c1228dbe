"""A measured force curve in SI units."""

from dataclasses import dataclass

from epsmesh.arrays import FloatArray


@dataclass(frozen=True)
class Curve:
    """One loading of a tool into a specimen, as it was recorded.

    ``depth`` (n,) is the way of the tool, or of the machine, in m: larger is deeper, and its zero is arbitrary, since
    the point of contact is not known. ``force`` (n,) is in N, positive where the tool presses. ``time`` (n,) is in s,
    None if it was not recorded. ``notes`` say what was found in the file without being asked for.
    """

    name: str
    depth: FloatArray
    force: FloatArray
    time: FloatArray | None = None
    notes: tuple[str, ...] = ()
