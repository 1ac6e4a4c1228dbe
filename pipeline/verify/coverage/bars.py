"""What trials say of the error bars: how many hold the truth, and how idle they are."""

from dataclasses import dataclass
from math import nan
from statistics import median

# What is asked of the bars of every group of trials that is large enough to tell; of the median, unless a family of
# scenes asks for another: where F is no bound, a bar has to be on both sides.
HELD, IDLE, ENOUGH = 0.95, 2.0, 40


@dataclass(frozen=True)
class Trial:
    """One random case: its force and error bar, and the truth with its own; or the message of what failed.

    ``kind`` is the degree and the element, ``mesh`` "graded" or "naive"; a case is ``refused`` if its bar says that the
    force is not known.
    """

    name: str
    force: float
    bar: float
    truth: float
    truth_bar: float
    message: str = ""
    kind: tuple[int, str] = (0, "")
    mesh: str = ""
    refused: bool = False

    @property
    def error(self) -> float:
        """The larger of those relative to the force and to the truth."""
        return max(abs(self.truth / self.force - 1), abs(self.force / self.truth - 1))

    @property
    def is_held(self) -> bool:
        """Whether the bar holds the truth, with no allowance for the truth's own error."""
        return self.error <= self.bar

    @property
    def ratio(self) -> float:
        """How much larger the bar is than the error."""
        return self.bar / self.error


@dataclass(frozen=True)
class Group:
    """Trials of one kind, of which those that were refused say nothing of the bars."""

    name: str
    trials: tuple[Trial, ...]

    @property
    def served(self) -> tuple[Trial, ...]:
        """Those with a force."""
        return tuple(trial for trial in self.trials if not trial.refused)

    @property
    def held(self) -> int:
        """How many bars hold the truth."""
        return sum(trial.is_held for trial in self.served)

    @property
    def share(self) -> float:
        """Share of the bars that hold the truth."""
        return self.held / len(self.served) if self.served else nan

    @property
    def ratio(self) -> float:
        """Median of bar over error."""
        ratios = [trial.ratio for trial in self.served if not trial.message]
        return median(ratios) if ratios else nan

    @property
    def worst(self) -> float:
        """The largest error, in bars."""
        return max((1 / trial.ratio for trial in self.served if not trial.message), default=nan)

    def is_met(self, idle: float) -> bool:
        """Tell whether the bars are 95 % bars, and not idle ones: their median at most ``idle`` errors."""
        return self.share >= HELD and self.ratio <= idle


@dataclass(frozen=True)
class Coverage:
    """What all trials say of the bars."""

    trials: tuple[Trial, ...]
    idle: float = IDLE

    @property
    def groups(self) -> tuple[Group, ...]:
        """The trials by degree and element, by mesh, by both, and all of them."""
        kinds = sorted({trial.kind for trial in self.trials}, key=lambda kind: (kind[1], kind[0]))
        found = []
        for degree, element in kinds:
            of_kind = tuple(trial for trial in self.trials if trial.kind == (degree, element))
            name = f"degree {degree} {element}"
            found.append(Group(name, of_kind))
            found += [Group(f"{name}, {mesh}", tuple(t for t in of_kind if t.mesh == mesh)) for mesh in self.meshes]
        found += [Group(f"{mesh} meshes", tuple(t for t in self.trials if t.mesh == mesh)) for mesh in self.meshes]
        return (*(group for group in found if group.trials), Group("all", self.trials))

    @property
    def meshes(self) -> tuple[str, ...]:
        """The kinds of meshes."""
        return tuple(sorted({trial.mesh for trial in self.trials}))

    @property
    def is_met(self) -> bool:
        """Whether all bars together, and those of every group that is large enough, are what they should be."""
        return all(
            group.is_met(self.idle) for group in self.groups if len(group.served) >= ENOUGH or group.name == "all"
        )

    def __str__(self) -> str:
        """The table, a line for each group."""
        lines = [_LINE.format("", "held", "", "bar / |error|", "worst", "refused")]
        lines += [
            _LINE.format(
                group.name,
                f"{group.held} of {len(group.served)}",
                f"{group.share:.1%}",
                f"{group.ratio:.2f}",
                f"{group.worst:.2f}",
                len(group.trials) - len(group.served),
            )
            for group in self.groups
        ]
        asked = (
            f"asked for, of groups of {ENOUGH} and more: {HELD:.0%} held, median of bar / |error| at most {self.idle:g}"
        )
        return "\n".join([*lines, f"{asked}: {'met' if self.is_met else 'NOT MET'}"])


_LINE = "{:32} {:>12} {:>7} {:>14} {:>6} {:>8}"
