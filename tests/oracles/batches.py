"""Batches made by hand: chosen tiles of a tiling at one time."""

from torch import Tensor

from tsar.config import TsarConfig
from tsar.selection import sample_positions
from tsar.types import FrameletBatch, Tiling


def make_batch(tiling: Tiling, selected: Tensor, time_s: float, cycle: int, config: TsarConfig) -> FrameletBatch:
    """What the renderer is asked for when these tiles are due."""
    level, index = tiling.level[selected], tiling.index[selected]
    position = sample_positions(level, index, config.framelet_side)
    return FrameletBatch(level, index, position, time_s, cycle=cycle, seed=config.seed)
