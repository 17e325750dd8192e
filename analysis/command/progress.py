"""Progress bars with the time left, on standard error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


class Bars:
    """Bars, one a task."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def task(self, label: str, total: int) -> Callable[[int], None]:
        """Adds a bar; returns a function that takes how much is done."""
        self._progress.start()
        number = self._progress.add_task(label, total=total)
        return lambda done: self._progress.update(number, completed=done)

    def say(self, line: str) -> None:
        """Prints a line above the bars."""
        self._progress.console.print(line, highlight=False, soft_wrap=True)


@contextmanager
def bars() -> Iterator[Bars]:
    """Shows bars while the block runs, from the first one on: without any, nothing is printed."""
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
