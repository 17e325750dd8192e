"""Progress bars with the time left, on standard error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


@dataclass
class Task:
    """Progress of a piece of work. Without a bar it only counts. Changes in place.

    Attributes:
        done: number of finished steps.
        show: called with that number whenever it changes.
    """

    done: int = 0
    show: Callable[[int], object] = lambda done: None

    def advance(self, steps: int = 1) -> None:
        """Adds finished steps."""
        self.reach(self.done + steps)

    def reach(self, done: int) -> None:
        """Sets the total number of finished steps."""
        self.done = done
        self.show(done)


class Bars:
    """Progress bars, one a task; without a display they show nothing."""

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress

    def task(self, label: str, total: int) -> Task:
        """Adds a bar."""
        progress = self._progress
        if progress is None:
            return Task()
        progress.start()
        number = progress.add_task(label, total=total)
        return Task(show=lambda done: progress.update(number, completed=done))

    def say(self, line: str) -> None:
        """Prints a line above the bars."""
        if self._progress is not None:
            self._progress.console.print(line, highlight=False, soft_wrap=True)


@contextmanager
def bars() -> Iterator[Bars]:
    """Shows bars while the block runs. Nothing is printed before the first task."""
    columns = (
        TextColumn("{task.description:<12}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    progress = Progress(*columns, console=Console(stderr=True, markup=False, emoji=False))
    try:
        yield Bars(progress)
    finally:
        if progress.live.is_started:
            progress.stop()
