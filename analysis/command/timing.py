"""Wall seconds of cases that take turns, so that a machine's ups and downs fall on all alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.command.progress import Task


def take_turns(
    cases: Mapping[str, Callable[[], object]],
    repetitions: int,
    task: Task | None = None,
    rest_s: float = 0.0,
    lead_in: bool = False,
) -> dict[str, list[float]]:
    """Wall seconds of every case, ``repetitions`` times each, after one run that is not counted.

    Cases take turns, forwards and backwards, so that neither drift nor an order of precedence favours one.

    Args:
        cases: what is measured, by name.
        repetitions: turns of each.
        task: of which a step is a round.
        rest_s: pause before each turn. Threads of the case before may spin for milliseconds, waiting for more to do.
        lead_in: each turn runs twice and the second run counts: a core that another case left idle is slow to come
            back, and a renderer in use does not leave it idle.
    """
    for run in cases.values():
        run()
    seconds: dict[str, list[float]] = {name: [] for name in cases}
    for number in range(repetitions):
        for name in list(cases) if number % 2 == 0 else reversed(list(cases)):
            time.sleep(rest_s)
            if lead_in:
                cases[name]()
            start = time.perf_counter()
            cases[name]()
            seconds[name].append(time.perf_counter() - start)
        if task is not None:
            task.advance()
    return seconds
