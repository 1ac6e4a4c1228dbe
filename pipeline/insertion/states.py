"""States of a body that are solved: intact under the edge of a blade, and with a slit in which the blade is.

They are ordinary cases, kept in the case store: a path that is computed again, or goes on after an interruption, reads
them.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.shapes.body import Layered
from pipeline.shapes.probes.blade import Blade
from pipeline.states import OK
from pipeline.study.problems import Problem, StudyError
from pipeline.study.read import parse
from pipeline.study.schema import SECTIONS, Material
from pipeline.study.sweep import Study
from pipeline.study.toml import to_toml
from pipeline.surrogate.cases import Solve, SurrogateError
from pipeline.units import canonical

if TYPE_CHECKING:
    import xarray as xr

# Keys of a blade that is inserted which no solved state has.
_OF_PATH = ("insertion", "toughness", "friction", "depth", "contact")
# The front is solved this share of the distance to an interface ahead of it.
SHORT = 0.75
# A depth without effect, in widths of the blade: the force of a blade that slides in a slit does not depend on it.
_ANY = 0.01


@dataclass(frozen=True)
class Tissue:
    """A layer from a depth ``top`` (m) on: moduli (Pa, 1), and toughness (J/m²)."""

    top: float
    young: float
    poisson: float
    toughness: float


@dataclass(frozen=True)
class Cut:
    """A solved slit: tip of the blade at ``depth`` (m), front of the slit ``ahead`` of it (m).

    ``energy`` (J) is stored, ``release`` (J/m²) the energy release rate of the front, and ``drive`` (N) the force that
    moves the blade on at a fixed front; each with the half width of its 95 % error bar.
    """

    depth: float
    ahead: float
    energy: float
    energy_error: float
    release: float
    release_error: float
    drive: float
    drive_error: float


class Scene:
    """The body and the blade of a study with an insertion, and what solves its states."""

    def __init__(self, study: Study, solve: Solve):
        """Read the scene.

        Raises:
            StudyError: if the study has no insertion, or is not one scene.
        """
        self.study, self._solve = study, solve
        if study.axes:
            raise StudyError(
                study.file,
                [Problem(axis.path, None, f"is a list of {len(axis)}: one value is needed") for axis in study.axes],
            )
        case = study.case(())
        blade, body = case.probe, case.body
        if not isinstance(blade, Blade) or blade.insertion is None:
            why = 'is required for `epsmesh insertion`: a table of a blade with `to`, such as {to = "15 mm"}'
            raise StudyError(study.file, [Problem("probe.insertion", None, why)])
        assert isinstance(body, Layered) and blade.toughness is not None
        self.blade, self.insertion, self.toughness = blade, blade.insertion, blade.toughness
        top = body.heights[1]
        self.interfaces = tuple(top - end for end in body.interfaces)
        self.bottom = min(top - level for level in (body.heights[0], *body.support.edges()))
        self.layers = tuple(self._layers(body, case.material))

    def _layers(self, body: Layered, material: Material) -> Iterator[Tissue]:
        tops = (0.0, *self.interfaces)
        for number, top in enumerate(tops):
            within = body.layer[number] if number < len(body.layer) else material
            toughness = getattr(within, "toughness", None) or self.toughness
            yield Tissue(top, within.young, within.poisson, toughness)

    def at(self, depth: float) -> Tissue:
        """Return the tissue at a depth (m)."""
        return [layer for layer in self.layers if layer.top <= depth][-1]

    def above(self, depth: float) -> list[tuple[Tissue, float]]:
        """Return the layers above a depth (m), each with its thickness there (m)."""
        ends = (*self.interfaces, np.inf)
        found = [(one, min(depth, end) - one.top) for one, end in zip(self.layers, ends, strict=True)]
        return [(one, thickness) for one, thickness in found if thickness > 0]

    def tear(self, depth: float) -> float:
        """Return the integral of the toughness (J/m) from the surface to a depth (m)."""
        return sum(one.toughness * thickness for one, thickness in self.above(depth))

    def clear(self, depth: float) -> float:
        """Return the depth (m) nearest to ``depth`` at which the tip is half a width or more away from interfaces."""
        room = self.blade.width / 2
        for end in self.interfaces:
            if abs(depth - end) < room:
                return canonical(end + (room if depth >= end else -room))
        return canonical(depth)

    def ahead(self, depth: float) -> float:
        """Return the distance (m) of the front of the slit that is solved first, for a tip at a depth (m)."""
        found = min(self.blade.width, 2 * depth)
        for end in self.interfaces:
            if depth < end < depth + found / SHORT:
                found = SHORT * (end - depth)
        return canonical(found)

    # ---- solved states --------------------------------------------------------------------------------

    def stiffness(self) -> tuple[float, float]:
        """Return force over depth (N/m) of the blade on the intact surface, and its error bar.

        Raises:
            SurrogateError: if it cannot be solved.
        """
        dataset = self._solve(self._study({"depth": f"{self.insertion.to:.12g} m"}))
        if str(dataset["status"].values) != OK:
            raise SurrogateError(f"{self.study.file}: the intact body: {dataset['message'].values}")
        return float(dataset["force"]) / self.insertion.to, float(dataset["force_error"]) / self.insertion.to

    def cuts(self, places: Sequence[tuple[float, float]]) -> dict[tuple[float, float], Cut | str]:
        """Return the solved slits of pairs of depth and distance ahead (m), or why one cannot be solved."""
        found: dict[tuple[float, float], Cut | str] = {}
        for ahead, group in groupby(sorted(places, key=lambda place: place[::-1]), key=lambda place: place[1]):
            depths = [depth for depth, _ in group]
            dataset = self._solve(self.slit_study(depths, ahead))
            for number, depth in enumerate(depths):
                one = dataset.isel(incision=number) if "incision" in dataset.dims else dataset
                found[depth, ahead] = _cut(one, depth, ahead)
        return found

    def slit_study(self, depths: Sequence[float], ahead: float) -> Study:
        """Return the study of slits with the tip of the blade at ``depths`` (m), and the front ``ahead`` (m) of it."""
        fronts = [f"{depth + ahead:.12g} m" for depth in depths]
        return self._study(
            {
                "incision": fronts if len(fronts) > 1 else fronts[0],
                "ahead": f"{ahead:.12g} m",
                "depth": f"{_ANY * self.blade.width:.12g} m",
            }
        )

    def _study(self, probe: Mapping[str, Any]) -> Study:
        """Return the study of states with the blade's keys and those of ``probe``, which slides without friction."""
        raw = {name: deepcopy(section) for name, section in self.study.raw.items() if name in SECTIONS}
        own = {key: value for key, value in raw["probe"].items() if key not in _OF_PATH}
        raw["probe"] = {**own, **probe, "contact": "frictionless"}
        for layer in raw["body"].get("layer", ()):
            layer.pop("toughness", None)
        raw["solve"] = {**raw.get("solve", {}), "exact": False, "timing": False}
        raw.pop("figure", None)
        return parse(raw, file=self.study.file, text=to_toml(raw, self.study.file))


def _cut(one: "xr.Dataset", depth: float, ahead: float) -> Cut | str:
    if str(one["status"].values) != OK:
        return str(one["message"].values) or str(one["status"].values)
    energy, drive, error = (float(one[name]) for name in ("energy", "force", "force_error"))
    # The bar on the force contains that on the energy.
    relative = error / abs(drive)
    release, release_error = float(one["energy_release"]), float(one["energy_release_error"])
    return Cut(depth, ahead, energy, relative * energy, release, release_error, drive, error)
