"""Which features of studies end in a real-time model: each feature alone, with the tools that models know.

    python -m tests.realtime_features

writes benchmarks/results/realtime_features.md, which `tests/export/test_features.py` compares with the code.
"""

import copy
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_mapping
from epsmesh_realtime.export.insertion import tool_of
from epsmesh_realtime.export.scope import ExportError, scope_of
from tests.pairs import BASE, FEATURES, Feature, Study, write_bodies

TABLE = Path(__file__).parents[1] / "benchmarks" / "results" / "realtime_features.md"
# Tools with which a feature that is no tool is tried, as keys of the probe.
_TOOLS: dict[str, Study] = {
    "bonded disc": {},
    "frictionless disc": {"contact": "frictionless"},
    "sphere": {"shape": "sphere", "radius": "5 mm", "contact": "unilateral"},
}
_OF_TOOLS = ("probe", "contact")
_HEAD = """# Features with a real-time model

Machine: any; the table is no measurement, and a test compares it with the code.

Made by `python -m tests.realtime_features`: each feature of `tests/pairs.py` alone, in a study that is otherwise a disc
on a box of one linear tissue, as `epsmesh export` decides it. Features that are no tools were tried with a bonded disc,
a frictionless disc and a sphere. A model has forces alone: what a study computes besides is not in it.

| feature | model | tools, or the reason of the refusal |
|---|---|---|
"""


@dataclass(frozen=True)
class Found:
    """A feature, and the tools with which it has a model; or why it has none."""

    feature: str
    tools: tuple[str, ...]
    reason: str = ""

    @property
    def row(self) -> str:
        """The row of the table."""
        reason = " ".join(self.reason.split()).replace("|", "/")
        return f"| {self.feature} | {'yes' if self.tools else 'no'} | {', '.join(self.tools) or reason} |"


def _why_not(study: Study, folder: Path) -> str:
    """Return why a study has no model, "" if it has one."""
    try:
        found = read_mapping(study, "study", folder)
        if found.is_insertion:
            tool_of(found)
        else:
            scope_of(found)
    except StudyError as error:
        return str(error.problems[0])
    except ExportError as reason:
        return str(reason).split("study.toml: ", 1)[-1]
    return ""


def studies_of(feature: Feature) -> Iterator[tuple[str, Study]]:
    """Yield the studies in which a feature is tried, each with the name of its tool."""
    if feature.slot in _OF_TOOLS:
        also = {f"frictionless {feature.name}": {"contact": "frictionless"}} if feature.slot == "probe" else {}
        for name, keys in ({feature.name: {}} | also).items():
            study = copy.deepcopy(BASE)
            feature.change(study)
            study["probe"].update(keys)
            yield name, study
        return
    for name, keys in _TOOLS.items():
        study = copy.deepcopy(BASE)
        study["probe"].update(keys)
        feature.change(study)
        yield name, study


def find(folder: Path) -> list[Found]:
    """Return what is found of each feature; ``folder`` has the files of :func:`tests.pairs.write_bodies`."""
    found = []
    for feature in FEATURES:
        reasons = {name: _why_not(study, folder) for name, study in studies_of(feature)}
        tools = tuple(name for name, reason in reasons.items() if not reason)
        found.append(Found(feature.name, tools, "" if tools else next(iter(reasons.values()))))
    return found


def table(found: list[Found]) -> str:
    """Return the text of the table: features with a model first."""
    return _HEAD + "\n".join(one.row for one in sorted(found, key=lambda one: not one.tools)) + "\n"


def main() -> None:
    """Write the table."""
    with tempfile.TemporaryDirectory() as folder:
        write_bodies(Path(folder))
        TABLE.write_text(table(find(Path(folder))), encoding="utf-8")
    print(f"wrote {TABLE}")


if __name__ == "__main__":
    main()
