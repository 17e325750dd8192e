"""Times cases in turns, so that changes in the machine's speed affect all cases alike."""

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
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, list[float]]:
    """Seconds of every case, ``repetitions`` times each, after one run that is not counted.

    Cases take turns, forwards and backwards, so that neither drift nor their order favours one of them.

    Args:
        cases: functions to time, by name.
        repetitions: turns of each.
        task: progress that advances by one step a round.
        rest_s: pause before each turn, seconds. Threads of the previous case may keep spinning for milliseconds.
        lead_in: each turn runs twice and the second run counts. A core that another case left idle is slow at first,
            and a renderer in use does not leave cores idle.
        clock: function that returns seconds; by default wall time.
    """
    for run in cases.values():
        run()
    seconds: dict[str, list[float]] = {name: [] for name in cases}
    for number in range(repetitions):
        for name in list(cases) if number % 2 == 0 else reversed(list(cases)):
            time.sleep(rest_s)
            if lead_in:
                cases[name]()
            start = clock()
            cases[name]()
            seconds[name].append(clock() - start)
        if task is not None:
            task.advance()
    return seconds
