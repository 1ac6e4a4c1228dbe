"""Shards: independent parts of a plan. Each shard computes the same partition, without communication."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from heapq import heapify, heapreplace
from pathlib import Path

from epsmesh.plan.cost import CostModel
from epsmesh.plan.steps import MeshStep
from epsmesh.plan.work import NO_RECORD, Plan
from epsmesh.study.sweep import Study

_NAME = re.compile(r"\.(\d+)-of-(\d+)\.sqlite$")


@dataclass(frozen=True)
class Shard:
    """One of ``count`` parts of a study; ``number`` counts from 1."""

    number: int
    count: int

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    def store(self, output: Path, study: Study) -> Path:
        """Return the file of the shard's own store, so that no two jobs write the same file."""
        return output / "shards" / f"{study.name}.{self.number}-of-{self.count}.sqlite"


def parse_shard(text: str) -> Shard:
    """Return the shard that ``text``, "i/n", names.

    Raises:
        ValueError: if it names none.
    """
    match = re.fullmatch(r"(\d+)/(\d+)", text.strip(), re.ASCII)
    if match:
        shard = Shard(int(match[1]), int(match[2]))
        if 1 <= shard.number <= shard.count:
            return shard
    raise ValueError(f"{text!r} is no shard; give i/n (part i of n, 1 <= i <= n), such as 3/8")


def shard_of(path: Path) -> Shard | None:
    """Return the shard of a store, by its file name; None if it has no such name."""
    match = _NAME.search(path.name)
    return Shard(int(match[1]), int(match[2])) if match else None


def stores_of(output: Path, study: Study) -> list[Path]:
    """Return the stores of all shards of a study below ``output``."""
    folder = output / "shards"
    found = sorted(folder.iterdir()) if folder.is_dir() else []
    return [path for path in found if shard_of(path) and _NAME.sub("", path.name) == study.name]


def reason_against(study: Study) -> str:
    """Return why a study cannot be sharded, "" if it can."""
    if study.solve.timing:
        return "solve.timing = true compares times, which must come from one machine: run it without --shard"
    return ""


def take(plan: Plan, shard: Shard) -> Plan:
    """Return the part of the plan for ``shard``; ``plan`` must not depend on any store."""
    part = deal(plan, shard.count)[shard.number - 1]
    solves = tuple(solve for solve in plan.solves if solve.key in part)
    reason = f"This is shard {shard}; other shards compute these."
    return replace(plan, solves=solves, part=part).skipping("shard", len(plan.solves) - len(solves), reason)


def deal(plan: Plan, count: int) -> tuple[frozenset[str], ...]:
    """Return the keys of each of ``count`` shards: most expensive group first, to the shard with the least work."""
    parts: tuple[set[str], ...] = tuple(set() for _ in range(count))
    loads = [(0, number) for number in range(count)]
    heapify(loads)
    # The sort is stable: groups of equal cost stay in the study's order.
    for cost, keys in sorted(_units(plan), key=lambda unit: -unit[0]):
        load, number = loads[0]
        parts[number].update(keys)
        heapreplace(loads, (load + cost, number))
    return tuple(map(frozenset, parts))


def _units(plan: Plan) -> list[tuple[int, list[str]]]:
    """Return groups of keys that share a mesh or wait for each other, with their costs."""
    steps = plan.meshes
    groups = _Groups()
    for step in steps:
        groups.join(solve.key for solve in step.solves)
    for keys in _waiting(plan):
        groups.join(keys)
    costs: dict[str, int] = {}
    members: dict[str, list[str]] = {}
    for step in steps:
        keys = [solve.key for solve in step.solves]
        root = groups.root(keys[0])
        costs[root] = costs.get(root, 0) + _cost(step)
        members.setdefault(root, []).extend(keys)
    return [(costs[root], keys) for root, keys in members.items()]


def _waiting(plan: Plan) -> Iterable[list[str]]:
    """Return keys of cases that differ in ε only, with those of their F_exact, for `stop_near_exact`."""
    position = next((i for i, axis in enumerate(plan.study.axes) if axis.path == "mesh.epsilon"), None)
    if plan.study.planning.stop_near_exact is None or position is None or not plan.reference_keys:
        return ()
    chains: dict[tuple[int, ...], list[str]] = {}
    for case, key, exact in zip(plan.study.cases(), plan.keys, plan.reference_keys, strict=True):
        others = (*case.index[:position], *case.index[position + 1 :])
        chains.setdefault(others, []).extend(k for k in (key, exact) if k != NO_RECORD)
    return chains.values()


def _cost(step: MeshStep) -> int:
    """Return the estimated milliseconds of a step, equal for all shards.

    The estimate does not use stored times, and is rounded to three digits, because later ones may differ by machine.
    """
    return max(1, round(1000 * float(f"{CostModel().step_seconds(step):.3g}")))


class _Groups:
    """Disjoint sets of keys (union-find)."""

    def __init__(self) -> None:
        self._parents: dict[str, str] = {}

    def root(self, key: str) -> str:
        """Return the representative of the group of ``key``."""
        while (parent := self._parents.setdefault(key, key)) != key:
            self._parents[key] = key = self._parents[parent]
        return key

    def join(self, keys: Iterable[str]) -> None:
        """Merge the groups of ``keys``."""
        first, *others = map(self.root, keys)
        for other in others:
            self._parents[self.root(other)] = self.root(first)
