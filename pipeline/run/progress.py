"""Progress on long work: a bar where someone watches, a plain line a case where output goes to a file."""

import sys
import time
from types import TracebackType
from typing import Any, Protocol


class Progress(Protocol):
    """What a run tells whoever started it."""

    def done(self, label: str, failed: str = "") -> None:
        """Report that one more case is finished, or has ``failed`` with a message."""

    def note(self, text: str) -> None:
        """Say what is being worked on."""


class Silent:
    """Reports nothing: for ranks other than the first, and for scripts."""

    def done(self, label: str, failed: str = "") -> None:
        """Report nothing."""

    def note(self, text: str) -> None:
        """Report nothing."""


class Terminal:
    """Progress for people, as a context manager: rich's bar on a terminal, else plain lines."""

    def __init__(self, total: int):
        self._total, self._count, self._start = total, 0, time.monotonic()
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> "Terminal":
        if sys.stderr.isatty() and self._total:
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
            from rich.progress import Progress as Bar
            from rich.table import Column

            numbers = (MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())
            # What is being worked on gives way to the numbers where the terminal is narrow.
            words = TextColumn("{task.description}", table_column=Column(ratio=1, no_wrap=True, overflow="ellipsis"))
            console = Console(stderr=True)
            self._bar = Bar(BarColumn(bar_width=20), *numbers, words, console=console, transient=True, expand=True)
            self._bar.start()
            self._task = self._bar.add_task("", total=self._total)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def done(self, label: str, failed: str = "") -> None:
        """Count a case."""
        self._count += 1
        if self._bar is not None:
            self._bar.advance(self._task)
            if failed:
                self._bar.console.print(f"failed: {label}: {failed}", style="red", markup=False, highlight=False)
            return
        seconds = time.monotonic() - self._start
        text = f"[{self._count}/{self._total}] {seconds:.1f} s  {label}"
        print(f"{text}  FAILED: {failed}" if failed else text, file=sys.stderr, flush=True)

    def note(self, text: str) -> None:
        """Show what is being worked on."""
        if self._bar is not None:
            self._bar.update(self._task, description=text)
