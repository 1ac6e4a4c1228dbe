"""The studies at the ends of what is not known of the tissue and of the image: what that makes of every force."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from epsmesh.shapes.segmented import Segmented, is_uncertain
from epsmesh.shapes.triangles import SurfaceError
from epsmesh.study.identified import NOTHING
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from epsmesh.study.schema import SECTIONS
from epsmesh.study.sweep import Study
from epsmesh.study.text import toml_of


@dataclass(frozen=True)
class Ends:
    """A study with one identified parameter at the lower and at the upper end of its bar, all else as it is.

    An end that makes no study, such as a Poisson's ratio that the elements do not allow, is None. The parameter may
    also be the boundary of an image or its smoothing (``of_image``).
    """

    unknown: str
    low: Study | None
    high: Study | None
    of_image: bool = False

    @property
    def studies(self) -> tuple[Study, ...]:
        """The ends that there are."""
        return tuple(study for study in (self.low, self.high) if study is not None)


def ends_of(study: Study) -> tuple[Ends, ...]:
    """Return the ends of all bars: those of the material, if it was identified, and those that the image leaves."""
    return ends_of_bars(study) + ends_of_image(study)


def ends_of_image(study: Study) -> tuple[Ends, ...]:
    """Return the ends of the boundary's position and of the smoothing; none without ``boundary_uncertainty``."""
    bodies = [body for body in study.sections["body"] if is_uncertain(body)]
    if not bodies:
        return ()
    inward, outward = (_with_bodies(study, partial(_moved_boundary, sign=sign)) for sign in (-1, 1))
    boundary = Ends("boundary", inward, outward, of_image=True)
    if not any(body.smoothing_range for body in bodies):
        return (boundary,)
    less, more = (_with_bodies(study, partial(_smoothed, end=end)) for end in (0, 1))
    return boundary, Ends("smoothing", less, more, of_image=True)


def _moved_boundary(body: Segmented, sign: int) -> Segmented:
    return body.varied(offset=sign * body.boundary_range)


def _smoothed(body: Segmented, end: int) -> Segmented:
    found = body.smoothing_range
    return body.varied(smooth=found[end] if found else None)


def _with_bodies(study: Study, change: Callable[[Segmented], Segmented]) -> Study | None:
    """Return the study with other segmented bodies, without F_exact and bars; None if one cannot be made."""
    try:
        bodies = tuple(change(body) if is_uncertain(body) else body for body in study.sections["body"])
    except SurfaceError:
        return None
    solve = study.solve.model_copy(update={"exact": False, "timing": False})
    planning = study.planning.model_copy(update={"stop_near_exact": None})
    sections = {"body": bodies, "solve": (solve,), "plan": (planning,)}
    return replace(study, sections=study.sections | sections, identified=NOTHING)


def ends_of_bars(study: Study) -> tuple[Ends, ...]:
    """Return the ends of each bar of the study's material; none if it was not identified."""
    found = study.identified
    return tuple(
        Ends(name, _moved(study, number, found.low[number]), _moved(study, number, found.high[number]))
        for number, name in enumerate(found.unknown)
    )


def _moved(study: Study, number: int, value: float) -> Study | None:
    """Return the study with another value of one identified parameter, without F_exact; None if it makes no sense."""
    own = (*SECTIONS, "title", "identified")
    raw: dict[str, Any] = {key: v for key, v in toml_of(study.text, study.file).items() if key in own}
    raw["identified"]["estimate"][number] = value
    raw["solve"] = raw.get("solve", {}) | {"exact": False, "timing": False}
    raw["plan"] = {key: kept for key, kept in raw.get("plan", {}).items() if key != "stop_near_exact"}
    try:
        return _with_bodies(parse(raw, file=study.file), Segmented.varied)
    except StudyError:
        return None
