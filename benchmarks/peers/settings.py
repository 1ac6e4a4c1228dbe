"""Settings of each program: a short ladder for each scene, found by ``--scan`` over the grids below."""

from itertools import product
from typing import Any

Settings = tuple[dict[str, Any], ...]

# Accuracies required of this program. The first three are the targets; the others show the cost of a tighter one.
PROGRAM: Settings = tuple({"accuracy": f"{percent} %"} for percent in ("3", "2", "1", "0.5", "0.3", "0.2", "0.1"))
# The same at large displacements.
LARGE_PROGRAM: Settings = tuple({"accuracy": f"{percent} %"} for percent in ("3", "2", "1"))
# Axisymmetric scenes, in two dimensions: the same for every accuracy above 1e-5.
MERIDIAN: Settings = ({"accuracy": "0.1 %", "model": "auto"},)


def _grid(**choices: tuple[Any, ...]) -> Settings:
    return tuple(dict(zip(choices, chosen, strict=True)) for chosen in product(*choices.values()))


GRIDS: dict[str, Settings] = {
    "NGSolve": _grid(
        order=(2, 3, 4),
        rim=(0.5, 1, 2),
        maxh=(30,),
        grading=(0.3, 0.4, 0.5, 0.8),
        levels=(1, 2, 3),
        safety=(1.0, 1.5, 2.0),
        corners=(True,),
        solver=("sparsecholesky", "bddc"),
    ),
    "scikit-fem": _grid(
        rim=(0.1, 0.05, 0.025),
        growth=(0.5, 0.35, 0.25, 0.18),
        quarter=(True, False),
        solver=("pardiso", "cholmod", "amg"),
    ),
    "CalculiX": _grid(
        rim=(0.5, 0.4, 0.3, 0.2),
        growth=(0.7, 0.5),
        steps=(1, 2),
        stiff=(10.0, 20.0, 50.0),
        solver=("SPOOLES", "ITERATIVE CHOLESKY"),
    ),
}
CONTACT_GRID: Settings = _grid(
    order=(2, 3, 4),
    rim=(0.3, 0.4, 0.5, 0.8),
    maxh=(15, 30),
    grading=(0.3, 0.4, 0.5, 0.7),
    levels=(0,),
    safety=(1.0,),
    gamma=(2.0, 5.0),
    tolerance=(1e-3, 1e-2),
)

LARGE_GRID: Settings = _grid(
    order=(2, 3),
    rim=(0.07, 0.35, 0.4, 0.5, 1),
    maxh=(30,),
    grading=(0.4, 0.5, 0.7),
    levels=(0, 1, 2),
    factor=(0.2,),
    safety=(1.0,),
    gamma=(20.0,),
    tolerance=(1e-3,),
    steps=(1, 2),
)

_NAMES = ("order", "rim", "maxh", "grading", "levels", "safety", "corners", "solver")


def _ngsolve(*rows: tuple[float | str, ...]) -> Settings:
    return tuple(dict(zip(_NAMES, row, strict=False)) for row in rows)


def _contact(*rows: tuple[float, ...]) -> Settings:
    names = ("order", "rim", "maxh", "grading", "gamma", "tolerance")
    return tuple(dict(zip(names, row, strict=True)) | {"levels": 0, "safety": 1.0} for row in rows)


def _large(*rows: tuple[float, ...]) -> Settings:
    names = ("order", "rim", "grading", "levels", "steps")
    others = {"maxh": 30, "factor": 0.2, "safety": 1.0, "gamma": 20.0, "tolerance": 1e-3}
    return tuple(dict(zip(names, row, strict=True)) | others for row in rows)


def _ccx(*rows: tuple[float, ...]) -> Settings:
    return tuple(dict(zip(("rim", "growth", "steps", "stiff"), row, strict=True)) for row in rows)


def _skfem(*rows: tuple[float, float]) -> Settings:
    return tuple({"rim": rim, "growth": growth, "quarter": True} for rim, growth in rows)


LADDERS: dict[str, dict[str, Settings]] = {
    "NGSolve": {
        "disc": _ngsolve(
            (3, 1, 30, 0.3, 2, 1.0),
            (3, 0.6, 30, 0.3, 2, 1.0),
            (4, 1, 30, 0.6, 2, 1.0),
            (4, 1, 30, 0.4, 2, 1.0),
            (4, 1, 30, 0.3, 2, 1.0),
            (4, 0.8, 30, 0.3, 2, 1.0, True, "bddc"),
            (4, 0.6, 30, 0.3, 2, 1.0),
            (4, 0.6, 30, 0.3, 2, 1.0, True, "bddc"),
            (4, 0.7, 20, 0.25, 3, 1.5),
        ),
        "blade": _ngsolve(
            (3, 2, 30, 0.5, 2, 1.0, False),
            (3, 2, 30, 0.4, 2, 1.0, False),
            (3, 1, 30, 0.5, 2, 1.0, False),
            (3, 1, 30, 0.4, 2, 1.0, False),
            (4, 2, 30, 0.4, 2, 1.0, False),
            (4, 1, 30, 0.5, 2, 1.0, False),
            (4, 1, 30, 0.4, 2, 1.0, True),
            (4, 0.5, 50, 0.5, 2, 1.0, True),
            (4, 1, 30, 0.4, 2, 1.0, True, "bddc"),
        ),
        "cylinder": _ngsolve(
            (3, 1, 25, 0.5, 2, 1.0),
            (3, 1, 25, 0.4, 2, 1.5),
            (3, 1, 25, 0.3, 2, 2.0),
            (4, 1, 25, 0.4, 2, 1.0),
            (4, 1, 25, 0.5, 2, 1.0),
            (4, 1, 25, 0.4, 2, 1.5),
            (4, 0.5, 50, 0.5, 3, 2.0),
            (4, 1, 25, 0.3, 2, 2.0),
        ),
        "ball": _contact(
            (2, 0.4, 30, 0.3, 5.0, 1e-2),
            (3, 0.8, 30, 0.5, 5.0, 1e-2),
            (3, 0.5, 30, 0.5, 5.0, 1e-2),
            (3, 0.4, 30, 0.5, 5.0, 1e-3),
            (3, 0.4, 30, 0.4, 2.0, 1e-3),
            (3, 0.4, 15, 0.4, 5.0, 1e-3),
            (3, 0.3, 15, 0.4, 5.0, 1e-3),
        ),
        "deep-disc": _large((3, 0.5, 0.5, 1, 2), (3, 0.5, 0.4, 1, 2), (3, 0.4, 0.5, 1, 2)),
        "deep-ball": _large((3, 0.4, 0.7, 0, 1), (3, 0.35, 0.7, 0, 1)),
    },
    "CalculiX": {"ccx-ball": _ccx((0.5, 0.7, 1, 10.0), (0.4, 0.7, 1, 10.0), (0.3, 0.7, 1, 10.0), (0.2, 0.5, 1, 20.0))},
    "scikit-fem": {
        "disc": _skfem((0.2, 0.35), (0.1, 0.25), (0.05, 0.25)),
        "blade": _skfem((0.2, 0.35), (0.1, 0.25), (0.05, 0.25), (0.05, 0.2)),
        "cylinder": _skfem((0.2, 0.35), (0.1, 0.25), (0.1, 0.22), (0.05, 0.25), (0.05, 0.2), (0.025, 0.18)),
    },
}
