"""Sweeps: a study file's axes, and the cases that they become."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import prod
from typing import Any, TypeVar, cast

from pipeline.shapes.body import Body
from pipeline.shapes.insertion import Inserted, Insertion
from pipeline.shapes.probe import Probe
from pipeline.shapes.section import Section
from pipeline.study.axis import Axis
from pipeline.study.case import Case
from pipeline.study.identification import Identification
from pipeline.study.identified import NOTHING, Identified
from pipeline.study.insertion_stages import punctures
from pipeline.study.loads import Load
from pipeline.study.measurement import Measurement
from pipeline.study.output import Output
from pipeline.study.problems import Problem
from pipeline.study.schema import Drawing, Material, Planning, Solving, material_of
from pipeline.study.sensitivity import Spread

_PARTS = ("body", "material", "probe", "mesh", "solve", "load")
Value = TypeVar("Value")


@dataclass(frozen=True)
class Study:
    """A study file, read and found to make sense."""

    file: str
    name: str
    title: str
    text: str
    axes: tuple[Axis, ...]
    sections: dict[str, tuple[Section, ...]]  # every combination of a section's own axes, last axis fastest
    warnings: tuple[str, ...] = ()
    raw: Mapping[str, Any] = field(default_factory=dict, repr=False)  # the file's TOML
    measurements: tuple[Measurement, ...] = ()
    identification: Identification = field(default_factory=Identification)
    identified: Identified = NOTHING
    spread: Spread = field(default_factory=Spread)
    outputs: tuple[Output, ...] = ()
    lacking: tuple[Problem, ...] = ()  # what its cases need, and the study of measured curves does not say

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes."""
        return tuple(len(axis) for axis in self.axes)

    def __len__(self) -> int:
        """Number of cases of the dataset: the stages of a history are one case."""
        return prod(len(axis) for axis in self.axes if not axis.is_stage)

    @cached_property
    def solve(self) -> Solving:
        """The solver section, which is not swept."""
        (solve,) = self.sections["solve"]
        assert isinstance(solve, Solving)
        return solve

    @cached_property
    def probes(self) -> tuple[Probe, ...]:
        """The probes, with every value that is swept of them."""
        return tuple(probe for probe in self.sections["probe"] if isinstance(probe, Probe))

    @property
    def is_insertion(self) -> bool:
        """Whether its tools are inserted: a case is then a path through its stages."""
        return "tool" in self.sections

    @property
    def insertion(self) -> Insertion:
        """The insertion of all of its tools.

        Raises:
            AttributeError: if they are not inserted.
        """
        found: Insertion = self.sections["tool"][0].insertion  # type: ignore[attr-defined]
        return found

    @property
    def step_depths(self) -> tuple[float, ...]:
        """The depths (m) of the steps of its insertion."""
        (axis,) = (axis for axis in self.axes if axis.is_stage)
        return tuple(float(depth) for depth in axis.labels[1:])

    @property
    def punctures(self) -> int:
        """The number of layers, from the surface down, that end with the last one that a tool may pierce."""
        return punctures(
            cast("Sequence[Inserted]", self.sections["tool"]), cast("Sequence[Body]", self.sections["body"])
        )

    def tool(self, case: Case) -> Probe:
        """Return the tool of a case as the file has it, not at one of its stages."""
        if not self.is_insertion:
            return case.probe
        flat = 0
        for axis, number in zip(case.axes, case.index, strict=True):
            if axis.section == "probe" and not axis.is_stage:
                flat = flat * len(axis) + number
        tool = self.sections["tool"][flat]
        assert isinstance(tool, Probe)
        return tool

    @cached_property
    def planning(self) -> Planning:
        """The planning section, which is not swept."""
        (planning,) = self.sections["plan"]
        assert isinstance(planning, Planning)
        return planning

    @cached_property
    def drawing(self) -> Drawing:
        """The section on the figure, which is not swept."""
        (drawing,) = self.sections["figure"]
        assert isinstance(drawing, Drawing)
        return drawing

    def cases(self) -> Iterator[Case]:
        """Yield every case, the last axis fastest."""
        for index in itertools.product(*(range(n) for n in self.shape)):
            yield self.case(index)

    def by_case(self, values: Sequence[Value]) -> list[list[Value]]:
        """Return ``values``, one for each case and stage, as one list for each case of the dataset."""
        found: dict[tuple[int, ...], list[Value]] = {}
        for index, value in zip(itertools.product(*(range(n) for n in self.shape)), values, strict=True):
            own = tuple(i for i, axis in zip(index, self.axes, strict=True) if not axis.is_stage)
            found.setdefault(own, []).append(value)
        return list(found.values())

    def whole_cases(self) -> Iterator[tuple[tuple[int, ...], Case]]:
        """Yield the cases of the dataset, each with its index there: those at the last stage of a history."""
        stages = [number for number, axis in enumerate(self.axes) if axis.is_stage]
        for case in self.cases():
            if all(case.index[number] == len(self.axes[number]) - 1 for number in stages):
                yield tuple(i for number, i in enumerate(case.index) if number not in stages), case

    def case(self, index: tuple[int, ...]) -> Case:
        """Return the case at ``index``, one number for each axis."""
        places: dict[str, int] = {}
        for name, own in self._layout.items():
            flat = 0
            for position, length in own:
                flat = flat * length + index[position]
            places[name] = flat
        chosen: Any = {name: self.sections[name][flat] for name, flat in places.items()}
        together = places["body"], places["material"], places["load"]
        if together not in self._in_use:
            self._in_use[together] = _in_use(chosen["body"], chosen["material"], chosen["load"])
        return Case(index, self.axes, outputs=self.outputs, **chosen | self._in_use[together])

    @cached_property
    def _in_use(self) -> dict[tuple[int, int, int], dict[str, Section]]:
        """What cases have of body, material and load, by the numbers of the three; most cases share it."""
        return {}

    @cached_property
    def _layout(self) -> dict[str, tuple[tuple[int, int], ...]]:
        """For each part of a case, position and length of the axes that choose among its variants."""
        return {
            name: tuple((i, len(axis)) for i, axis in enumerate(self.axes) if axis.section == name) for name in _PARTS
        }


def _in_use(body: Body, material: Material, load: Load) -> dict[str, Section]:
    """Return the parts of a case that depend on each other.

    A body that layers fill has the first one's material, not the section's. Regions without a law have that of the
    material. Pressures in hollow regions are tractions of the load.
    """
    material = material_of(body.regions[0]) if body.is_filled else material
    return {"body": body.with_law_of(material), "material": material, "load": load.with_pressures(body.pressures)}
