"""Values of a cycle's record over the whole field."""

import torch

from tsar.accounting import Movement, account, movement
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


def test_elements_that_one_decision_drives_to_a_bound_are_counted():
    config = TsarConfig(batch_size=32, resolution_px=256)
    (low_s, high_s), (low_t, high_t) = config.spatial_bounds, config.temporal_bounds
    count = config.sdf_side**2
    before = Densities(torch.full((count,), 0.5 * high_s, dtype=torch.float64), torch.full((count,), 0.5).double())
    spatial, temporal = before.spatial.clone(), before.temporal.clone()
    spatial[0], temporal[1] = high_s, low_t  # from within to a bound
    spatial[2] = 0.6 * high_s  # within
    spatial[3], temporal[3] = low_s, high_t  # both at once: one element
    after = Densities(spatial, temporal)
    assert movement(before, after, config) == Movement(4, 3)
    assert movement(after, after, config) == Movement(0, 0)
    again = Densities(torch.where(spatial == high_s, 0.5 * high_s, spatial), temporal)
    assert movement(after, again, config) == Movement(1, 0), "away from a bound"
