"""A framelet cache's tensors for native code: they are checked once, and launches on them are recorded once."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary

import torch
from torch import Tensor

from renderer.compute.launching import address
from tsar.cache import FrameletCache
from tsar.config import TsarConfig
from tsar.estimators import state_size
from tsar.morton import first_node

_TENSORS = "level", "index", "time_s", "dead", "color", "coefficients", "slot_of_node"

Recorded = TypeVar("Recorded")


def point_at_cache(view: Any, cache: FrameletCache, config: TsarConfig) -> None:
    """Sets those fields of a kernel's record that are addresses of a cache's tensors, and its number of slots.

    Raises:
        ValueError: if a tensor does not match the cache of this configuration.
    """
    slots, samples = config.cache_slots, config.samples
    expected = {
        "level": (torch.int64, slots),
        "index": (torch.int64, slots),
        "time_s": (torch.float64, slots),
        "dead": (torch.bool, slots),
        "color": (torch.float32, slots * samples * 3),
        "coefficients": (torch.float32, slots * state_size(samples, config.error)),
        "slot_of_node": (torch.int64, first_node(config.level_max + 1)),
    }
    view.slots = slots
    for name, (dtype, count) in expected.items():
        if hasattr(view, name):
            setattr(view, name, address(f"cache.{name}", getattr(cache, name), dtype, count))


class PerCache(Generic[Recorded]):
    """Records per cache, created once, and again if a tensor of the cache has been replaced."""

    def __init__(self, record: Callable[[FrameletCache], Recorded]) -> None:
        self._record = record
        self._kept: WeakKeyDictionary[FrameletCache, tuple[tuple[Tensor, ...], Recorded]] = WeakKeyDictionary()

    def __call__(self, cache: FrameletCache) -> Recorded:
        """The record of a cache."""
        tensors, kept = _tensors_of(cache), self._kept.get(cache)
        if kept is None or not all(map(operator.is_, kept[0], tensors)):
            kept = self._kept[cache] = tensors, self._record(cache)
        return kept[1]


_tensors_of: Callable[[FrameletCache], tuple[Tensor, ...]] = operator.attrgetter(*_TENSORS)
