"""Random configurations out of all that are accepted, each from a number."""

from __future__ import annotations

import random

from tsar.choices import SOLVERS
from tsar.config import (
    ConfigError,
    ErrorConfig,
    ReconstructionConfig,
    ResponseConfig,
    TilingConfig,
    TsarConfig,
    tiles_at_least,
)

_CACHED_SAMPLES_MOST = 5_000_000  # about 90 MB; a comparison holds it twice


def legal_configuration(number: int) -> TsarConfig:
    """An accepted configuration; every option takes part, most often far from its default, bounds included."""
    draw = random.Random(number)
    while True:
        try:
            config = _drawn(draw)
        except ConfigError:
            continue
        if config.cache_slots * config.samples <= _CACHED_SAMPLES_MOST:
            return config


def _drawn(draw: random.Random) -> TsarConfig:
    resolution = draw.choice((64, 64, 128, 128, 256))
    low = draw.choice((1, 1, 2, 2, 3, 4))
    high = draw.choice((0, low, low + 1, low + 2, low + 3))
    rate = 0 if high else draw.choice((0, 0, 1, 2, 4, 8))
    fine = 4 ** (high or 5)
    batch = min(round(2 ** draw.uniform(0.0, 9.0)), draw.choice((fine, 8192)))
    least = tiles_at_least(batch, low)
    bound = draw.choice((0, least, least, least + draw.randrange(1, 9), draw.randint(least, max(least, fine)), fine))
    return TsarConfig(
        batch_size=batch,
        resolution_px=resolution,
        framelet_side=draw.choice((16, 32)),
        sdf_side=draw.choice((16, 32, 64, 128, 256)),
        cache_size=batch + draw.choice((0, 1, 7, draw.randrange(2000))),
        seed=draw.randrange(2**31),
        warmup_cycles=0,
        tiling=TilingConfig(low, high, bound, draw.choice((0.0, 10.0 ** draw.uniform(0.0, 4.0))), rate),
        error=ErrorConfig(
            *(_one_of(draw, usual, -60.0, 60.0) for usual in (-7.0, -1.0, -9.0, -1.0)),
            norm=draw.choice(("l2", "linf")),
            form=draw.choice(("contrast", "difference")),
            octaves=draw.choice(("greatest", "sum")),
            extent=draw.choice(("tile", "element")),
            estimator=draw.choice(("dwt", "dwt", "dwt", "variance", "fft")),
        ),
        response=ResponseConfig(
            solver=draw.choice(("waterfill", "waterfill", *SOLVERS)),
            gain=draw.choice((1.0, 10.0 ** draw.uniform(-6.0, 6.0), 1e-6, 1e6)),
            bias=_one_of(draw, 0.0, -8.0, 8.0),
            surplus_max=draw.choice((0.0, 1.0, draw.random())),
            temporal_min=min(draw.choice((1 / 16, 10.0 ** draw.uniform(-6.0, 0.0), batch / 4**low)), 1.0),
        ),
        reconstruction=ReconstructionConfig(
            age_support_px=1 + 2 * draw.choice((0, 4, draw.randrange(resolution // 2)))
        ),
    )


def _one_of(draw: random.Random, usual: float, least: float, most: float) -> float:
    near = min(max(draw.uniform(usual - 8.0, usual + 8.0), least), most)
    return draw.choice((usual, usual, near, draw.uniform(least, most), least, most))
