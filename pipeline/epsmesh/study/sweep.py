"""Sweeps: a study file's axes, and the cases that they become."""

import itertools
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import prod
from operator import itemgetter
from typing import Any, TypeVar, cast

from epsmesh.shapes.body import Body
from epsmesh.shapes.insertion import Inserted, Insertion
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import Section
from epsmesh.study.axis import Axis
from epsmesh.study.case import Case
from epsmesh.study.expected_depth import at_depth, expected_depth, gives_force
from epsmesh.study.identified import NOTHING, Identified
from epsmesh.study.insertion_stages import punctures
from epsmesh.study.loads import Load
from epsmesh.study.output import Output
from epsmesh.study.problems import Problem
from epsmesh.study.schema import Credibility, Drawing, Material, Mesh, Planning, Solving, main_material

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
    extra: Mapping[str, Any] = field(default_factory=dict)  # what sections of other packages say, by their names
    identified: Identified = NOTHING
    outputs: tuple[Output, ...] = ()
    lacking: tuple[Problem, ...] = ()  # what its cases need, and need not be said with these sections
    does: str = ""  # the command that does without what is lacking
    depths: Mapping[tuple[int, ...], float] = field(default_factory=dict)  # of cases with a given force, where known
    seeks: bool = True  # whether depths at given forces are still to be found

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
    def gives_force(self) -> bool:
        """Whether its cases have a given force, and a depth that is found."""
        return any(map(gives_force, self.probes))

    @property
    def seeks_depths(self) -> bool:
        """Whether depths at given forces are still to be found."""
        return self.seeks and self.gives_force

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

    @cached_property
    def credibility(self) -> Credibility:
        """The section on what the answer is for, which is not swept."""
        (found,) = self.sections["credibility"]
        assert isinstance(found, Credibility)
        return found

    def indices(self) -> Iterator[tuple[int, ...]]:
        """Yield the index of every case, one number for each axis, the last axis fastest."""
        return itertools.product(*(range(n) for n in self.shape))

    def cases(self) -> Iterator[Case]:
        """Yield every case, in the order of the indices."""
        return map(self.case, self.indices())

    def by_case(self, values: Sequence[Value]) -> list[list[Value]]:
        """Return ``values``, one for each case and stage, as one list for each case of the dataset."""
        found: dict[tuple[int, ...], list[Value]] = {}
        for index, value in zip(self.indices(), values, strict=True):
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
        scene = self.scene(index)
        if (known := self._scenes.get(scene)) is None:
            body, material, probe, load = self._parts(index)
            if gives_force(probe):
                probe = at_depth(probe, self.depths.get(index) or expected_depth(body, material, probe))
            known = self._scenes[scene] = body, material, probe, load, {}
        body, material, probe, load, shared = known
        case = Case(index, self.axes, body, material, probe, self.mesh(index), self.solve, load, None, self.outputs)
        object.__setattr__(case, "shared", shared)
        return case

    def scene(self, index: tuple[int, ...]) -> Hashable:
        """Return what is the same for the cases that differ in the mesh alone."""
        scene, depth = self._axes_of_scene(index), self.depths.get(index)
        return scene if depth is None else (scene, depth)

    def mesh(self, index: tuple[int, ...]) -> Mesh:
        """Return the mesh section of the case at ``index``."""
        return self._meshes[self._axes_of_mesh(index)]

    @cached_property
    def _axes_of_scene(self) -> Callable[[tuple[int, ...]], Hashable]:
        return _chosen([number for number, axis in enumerate(self.axes) if axis.section != "mesh"])

    @cached_property
    def _axes_of_mesh(self) -> Callable[[tuple[int, ...]], Hashable]:
        return _chosen([number for number, axis in enumerate(self.axes) if axis.section == "mesh"])

    @cached_property
    def _meshes(self) -> dict[Hashable, Mesh]:
        shape = [len(axis) if axis.section == "mesh" else 1 for axis in self.axes]
        indices = itertools.product(*map(range, shape))
        meshes = cast("Sequence[Mesh]", self.sections["mesh"])
        return {self._axes_of_mesh(index): mesh for index, mesh in zip(indices, meshes, strict=True)}

    @cached_property
    def _scenes(self) -> dict[Hashable, tuple[Body, Material, Probe, Load, dict[Hashable, Any]]]:
        """Body, material, probe and load of each scene, and what its cases share."""
        return {}

    def _parts(self, index: tuple[int, ...]) -> tuple[Body, Material, Probe, Load]:
        numbers = {}
        for name in ("body", "material", "load", "probe"):
            flat = 0
            for axis, number in zip(self.axes, index, strict=True):
                flat = flat * len(axis) + number if axis.section == name else flat
            numbers[name] = flat
        chosen: Any = {name: self.sections[name][number] for name, number in numbers.items()}
        probe, _ = chosen.pop("probe"), numbers.pop("probe")
        together = tuple(numbers.values())
        if together not in self._in_use:
            self._in_use[together] = _in_use(**chosen)
        body, material, load = self._in_use[together]
        return body, material, probe, load

    @cached_property
    def _in_use(self) -> dict[tuple[int, ...], tuple[Body, Material, Load]]:
        """What cases have of body, material and load, by the numbers of the three; most cases share it."""
        return {}


def _chosen(axes: Sequence[int]) -> Callable[[tuple[int, ...]], Hashable]:
    """Return the function that returns the part of an index for some ``axes``."""
    return itemgetter(*axes) if axes else _nothing


def _nothing(_index: tuple[int, ...]) -> Hashable:
    return ()


def _in_use(body: Body, material: Material, load: Load) -> tuple[Body, Material, Load]:
    """Return the parts of a case that depend on each other.

    What regions lack, they have from the material. A body that layers fill has none: its first layer then takes the
    place of region 0, which has no cell. Pressures in hollow regions are tractions of the load.
    """
    material = main_material(body, material)
    return body.completed_by(material), material, load.with_pressures(body.pressures)
