"""What columns of force curves are called."""

import re

# Words, or parts of them, by what a column is.
_WORDS = {
    "depth": frozenset({
        "depth", "indentation", "indent", "displacement", "disp", "position", "pos", "piezo", "extension",
        "stroke", "travel", "compression", "crosshead", "deformation", "height", "separation", "z", "weg", "h", "d",
    }),
    "force": frozenset({"force", "load", "kraft", "weight", "gewicht", "mass", "f", "fn", "fz", "p"}),
    "deflection": frozenset({"deflection", "defl", "bending"}),
    "time": frozenset({"time", "timestamp", "elapsed", "zeit", "t"}),
}  # fmt: skip
# Words of columns that are derived from those of interest.
_DERIVED = ("strain", "stress", "rate", "speed", "velocity", "error", "std", "target", "limit", "step")
_SPLIT = re.compile(r"[^A-Za-zäöüÄÖÜ]+|(?<=[a-z])(?=[A-Z])")


def is_called(name: str, kind: str) -> bool:
    """Tell whether a column's name is one of depth, force or time."""
    words = [word.lower() for word in _SPLIT.split(name) if word]
    return not is_other(name) and any(word in _WORDS.get(kind, ()) for word in words)


def is_other(name: str) -> bool:
    """Tell whether a column's name is that of another quantity, such as a stress or a rate."""
    return any(word.lower() in _DERIVED for word in _SPLIT.split(name))
