"""What other packages add to this one, and how: entry points, of which each group has one small contract.

A distribution declares them, and epsmesh finds them wherever they are installed; it imports no such package by name::

    [project.entry-points."epsmesh.commands"]
    "guide.identify" = "my_package.commands:identify"

- ``epsmesh.commands``: a command by its name, or by ``PLACE.NAME``, which is listed after ``PLACE``. The target is a
  function as typer takes it. `epsmesh.cli.words` has arguments that commands share, `epsmesh.cli.console` prints.
- ``epsmesh.sections``: a section of a study file by its name. The target is a :class:`Sections`, the same one for all
  sections that belong together. What they say is in ``Study.extra``.
- ``epsmesh.datasets``: a kind of dataset by its name, a :class:`Kind`.
- ``epsmesh.files``: a kind of file by its ending, without the dot: the function of a path that ``epsmesh.open`` calls.
- ``epsmesh.forecasts``: what else can be made of a study, by any name: a function of a study, a cost model and the
  number of ranks, which returns the :class:`Forecast` of it that `epsmesh plan` tells.
- ``epsmesh.views``: files that are neither studies nor label maps, by any name: a function of the path of one, which
  prints what is in it for `epsmesh view`.
- ``epsmesh.packages``: under the name ``realtime``, the package that ``epsmesh.realtime`` is.
- ``epsmesh.methods``: a method of what ``epsmesh.read`` returns, by its name: a function of the study, an
  :class:`epsmesh.api.RunnableStudy`.

Names are read without an import of the target; it is imported when it is asked for. Of two entry points with one name
the first on Python's path counts.
"""

import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, reduce
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr
    from pydantic import BaseModel

    from epsmesh.plan.cost import CostModel
    from epsmesh.shapes.section import Section
    from epsmesh.study.output import Output
    from epsmesh.study.problems import Problem, Problems
    from epsmesh.study.sweep import Study


class RefusedError(Exception):
    """What a package finds wrong with a file that a study names, as a sentence for the study's author."""


@dataclass(frozen=True)
class Filled:
    """A study as its file has it, and with what it need not say since a section makes up for it.

    ``given`` becomes ``Study.raw``; ``whole`` is read. ``lacking`` are errors of a run of its cases, and ``does``
    is the command that does without them. ``doubts`` are warnings. ``borrowed`` has sections that are those of a
    table of another section, by the key of this table. ``of_one_force`` names the sections that need one force of
    each case, as messages name them.
    """

    given: Mapping[str, Any]
    whole: Mapping[str, Any]
    lacking: "tuple[Problem, ...]" = ()
    doubts: "tuple[Problem, ...]" = ()
    does: str = ""
    borrowed: Mapping[str, str] = field(default_factory=dict)
    of_one_force: str = ""


@dataclass(frozen=True)
class Reading:
    """A study whose own sections have been read: what further ones are read with.

    ``given`` is the study as TOML. Mistakes are reported to ``problems``. ``outputs`` returns its further numbers, and
    reports the mistakes in them when it is first called.
    """

    given: Mapping[str, Any]
    sections: "Mapping[str, tuple[Section, ...]]"
    file: str
    problems: "Problems"
    outputs: "Callable[[], tuple[Output, ...]]"


@dataclass(frozen=True)
class Forecast:
    """What `epsmesh plan` tells of work besides the cases of a study: as ``data`` for scripts, and as a line."""

    data: dict[str, Any]
    line: str


@dataclass(frozen=True)
class Made:
    """What a command has made: as ``data`` for scripts, and as lines."""

    data: dict[str, Any]
    lines: tuple[str, ...]


def _as_it_is(study: Filled) -> Filled:
    return study


def _nothing(_study: "Study") -> str:
    return ""


def _nothing_further(_study: "Study", _output: Path) -> None:
    return None


def _no_work(_study: "Study", _cost: "CostModel") -> Iterable[Forecast]:
    return ()


@dataclass(frozen=True)
class Sections:
    """Further sections of a study file, on which no force depends: they neither sweep nor change cases.

    ``models`` are the keys of each section, in the order of the reference, and ``texts`` what it says of a section, or
    of a table within one (``section.table``), of which ``tables`` has the models. Sections in ``arrays`` are arrays of
    tables. ``others`` is the JSON schema of further keys of a section, such as names of parameters. ``pages`` names the
    page of the documentation (``guide/name``) for messages about a section.

    ``read`` returns what the sections say, for ``Study.extra``. ``fill`` returns a study that has one of them with what
    it need not say, ``left_out`` what `epsmesh run` leaves out of it, "" for nothing. ``forecast`` tells what work
    besides the cases costs; it raises a StudyError if that cannot be done, or a :class:`RefusedError`. ``further``
    returns, for the folder of the results, what `epsmesh run` calls with the case store when the cases of a study are
    computed, None for nothing. ``following`` ranks, with the case store, what to measure next, for `epsmesh plan
    --next`; ``True`` is for no progress.
    """

    models: "Mapping[str, type[Section]]"
    texts: Mapping[str, str]
    read: Callable[[Reading], Mapping[str, Any]]
    tables: "Mapping[str, Mapping[str, type[BaseModel]]]" = field(default_factory=dict)
    arrays: Collection[str] = ()
    others: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    pages: Mapping[str, str] = field(default_factory=dict)
    fill: Callable[[Filled], Filled] = _as_it_is
    left_out: "Callable[[Study], str]" = _nothing
    forecast: "Callable[[Study, CostModel], Iterable[Forecast]]" = _no_work
    further: "Callable[[Study, Path], Callable[[Path], Made] | None]" = _nothing_further
    following: "Callable[[Study, Path, bool], Made] | None" = None


@dataclass(frozen=True)
class Kind:
    """A kind of dataset that is not that of a study's cases: `epsmesh report` shows it.

    ``title`` and ``content`` are words of messages, such as "an identification" and "identification of curves".
    ``is_one`` tells datasets of this kind, ``write_page`` writes the report of one to a path and returns that, ``draw``
    draws its figure to ``<stem>.png`` and ``<stem>.svg`` and returns the files.
    """

    title: str
    content: str
    is_one: "Callable[[xr.Dataset], bool]"
    write_page: "Callable[[xr.Dataset, Path], Path]"
    draw: "Callable[[xr.Dataset, Path], list[Path]]"


@dataclass(frozen=True)
class Target:
    """What an entry point names: ``module:name``."""

    value: str

    def load(self) -> Any:
        """Import it."""
        module, _, name = self.value.partition("[")[0].strip().partition(":")
        return reduce(getattr, filter(None, name.split(".")), import_module(module))


def found(group: str) -> Mapping[str, Target]:
    """Return the entry points of a group by name; of two with one name, the first that Python finds."""
    return _declared().get(f"epsmesh.{group}", {})


@lru_cache
def _declared() -> dict[str, dict[str, Target]]:
    """Return the entry points of all groups of this package.

    importlib.metadata finds the same in 30 ms, while `epsmesh --help` takes 100.
    """
    groups: dict[str, dict[str, Target]] = {}
    for text in _declarations():
        group = ""
        for line in map(str.strip, text.splitlines()):
            name, equals, value = map(str.strip, line.partition("="))
            if line.startswith("["):
                group = line.strip("[]")
            elif equals and group.startswith("epsmesh."):
                groups.setdefault(group, {}).setdefault(name, Target(value))
    return groups


def _declarations() -> Iterator[str]:
    """Yield the files of the distributions that Python finds and that declare entry points of this package."""
    for folder in map(Path, sys.path):
        try:
            distributions = sorted(one for one in folder.iterdir() if one.suffix in (".dist-info", ".egg-info"))
        except OSError:  # it is none, or an archive
            continue
        for distribution in distributions:
            try:
                text = (distribution / "entry_points.txt").read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError):  # most have none
                continue
            if "[epsmesh." in text:
                yield text


def commands() -> dict[str, tuple[Target, str]]:
    """Return the commands that other packages add, by name, each with the one that it is listed after, or ""."""
    places = [(name.rpartition("."), target) for name, target in found("commands").items()]
    return {name: (target, place) for (place, _, name), target in places}


def further_forecasts(study: "Study", cost: "CostModel", ranks: int) -> list[Forecast]:
    """Return what other packages tell of work that a study may be used for."""
    return [one.load()(study, cost, ranks) for one in found("forecasts").values()]


def sections_of(names: Iterable[str]) -> "tuple[Sections, ...]":
    """Return what adds sections of these names, each once; names that nothing adds are left out."""
    return _loaded([name for name in names if name in found("sections")])


def all_sections() -> "tuple[Sections, ...]":
    """Return what adds sections, each once."""
    return _loaded(found("sections"))


def _loaded(names: Iterable[str]) -> "tuple[Sections, ...]":
    by_number = {id(one): one for one in (found("sections")[name].load() for name in names)}
    return tuple(by_number.values())


def kind(name: str) -> Kind:
    """Return a kind of dataset by its name."""
    loaded: Kind = found("datasets")[name].load()
    return loaded


def kind_of(dataset: "xr.Dataset") -> str:
    """Return the name of the kind of a dataset; "" if it is of none that another package adds."""
    return next((name for name in found("datasets") if kind(name).is_one(dataset)), "")
