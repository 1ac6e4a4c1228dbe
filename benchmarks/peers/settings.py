"""What each program is run with: a short ladder for each scene, found by ``--scan`` over the grids below."""

from itertools import product
from typing import Any

Settings = tuple[dict[str, Any], ...]

# What this program is asked for. The first three are the targets; the others show what it would have got away with.
PROGRAM: Settings = tuple({"accuracy": f"{percent} %"} for percent in ("3", "2", "1", "0.5", "0.3", "0.2", "0.1"))
# Round scenes, in two dimensions: the same for every accuracy above 1e-5.
MERIDIAN: Settings = ({"accuracy": "0.1 %", "model": "auto"},)


def _grid(**choices: tuple[Any, ...]) -> Settings:
    return tuple(dict(zip(choices, chosen, strict=True)) for chosen in product(*choices.values()))


GRIDS: dict[str, Settings] = {
    "NGSolve": _grid(
        order=(2, 3, 4), rim=(0.5, 1.0), maxh=(25, 50), grading=(0.3, 0.5, 0.8), levels=(2, 3), factor=(0.15, 0.25),
        safety=(1.0, 2.0), solver=("sparsecholesky",),
    ),
    "scikit-fem": _grid(
        rim=(0.1, 0.05, 0.025), growth=(0.5, 0.35, 0.25, 0.18), quarter=(True, False), solver=("pardiso",)
    ),
}  # fmt: skip

# p, rim, maxh, grading, levels, safety
_NGSOLVE: dict[str, tuple[tuple[float, ...], ...]] = {}
