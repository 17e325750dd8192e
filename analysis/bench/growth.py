"""Group growth: the growth of cost with the batch, the picture and the tiling, and of memory with time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from multiprocessing import get_context
from statistics import median
from typing import TYPE_CHECKING

import torch

from analysis.bench.cycles import RunningPipeline, Tilings, cycles, default_stages, steady, synthetic_trace
from analysis.bench.options import BenchOptions
from analysis.bench.rows import Row, limit_row, limited_row
from analysis.bench.scenes import driving_scenes, renderer_of
from analysis.command.cli import InputError
from analysis.command.timing import take_turns
from tsar.config import TilingConfig, TsarConfig

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from analysis.command.progress import Bars, Task

EXPONENT_LIMIT = 1.05
PEAK_LIMIT = 1.02
"""Peak memory of a whole run over that of its first tenth."""

BATCHES = (16, 32, 64, 128, 256, 512)
SIDES_PX = (256, 512, 1024, 2048)
TILE_BOUNDS = (512, 1024, 2048, 4096, 8192)
_MEMORY_EVERY = 20


def growth(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """All rows of the group."""
    task = bars.task("growth", 3 * options.repetitions)
    yield batch_row(options, task)
    yield picture_row(options, task)
    yield tiling_row(options, task)
    yield from memory_rows(options, bars.task("memory", options.cycles))


def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float:
    """Exponent of the growth of seconds with size: the slope of the least-squares line through their logarithms."""
    x, y = [math.log(size) for size in sizes], [math.log(value) for value in seconds]
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    rise = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True))
    return rise / sum((a - mean_x) ** 2 for a in x)


def exponent_row(
    name: str,
    sizes: Sequence[float],
    rounds: Sequence[Sequence[float]],
    order: Callable[[float], float] = lambda n: 1.0,
) -> Row:
    """A growth exponent against its limit.

    Args:
        name: of the row.
        sizes: the sizes ``n``, ascending.
        rounds: seconds of every round, of each size.
        order: function of ``n`` that divides the seconds before the fit, such as ``log n``.

    Returns:
        The row; its ratio is the growth allowed over the growth measured when the size doubles, which is meaningful
        where an exponent is zero or below.
    """
    note = ", ".join(
        f"{size:,.0f}: {1e3 * median(seconds):.3g} ms" for size, seconds in zip(sizes, rounds, strict=True)
    )
    scaled = [[value / order(size) for value in seconds] for size, seconds in zip(sizes, rounds, strict=True)]
    found = [exponent(sizes, seconds) for seconds in zip(*scaled, strict=True)]
    row = Row("growth", name, "exponent", 0.0, "limit", note=note)
    return limited_row(row, found, EXPONENT_LIMIT, [2.0 ** (EXPONENT_LIMIT - value) for value in found])


def batch_row(options: BenchOptions, task: Task) -> Row:
    """Cycle time against batch size on the first scene."""
    scene = next(iter(driving_scenes(options).values()))
    renderer = renderer_of(scene, options)
    side = options.resolution_px
    sizes = [size for size in BATCHES if size <= (side // 16) ** 2]
    cases = {
        str(size): RunningPipeline(steady(TsarConfig(batch_size=size, resolution_px=side)), renderer.trace)
        for size in sizes
    }
    take_turns(cases, options.repetitions, task)
    renderer.close()
    rounds = [[median(sum(taken.values()) for taken in turn) for turn in case.turns()] for case in cases.values()]
    return exponent_row(f"cycle against batch, {scene.name}", sizes, rounds)


def picture_row(options: BenchOptions, task: Task) -> Row:
    """Reconstruction time against pixels, for pictures of moving ripples."""
    configs = [steady(TsarConfig(batch_size=options.batch_size, resolution_px=side)) for side in SIDES_PX]
    cases = {
        str(config.resolution_px): RunningPipeline(config, synthetic_trace, cycles_per_turn=2) for config in configs
    }
    take_turns(cases, options.repetitions, task)
    rounds = [[median(taken["reconstruction"] for taken in turn) for turn in case.turns()] for case in cases.values()]
    return exponent_row("reconstruction against pixels", [side**2 for side in SIDES_PX], rounds)


def tiling_row(options: BenchOptions, task: Task) -> Row:
    """Tiling time over ``log n`` against the bound ``n`` on the tiles: an exponent of 1 is ``n log n``."""
    generator = torch.Generator().manual_seed(0)
    config = TsarConfig(resolution_px=2048)
    field = torch.exp(2.0 * torch.randn(config.sdf_side**2, generator=generator, dtype=torch.float64))
    # densities ask for more tiles than any bound allows, so every bound is reached
    field *= 4.0 * max(TILE_BOUNDS) * config.samples / field.sum()
    configs = [TsarConfig(resolution_px=2048, tiling=TilingConfig(tile_count_max=bound)) for bound in TILE_BOUNDS]
    cases = {str(found.tile_count_max): Tilings(found, field) for found in configs}
    take_turns(cases, options.repetitions, task)
    rounds = [case.seconds[1:] for case in cases.values()]
    return exponent_row("tiling over log n against its bound n", TILE_BOUNDS, rounds, math.log)


def memory_rows(options: BenchOptions, task: Task) -> Iterator[Row]:
    """Resident memory of a pipeline in a process of its own."""
    config = TsarConfig(batch_size=options.batch_size, resolution_px=options.resolution_px)
    before, resident = watched(config, options.cycles, task)
    early = max(resident[: max(1, len(resident) // 10)])
    peak = max(resident)
    note = f"{early / 2**20:.1f} MiB in the first tenth, {peak / 2**20:.1f} MiB in all"
    name = f"peak memory of {options.cycles:,} cycles over that of their first tenth"
    yield limit_row(Row("growth", name, "ratio", 0.0, "limit", note=note), [peak / early], PEAK_LIMIT)
    megapixels = config.resolution_px**2 / 1e6
    note = f"beyond the {before / 2**20:.0f} MiB of libraries and kernels; cache of {config.cache_slots} framelets"
    yield Row(
        "growth",
        f"peak memory of a pipeline at {config.resolution_px}²",
        "MB per output megapixel",
        (peak - before) / 1e6 / megapixels,
        less_is_better=True,
        note=note,
    )


def watched(config: TsarConfig, count: int, task: Task) -> tuple[int, list[int]]:
    """Resident bytes before the pipeline is built, and at regular numbers of cycles of a run past its warm-up.

    The first is taken with libraries and kernels loaded. A new process measures them, because this one holds
    other data.
    """
    context = get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_watch, args=(sender, config, count), daemon=True)
    process.start()
    sender.close()
    found = []
    try:
        while len(found) < 1 + count // _MEMORY_EVERY:
            found.append(receiver.recv())
            task.reach((len(found) - 1) * _MEMORY_EVERY)
    except EOFError:
        raise InputError("growth: the process whose memory is watched ended early") from None
    finally:
        process.terminate()
        process.join()
    return found[0], found[1:]


def _watch(sender: Connection, config: TsarConfig, count: int) -> None:
    import signal

    import psutil

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends it
    resident = psutil.Process().memory_info
    default_stages(TsarConfig(batch_size=16, resolution_px=64))  # loads libraries and kernels, the same for all sizes
    sender.send(resident().rss)
    config = steady(config)
    for record in islice(cycles(config, synthetic_trace), config.warmup_cycles + count):
        if record.cycle >= 0 and (record.cycle + 1) % _MEMORY_EVERY == 0:
            sender.send(resident().rss)
    sender.close()
