"""What a cycle's record says of the whole field."""

import torch

from tsar.accounting import account
from tsar.config import TsarConfig
from tsar.morton import raster_to_morton
from tsar.types import Densities, Errors


def spread(elements):
    """Spread of ages where elements ``{raster number: (temporal density, newest sample in seconds)}`` stand out of a
    field that is refreshed seldom and shows what is old."""
    config = TsarConfig(batch_size=32, resolution_px=256)
    count = config.sdf_side**2
    temporal, newest = torch.full((count,), 0.01, dtype=torch.float64), torch.full((count,), -99.0, dtype=torch.float64)
    order = raster_to_morton(config.sdf_side)
    for number, (density, time_s) in elements.items():
        temporal[order[number]], newest[number] = density, time_s
    errors = Errors(torch.zeros(count), torch.zeros(count))
    side = config.sdf_side
    return account(Densities(torch.ones_like(temporal), temporal), errors, newest.reshape(side, side), config)


def test_elements_refreshed_every_second_cycle_count_as_moving_and_slower_ones_do_not():
    assert spread({0: (1.0, 1.0), 1: (0.5, 0.75)}).age_spread_s == 0.25
    assert spread({0: (1.0, 1.0), 1: (0.5, 0.75), 2: (0.499, 0.25), 3: (0.26, 0.0)}).age_spread_s == 0.25
    assert spread({0: (0.499, 1.0), 1: (0.4, 0.75)}).age_spread_s == 0.0


def test_elements_that_show_nothing_yet_have_no_age():
    assert spread({0: (1.0, 1.0), 1: (1.0, -float("inf")), 2: (1.0, 0.5)}).age_spread_s == 0.5
