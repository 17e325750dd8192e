import pytest
import torch

from tests.oracles import pictures
from tests.oracles.batches import make_batch
from tsar import haar
from tsar.cache import FrameletCache
from tsar.config import ErrorConfig, TsarConfig
from tsar.error import (
    compressed_luminance,
    estimate,
    levelwise_power,
    replace_nonfinite,
    scatter_to_field,
    signed_error,
    template_power,
)
from tsar.morton import interleave
from tsar.tiling import uniform

CONFIG = TsarConfig(batch_size=64)


def estimate_twice(picture, times=(0.0, 0.1), level=4, selected=range(64)):
    cache = FrameletCache(CONFIG)
    for cycle, time_s in enumerate(times):
        batch = make_batch(uniform(level), torch.tensor(list(selected)), time_s, cycle, CONFIG)
        result = estimate(batch, pictures.tracer(picture)(batch).color, cache, CONFIG)
        cache.insert(batch, result.color, result.coefficients)
    return result, batch


def test_a_constant_image_is_oversampled_everywhere_in_the_batch_and_zero_outside():
    result, _ = estimate_twice(pictures.constant)
    inside = slice(0, 64 * 64)  # 64 tiles of level 4 cover 64 elements each, first on the curve
    assert bool((result.errors.spatial[inside] == -1.0).all()) and bool((result.errors.temporal[inside] == -1.0).all())
    assert not result.errors.spatial[64 * 64 :].any() and not result.errors.temporal[64 * 64 :].any()


def test_tiles_without_a_past_report_spatial_error_only():
    result, _ = estimate_twice(pictures.textured_motion, times=(0.0,))
    assert result.errors.spatial.any() and not result.errors.temporal.any()


def test_fine_stripes_are_undersampled_in_space_and_oversampled_in_time():
    result, _ = estimate_twice(pictures.static_stripes)
    inside = slice(0, 64 * 64)
    assert result.errors.spatial[inside].mean() > 0.5 and bool((result.errors.temporal[inside] == -1.0).all())


def test_a_moving_edge_is_localised_to_the_elements_it_crosses():
    edge = pictures.moving_edge(speed=0.5, start=0.1)
    result, _ = estimate_twice(edge, times=(0.0, 0.05))
    x, y = torch.meshgrid(torch.arange(128), torch.arange(128), indexing="xy")
    temporal = result.errors.temporal[interleave(x.reshape(-1), y.reshape(-1))].reshape(128, 128)
    crossed = temporal[:40, 13:16]  # between x = 0.100 and 0.125
    far = temporal[:40, 26:60]
    assert crossed.max() > 0.5 and bool((far == -1.0).all())


def test_the_error_lies_within_one_and_grows_with_power():
    power = torch.logspace(-8, 3, 30)[None, :, None].repeat(4, 1, 5)
    for form in ("contrast", "difference"):
        error = signed_error(power, -8.0, -2.0, ErrorConfig(form=form))
        assert error.abs().max() <= 1.0 and bool((error[1:] >= error[:-1]).all())
    # Zero where the signal is the template itself.
    template = template_power(4, -8.0, -2.0, ErrorConfig())[:, None, None]
    for form in ("contrast", "difference"):
        assert abs(float(signed_error(template, -8.0, -2.0, ErrorConfig(form=form)))) < 1e-6


def test_a_steeper_template_is_more_sensitive():
    power = torch.full((4, 1, 1), 1e-3)
    errors = [float(signed_error(power, -8.0, slope, ErrorConfig())) for slope in (-1.0, -3.0, -6.0, -9.6)]
    assert errors == sorted(errors) and errors[0] < errors[-1]


def test_template_is_linear_in_log_power():
    config = ErrorConfig(norm="linf")
    log = torch.log2(template_power(4, -5.0, -3.0, config))
    assert log.tolist() == [-14.0, -11.0, -8.0, -5.0]


@pytest.mark.parametrize("form", ["contrast", "difference"])
@pytest.mark.parametrize("norm", ["l2", "linf"])
def test_every_template_gives_finite_errors(form, norm):
    """Whatever slope and offset: no power is the least error, and beyond what float32 holds all signals are alike."""
    config = ErrorConfig(form=form, norm=norm)
    power = torch.tensor([0.0, 1e-45, 1e-9, 1.0, 12.0])[None, :, None].repeat(5, 1, 1) / 5
    for offset in (-60.0, 0.0, 60.0):
        for slope in (-60.0, -45.0, 0.0, 45.0, 60.0):
            for octaves in (4, 5):
                error = signed_error(power[:octaves], offset, slope, config).flatten()
                assert bool(torch.isfinite(error).all()) and error.abs().max() <= 1.0
                assert error[0] == -1.0 or (form == "difference" and offset + 4 * slope < -100)
    assert float(signed_error(power, 60.0, 60.0, config).max()) == -1.0
    assert float(signed_error(power, -60.0, -60.0, config)[2:].min()) > 0.99 or form == "difference"


def test_levelwise_norm_uses_six_octants_and_spreads_shares():
    names = ("ghh", "hgh", "ggh", "hhg", "ghg", "hgg", "ggg")
    fine = haar.Octave(**{name: torch.full((1, 4), float(2**i)) for i, name in enumerate(names)})
    coarse = haar.Octave(**{name: torch.full((1, 1), 1.0) for name in names})
    spatial, temporal = levelwise_power([fine, coarse], ErrorConfig())
    assert spatial[0, 0].tolist() == [1 + 4 + 16] * 4 and temporal[0, 0].tolist() == [64 + 256 + 1024] * 4
    assert spatial[1, 0].tolist() == [0.75] * 4
    spatial, _ = levelwise_power([fine, coarse], ErrorConfig(norm="linf"))
    assert spatial[0, 0].tolist() == [16.0] * 4 and spatial[1, 0].tolist() == [1.0] * 4


@pytest.mark.parametrize("level", [2, 3, 4, 5, 6])
def test_scatter_covers_exactly_the_tile_at_every_level(level):
    batch = make_batch(uniform(level), torch.tensor([1]), 0.0, 0, CONFIG)
    values = torch.arange(64.0)[None, None]
    field = scatter_to_field(values + 1, batch, CONFIG)[0]
    elements = 4 ** (7 - level)
    assert not field[:elements].any() and bool((field[elements : 2 * elements] > 0).all())
    assert not field[2 * elements :].any()
    assert abs(float(field[elements : 2 * elements].mean()) - 32.5) < 1e-6


def test_luminance_is_rec709_and_bounded():
    color = torch.tensor([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [1e30, 1e30, 1e30], [-1, -1, -1]])
    y = compressed_luminance(color)
    expected = torch.tensor([0.2126, 0.7152, 0.0722, 1.0])
    assert torch.allclose(y[:4], torch.sqrt(expected / (1 + expected)), atol=1e-6)
    assert y[4] <= 1.0 and y[5] == 0.0


def test_one_firefly_does_not_saturate_a_tile():
    color = torch.full((1, 256, 3), 0.4)
    color[0, 77] = 1e6
    octaves, _ = haar.transform(compressed_luminance(color), torch.zeros(1, 340), torch.tensor([False]))
    spatial, _ = levelwise_power(octaves, ErrorConfig())
    error = signed_error(spatial, -8.0, -2.0, ErrorConfig())[0]
    assert (error > 0).sum() <= 16 and error.median() < 0


def test_nonfinite_samples_are_counted_and_replaced_by_their_neighbours_mean():
    color = torch.rand(3, 256, 3, generator=torch.Generator().manual_seed(0))
    clean = color.clone()
    at = int(interleave(torch.tensor(5), torch.tensor(9)))
    color[1, at, 2] = float("nan")
    color[2] = float("inf")
    repaired, count = replace_nonfinite(color, 16)
    assert count == 257 and bool(torch.isfinite(repaired).all()) and not repaired[2].any()
    around = [(x, y) for x in (4, 5, 6) for y in (8, 9, 10) if (x, y) != (5, 9)]
    mean = torch.stack([clean[1, int(interleave(torch.tensor(x), torch.tensor(y)))] for x, y in around]).mean(0)
    assert torch.allclose(repaired[1, at], mean, atol=1e-6)
    assert torch.equal(repaired[0], clean[0])
    untouched, none = replace_nonfinite(clean, 16)
    assert none == 0 and untouched is clean


def test_radiance_near_the_end_of_float32_is_replaced_before_it_overflows():
    color = torch.full((2, 256, 3), 0.5)
    color[0, 40], color[1, 9, 1] = torch.finfo(torch.float32).max, -1e38
    repaired, count = replace_nonfinite(color, 16)
    assert count == 2 and torch.equal(repaired, torch.full_like(repaired, 0.5))
    assert bool(torch.isfinite(compressed_luminance(torch.full((1, 3), 1e30))).all())


def test_a_firefly_is_felt_in_its_own_framelet_only():
    def firefly(x, y, t):
        color = pictures.constant(x, y, t).clone()
        color[5, 100] = 1e6
        return color

    result, _ = estimate_twice(firefly)
    per_tile = result.errors.spatial.reshape(256, 64)
    assert bool((per_tile[5] > 0).any()) and bool(per_tile[5].median() < 0)
    assert bool((per_tile[:5] == -1.0).all()) and bool((per_tile[6:64] == -1.0).all())


def test_a_nan_from_the_renderer_does_not_spread():
    def broken(x, y, t):
        color = pictures.textured_motion(x, y, t)
        color[0, 3] = float("nan")
        return color

    result, _ = estimate_twice(broken)
    assert result.nonfinite == 1
    for tensor in (result.errors.spatial, result.errors.temporal, result.coefficients, result.color):
        assert bool(torch.isfinite(tensor).all())
