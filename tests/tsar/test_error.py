import pytest
import torch

from tests.oracles import pictures
from tests.oracles.batches import make_batch
from tsar import haar
from tsar.cache import FrameletCache
from tsar.config import ErrorConfig, TsarConfig
from tsar.error import compressed_luminance, errors_of, estimate, replace_nonfinite, signed_error
from tsar.estimators import Bands, levelwise_power, state_size, template_power
from tsar.morton import interleave
from tsar.tiling import uniform

CONFIG = TsarConfig(batch_size=64)


def estimate_twice(picture, times=(0.0, 0.1), level=4, selected=range(64), config=CONFIG):
    cache = FrameletCache(config)
    for cycle, time_s in enumerate(times):
        batch = make_batch(uniform(level), torch.tensor(list(selected)), time_s, cycle, config)
        result = estimate(batch, pictures.tracer(picture)(batch).color, cache, config)
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


def bands_of(power, offset, slope, config=None, parts=64, samples=256):
    """Powers of all octaves, ``(octaves, n, parts)``, all known, beside a template."""
    known = torch.ones(power.shape[:2], dtype=torch.bool)
    return Bands(power, template_power(samples, parts, offset, slope, config or ErrorConfig()), known)


@pytest.mark.parametrize("octaves", ["sum", "greatest"])
@pytest.mark.parametrize("form", ["contrast", "difference"])
def test_the_error_lies_within_one_and_grows_with_power(form, octaves):
    config = ErrorConfig(form=form, octaves=octaves)
    power = torch.logspace(-8, 3, 30)[None, :, None].repeat(4, 1, 64)
    error = signed_error(bands_of(power, -8.0, -2.0), config)
    assert error.abs().max() <= 1.0 and bool((error[1:] >= error[:-1]).all())
    # Zero where the signal is the template itself.
    template = template_power(256, 64, -8.0, -2.0, config)[:, None, None].expand(4, 1, 64)
    assert float(signed_error(bands_of(template, -8.0, -2.0), config).abs().max()) < 1e-6


def test_a_steeper_template_is_more_sensitive():
    power = torch.full((4, 1, 64), 1e-3)
    for octaves in ("sum", "greatest"):
        config = ErrorConfig(octaves=octaves)
        errors = [float(signed_error(bands_of(power, -8.0, slope), config)[0, 0]) for slope in (-1.0, -3.0, -6.0, -9.6)]
        assert errors == sorted(errors) and errors[0] < errors[-1]


def test_slope_and_offset_are_one_parameter_only_of_sums():
    """Two templates of the same sum: signals of different shape tell them apart octave by octave."""
    flat, steep = (
        template_power(256, 64, offset, slope, ErrorConfig()) for offset, slope in ((-9.0, 0.0), (-5.0, -4.0))
    )
    steep = steep * flat.sum() / steep.sum()
    signal = flat.to(torch.float32)[:, None, None].expand(4, 1, 64)
    known = torch.ones(4, 1, dtype=torch.bool)
    for octaves, alike in (("sum", True), ("greatest", False)):
        found = [
            float(signed_error(Bands(signal, one, known), ErrorConfig(octaves=octaves))[0, 0]) for one in (flat, steep)
        ]
        assert (abs(found[0] - found[1]) < 1e-6) == alike


def test_only_octaves_that_have_been_measured_count():
    power = torch.tensor([1.0, 1e-9, 1e-9, 1e-9])[:, None, None].expand(4, 3, 1)
    known = torch.tensor([[True, False, False], [True, True, False], [True, True, False], [True, True, False]])
    for octaves in ("sum", "greatest"):
        found = signed_error(Bands(power, torch.full((4,), 1e-3), known), ErrorConfig(octaves=octaves)).flatten()
        assert found[0] > 0.9 and found[1] < -0.9 and found[2] == 0.0


def test_template_is_linear_in_log_power():
    config = ErrorConfig(norm="linf")
    log = torch.log2(template_power(256, 64, -5.0, -3.0, config))
    assert log.tolist() == [-14.0, -11.0, -8.0, -5.0]


@pytest.mark.parametrize("parts", [1, 4, 64])
def test_a_template_of_a_part_is_what_the_norm_makes_of_its_coefficients(parts):
    """As many of the template's power as a part has positions of the octave, or its share of one."""
    log = torch.log2(template_power(256, parts, -5.0, -3.0, ErrorConfig())) - torch.tensor([-14.0, -11.0, -8.0, -5.0])
    assert torch.exp2(log).tolist() == [64 / parts, 16 / parts, 4 / parts, 1 / parts]


@pytest.mark.parametrize("octaves", ["sum", "greatest"])
@pytest.mark.parametrize("form", ["contrast", "difference"])
@pytest.mark.parametrize("norm", ["l2", "linf"])
def test_every_template_gives_finite_errors(form, norm, octaves):
    """Whatever slope and offset: no power is the least error, and beyond what float32 holds all signals are alike."""
    config = ErrorConfig(form=form, norm=norm, octaves=octaves)
    power = torch.tensor([0.0, 1e-45, 1e-9, 1.0, 12.0])[None, :, None].repeat(5, 1, 1) / 5
    for offset in (-60.0, 0.0, 60.0):
        for slope in (-60.0, -45.0, 0.0, 45.0, 60.0):
            for count in (4, 5):
                bands = bands_of(power[:count], offset, slope, config, 1, 4**count)
                error = signed_error(bands, config).flatten()
                assert bool(torch.isfinite(error).all()) and error.abs().max() <= 1.0
                assert error[0] == -1.0 or (form == "difference" and offset + 4 * slope < -100)
    assert float(signed_error(bands_of(power, 60.0, 60.0, config, 1, 1024), config).max()) == -1.0
    assert (
        float(signed_error(bands_of(power, -60.0, -60.0, config, 1, 1024), config)[2:].min()) > 0.99
        or form == "difference"
    )


def test_levelwise_norm_uses_six_octants_and_spreads_shares():
    names = ("ghh", "hgh", "ggh", "hhg", "ghg", "hgg", "ggg")
    known = torch.tensor([True])
    fine = haar.Octave(**{name: torch.full((1, 4), float(2**i)) for i, name in enumerate(names)}, known=known)
    coarse = haar.Octave(**{name: torch.full((1, 1), 1.0) for name in names}, known=known)
    spatial, temporal = levelwise_power([fine, coarse], 4, ErrorConfig())
    assert spatial[0, 0].tolist() == [1 + 4 + 16] * 4 and temporal[0, 0].tolist() == [64 + 256 + 1024] * 4
    assert spatial[1, 0].tolist() == [0.75] * 4
    spatial, _ = levelwise_power([fine, coarse], 4, ErrorConfig(norm="linf"))
    assert spatial[0, 0].tolist() == [16.0] * 4 and spatial[1, 0].tolist() == [1.0] * 4
    fine.ghh[0, 2] = 8.0
    for norm, expected in (("l2", [4 * 21 + 63, 3.0]), ("linf", [64.0, 1.0])):
        spatial, _ = levelwise_power([fine, coarse], 1, ErrorConfig(norm=norm))
        assert spatial[:, 0, 0].tolist() == expected, "all coefficients of the tile"


def test_power_is_summed_before_it_is_compared():
    """Half a tile is full of detail and half of it plain: the error is that of the mean power, not the mean error."""
    signal = torch.full((1, 256), 0.5)
    signal[0, :128] += 0.2 * torch.tensor([1.0, -1.0, -1.0, 1.0]).repeat(32)
    none, past = torch.zeros(1, state_size(256, ErrorConfig())), torch.tensor([False])
    tile, element = (errors_of(signal, none, past, 64, ErrorConfig(extent=e))[0][0, 0] for e in ("tile", "element"))
    assert tile.shape == (1,) and element.shape == (64,)
    assert element[:32].min() > 0.9 and element[32:].max() == -1.0 and abs(float(element.mean())) < 0.1
    assert tile[0] > 0.9, "of half the power"


@pytest.mark.parametrize("extent", ["tile", "element"])
@pytest.mark.parametrize("level", [2, 3, 4, 5, 6])
def test_errors_cover_exactly_the_tile_at_every_level(level, extent):
    config = TsarConfig(batch_size=16, error=ErrorConfig(extent=extent))
    result, _ = estimate_twice(pictures.static_stripes, times=(0.0,), level=level, selected=[1], config=config)
    elements, field = 4 ** (7 - level), result.errors.spatial
    assert not field[:elements].any() and bool((field[elements : 2 * elements] != 0).all())
    assert not field[2 * elements :].any()
    assert (field[elements : 2 * elements].unique().numel() == 1) == (extent == "tile")


def test_luminance_is_rec709_and_bounded():
    color = torch.tensor([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [1e30, 1e30, 1e30], [-1, -1, -1]])
    y = compressed_luminance(color)
    expected = torch.tensor([0.2126, 0.7152, 0.0722, 1.0])
    assert torch.allclose(y[:4], torch.sqrt(expected / (1 + expected)), atol=1e-6)
    assert y[4] <= 1.0 and y[5] == 0.0


def test_one_firefly_does_not_saturate_a_tile():
    color = torch.full((1, 256, 3), 0.4)
    color[0, 77] = 1e6
    config = ErrorConfig(-8.0, -2.0)
    signal, none = compressed_luminance(color), torch.zeros(1, state_size(256, config))
    error = errors_of(signal, none, torch.tensor([False]), 64, config)[0][0, 0]
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
