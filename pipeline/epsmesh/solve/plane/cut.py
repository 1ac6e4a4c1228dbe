"""A cut deep in tissue: what an advance of the tool takes."""

from collections.abc import Callable
from typing import NamedTuple

from epsmesh.solve.physics import MaterialLaw


class Cut(NamedTuple):
    """A cut round a shaft of radius R, per depth: ``energy``, stored and torn, and what of it is ``stored``, in μ R².

    ``pressure`` N on the shaft is in units of μ R, ``touched`` the area of the crack's faces that touch, in units of R.
    ``balance`` and ``steps`` are those of the solve.
    """

    energy: float
    stored: float
    pressure: float
    touched: float
    balance: float
    steps: int


# For a law and a toughness Γ/(μ R): the cut on the coarse mesh, and that on the fine one.
Cuts = Callable[[MaterialLaw, float], tuple[Cut, Cut]]
