"""The framelet cache: colours, times and wavelet coefficients of recent framelets.

The one object of the pipeline that changes in place. Its replacement policy needs no knowledge of the picture beyond
the flags that reconstruction leaves behind: framelets older than the age field everywhere in their extent are *dead*
and are replaced first, from the oldest on; then the oldest of the others are.

Source: Stephens 2011, sec. 3.4.4.4.
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from tsar.config import TsarConfig
from tsar.estimators import state_size
from tsar.morton import node_number
from tsar.types import FrameletBatch

EMPTY = -1


class FrameletCache:
    """A fixed number of slots for framelets.

    Attributes:
        color: ``(slots, samples, 3)`` float32, Morton order.
        coefficients: ``(slots, state)`` float32, the state that the error estimator keeps of each framelet.
        level, index: tile of each slot; level is ``EMPTY`` in an unused one.
        time_s: animation time of each slot, ``-inf`` in an unused one.
        slot_of_node: slot of the newest framelet of each quadtree node, coarser levels first; ``EMPTY`` where there is
            none.
        dead: set by reconstruction; a dead framelet can never contribute again, because the age field never becomes
            older.
    """

    def __init__(self, config: TsarConfig) -> None:
        slots, samples = config.cache_slots, config.samples
        self.level_max = config.level_max
        self.color = torch.zeros(slots, samples, 3)
        self.coefficients = torch.zeros(slots, state_size(samples, config.error))
        self.level = torch.full((slots,), EMPTY, dtype=torch.int64)
        self.index = torch.zeros(slots, dtype=torch.int64)
        self.time_s = torch.full((slots,), -torch.inf, dtype=torch.float64)
        self.dead = torch.ones(slots, dtype=torch.bool)
        self.slot_of_node = torch.full((node_number(self.level_max + 1, 0),), EMPTY, dtype=torch.int64)

    def previous(
        self, level: Int64[Tensor, " n"], index: Int64[Tensor, " n"]
    ) -> tuple[Float[Tensor, "n state"], Bool[Tensor, " n"]]:
        """Wavelet state of the newest cached framelet of each tile, and whether there is one."""
        slot = self.slot_of_node[node_number(level, index)]
        return self.coefficients[slot.clamp(min=0)], slot != EMPTY

    def insert(
        self, batch: FrameletBatch, color: Float[Tensor, "n samples 3"], coefficients: Float[Tensor, "n state"]
    ) -> Int64[Tensor, " n"]:
        """Stores a batch in the least valuable slots and returns these slots. A tile may occur only once in a batch."""
        # Unused slots have time -inf and are dead, so they come first. Stable: ties go to the lower slot.
        by_age = torch.sort(self.time_s, stable=True).indices
        order = by_age[torch.sort(self.dead[by_age].to(torch.int8), descending=True, stable=True).indices]
        slot = torch.sort(order[: batch.level.shape[0]]).values
        self._forget(slot)
        self.color[slot] = color
        self.coefficients[slot] = coefficients
        self.level[slot] = batch.level
        self.index[slot] = batch.index
        self.time_s[slot] = batch.times[:, 0].to(torch.float64)
        self.dead[slot] = False
        self.slot_of_node[node_number(batch.level, batch.index)] = slot
        return slot

    def _forget(self, slot: Int64[Tensor, " n"]) -> None:
        """Drops the look-up entries that still point at these slots; a newer framelet of the tile may have taken the
        entry."""
        used = slot[self.level[slot] != EMPTY]
        node = node_number(self.level[used], self.index[used])
        self.slot_of_node[node[self.slot_of_node[node] == used]] = EMPTY
