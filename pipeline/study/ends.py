"""The studies at the ends of the error bars of an identified material: what the bars make of every force."""

from dataclasses import dataclass, replace
from typing import Any

from pipeline.study.identified import NOTHING
from pipeline.study.problems import StudyError
from pipeline.study.read import parse
from pipeline.study.schema import EXPERIMENT
from pipeline.study.sweep import Study
from pipeline.study.text import toml_of


@dataclass(frozen=True)
class Ends:
    """A study with one identified parameter at the lower and at the upper end of its bar, all else as it is.

    An end that makes no study, such as a Poisson's ratio that the elements do not allow, is None.
    """

    unknown: str
    low: Study | None
    high: Study | None

    @property
    def studies(self) -> tuple[Study, ...]:
        """The ends that there are."""
        return tuple(study for study in (self.low, self.high) if study is not None)


def ends_of_bars(study: Study) -> tuple[Ends, ...]:
    """Return the ends of each bar of the study's material; none if it was not identified."""
    found = study.identified
    return tuple(
        Ends(name, _moved(study, number, found.low[number]), _moved(study, number, found.high[number]))
        for number, name in enumerate(found.unknown)
    )


def _moved(study: Study, number: int, value: float) -> Study | None:
    """Return the study with another value of one identified parameter, without F_exact; None if it makes no sense."""
    raw: dict[str, Any] = {key: v for key, v in toml_of(study.text, study.file).items() if key not in EXPERIMENT}
    raw["identified"]["estimate"][number] = value
    raw["solve"] = raw.get("solve", {}) | {"exact": False, "timing": False}
    raw["plan"] = {key: kept for key, kept in raw.get("plan", {}).items() if key != "stop_near_exact"}
    try:
        return replace(parse(raw, file=study.file), identified=NOTHING)
    except StudyError:
        return None
