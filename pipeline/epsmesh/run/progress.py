"""Progress of a run: a bar on a terminal, occasional plain lines in a file."""

import sys
import time
from types import TracebackType
from typing import Any

from epsmesh.printable import printable
from epsmesh.run.remaining import Remaining, format_seconds

# In a file, a line is written after this share of the solves, and after so many seconds without one.
_SHARE, _SILENCE = 0.05, 30.0
# Refreshes of the bar per second: few, so that they cost the solver nothing.
_REFRESH = 2
# The prefix of a note on meshing.
MESHING = "meshing: "


class Progress:
    """Progress that prints nothing: for scripts, and for ranks other than the first."""

    def done(self, label: str, failed: str = "") -> None:
        """Report a finished solve, or one that ``failed`` with a message."""

    def note(self, text: str) -> None:
        """Report the present work."""


class Terminal(Progress):
    """Progress for people, as a context manager: a bar on a terminal, else plain lines.

    ``remaining`` estimates the time left, of the run and of the present step; ``verbose`` prints a line for each solve.
    """

    def __init__(self, total: int, remaining: Remaining | None = None, *, verbose: bool = False):
        self._total, self._count, self._start = total, 0, time.monotonic()
        self._remaining, self._verbose = remaining, verbose
        self._printed, self._printed_count = self._start, 0
        self._step: int | None = None
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> "Terminal":
        if sys.stderr.isatty() and self._total:
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, ProgressColumn, TextColumn
            from rich.progress import Progress as Bar
            from rich.table import Column
            from rich.text import Text

            class Times(ProgressColumn):
                """Time elapsed and time left."""

                def render(column, _: Any) -> Text:
                    return Text(self._times())

            # On a narrow terminal the words are cut, not the numbers.
            words = TextColumn(
                "{task.description}", markup=False, table_column=Column(ratio=1, no_wrap=True, overflow="ellipsis")
            )
            numbers = (MofNCompleteColumn(), Times(table_column=Column(no_wrap=True)))
            console = Console(stderr=True)
            self._bar = Bar(
                BarColumn(bar_width=20),
                *numbers,
                words,
                console=console,
                transient=True,
                expand=True,
                refresh_per_second=_REFRESH,
            )
            self._bar.start()
            self._task = self._bar.add_task("", total=self._total)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def done(self, label: str, failed: str = "") -> None:
        """Count a solve, and print it if due."""
        self._count += 1
        if self._remaining is not None:
            self._remaining.done(label, counts=not failed)
            self._step = self._remaining.step_of(label)
        if self._bar is not None:
            self._bar.advance(self._task)
        if self._is_worth_a_line() or failed:
            self._line(f"{label}  FAILED: {failed}" if failed else label, "red" if failed else "")

    def note(self, text: str) -> None:
        """Show the present work."""
        step = self._remaining.step_of(text.removeprefix(MESHING)) if self._remaining is not None else None
        self._step = self._step if step is None else step
        if self._bar is not None:
            self._bar.update(self._task, description=printable(text))
        elif self._verbose or time.monotonic() - self._printed > _SILENCE:
            self._line(f"… {text}")

    def _is_worth_a_line(self) -> bool:
        if self._verbose:
            return True
        if self._bar is not None:
            return False
        enough = self._count - self._printed_count >= _SHARE * self._total or self._count == self._total
        return enough or time.monotonic() - self._printed > _SILENCE

    def _line(self, text: str, style: str = "") -> None:
        self._printed, self._printed_count = time.monotonic(), self._count
        line = f"[solve {self._count}/{self._total}] {self._times()}  {printable(text)}"
        if self._bar is not None:
            self._bar.console.print(line, style=style, markup=False, highlight=False, soft_wrap=True)
        else:
            print(line, file=sys.stderr, flush=True)

    def _times(self) -> str:
        gone = format_seconds(time.monotonic() - self._start)
        if self._remaining is None or self._count == self._total or not self._remaining.is_known:
            return gone
        left = f"{gone}, about {format_seconds(self._remaining.seconds())} left"
        if self._step is None or self._remaining.steps == 1 or self._bar is None:
            return left
        step = f"step {self._step + 1}/{self._remaining.steps}"
        seconds = self._remaining.seconds(self._step)
        return f"{left} ({step}: {format_seconds(seconds)})" if seconds > 0.05 else left
