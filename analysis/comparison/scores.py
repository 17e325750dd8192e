"""Metrics of sequences of all runs of a comparison."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np
import torch

from analysis.comparison.options import RunOptions
from analysis.metrics import METRICS
from tsar.memory import core_count
from tsar.threads import one_thread

if TYPE_CHECKING:
    from analysis.study.displays import DisplayRecord


def scores(
    metric: str, seen: Mapping[str, DisplayRecord], options: RunOptions, advance: Callable[[], object]
) -> dict[str, float]:
    """A metric of sequences for every run, as many runs at a time as there are threads.

    Args:
        metric: its name; it is called from several threads.
        seen: what the displays showed, by run, with their kept images.
        options: of the comparison.
        advance: called after every run.
    """

    def score(one: DisplayRecord) -> float:
        shown, reference = (np.stack(frames) for frames in one.frames)
        return METRICS[metric].of_sequence(shown, reference, options.reference_rate_hz, options.display)

    found: dict[str, float] = {}
    count = options.threads or core_count()
    with one_thread(), ThreadPoolExecutor(count, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        for name, value in zip(seen, pool.map(score, seen.values()), strict=True):
            found[name] = value
            advance()
    return found
