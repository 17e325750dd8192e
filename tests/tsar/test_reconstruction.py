import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles import pictures
from tests.oracles.batches import make_batch
from tests.oracles.reconstruction_slow import slow_reconstruct
from tsar.cache import EMPTY, FrameletCache
from tsar.config import ReconstructionConfig, TilingConfig, TsarConfig
from tsar.reconstruction import newest_samples, reconstruct, round_bits, smooth_age, spatial_weights
from tsar.tiling import build, uniform


def config(support=9, resolution=64, level_max=4, **more):
    tiling = TilingConfig(level_min=1, level_max=level_max, tile_count_max=4**level_max)
    return TsarConfig(
        batch_size=4,
        resolution_px=resolution,
        cache_size=512,
        tiling=tiling,
        reconstruction=ReconstructionConfig(support),
        **more,
    )


def fill(cache, cfg, tiling, picture, time_s, selected=None):
    selected = torch.arange(tiling.tile_count) if selected is None else torch.tensor(selected)
    batch = make_batch(tiling, selected, time_s, 0, cfg)
    color = pictures.tracer(picture)(batch).color
    cache.insert(batch, color, torch.zeros(len(selected), 481))
    return [(int(lv), int(ix), time_s, c) for lv, ix, c in zip(batch.level, batch.index, color, strict=True)]


def mixed_cache(cfg):
    """Tiles of four levels and four ages, overlapping."""
    cache = FrameletCache(cfg)
    framelets = fill(cache, cfg, uniform(1), pictures.textured_motion, 0.0)
    framelets += fill(cache, cfg, uniform(2), pictures.textured_motion, 0.1, [0, 5, 6, 11])
    framelets += fill(cache, cfg, uniform(3), pictures.textured_motion, 0.2, [3, 9, 21, 22, 60])
    framelets += fill(cache, cfg, uniform(4), pictures.textured_motion, 0.3, [12, 13, 90, 255])
    return cache, framelets


@pytest.mark.parametrize("support", [1, 5])
def test_against_the_slow_definition(support):
    cfg = config(support, level_max=4)
    cache, framelets = mixed_cache(cfg)
    image = reconstruct(cache, cfg, 0.05).image
    x, y = torch.randint(0, 64, (2, 250), generator=torch.Generator().manual_seed(0)).tolist()
    expected = slow_reconstruct(framelets, 64, 16, support, 0.05, list(zip(x, y, strict=True)))
    assert torch.allclose(image[y, x].to(torch.float64), expected, atol=2e-4)


def test_a_constant_picture_is_reproduced_exactly_enough():
    cfg = config()
    cache = FrameletCache(cfg)
    density = torch.rand(16384, dtype=torch.float64, generator=torch.Generator().manual_seed(2)) ** 4
    fill(cache, cfg, build(density, cfg), pictures.constant, 0.0)
    assert torch.allclose(reconstruct(cache, cfg, 0.1).image, torch.full((64, 64, 3), 0.4), atol=1e-6)


def test_a_linear_ramp_survives_the_borders_between_tiles_of_one_size():
    cfg = config()

    def ramp(x, y, t):
        return torch.stack((x, y, 0.5 * (x + y)), dim=-1)

    cache = FrameletCache(cfg)
    fill(cache, cfg, uniform(1), ramp, 0.0)
    image = reconstruct(cache, cfg, 0.1).image
    centre = (torch.arange(64) + 0.5) / 64
    inner = slice(2, 62)  # within half a sample of the image's edge there is nothing to interpolate towards
    assert torch.allclose(image[inner, inner, 0], centre[None, inner].expand(60, 60), atol=1e-5)
    assert torch.allclose(image[inner, inner, 1], centre[inner, None].expand(60, 60), atol=1e-5)


def test_finer_tiles_than_pixels_are_box_filtered():
    cfg = config(support=1)
    cache = FrameletCache(cfg)
    fill(cache, cfg, uniform(3), pictures.static_stripes, 0.0)
    image = reconstruct(cache, cfg, 0.1).image
    grid = (torch.arange(128) + 0.5) / 128
    fine = pictures.static_stripes(grid[None].expand(128, 128), grid[:, None].expand(128, 128), None)
    box = fine.reshape(64, 2, 64, 2, 3).mean((1, 3))
    assert torch.allclose(image, box, atol=1e-5)


def test_age_smoothing_only_makes_older():
    newest = torch.randn(16, 16, generator=torch.Generator().manual_seed(0))
    pixels = smooth_age(newest, 64, 1)
    for support in (3, 9, 17):
        smoothed = smooth_age(newest, 64, support)
        assert bool((smoothed <= pixels).all())
        margin = support // 2
        padded = torch.nn.functional.pad(pixels[None, None], (margin,) * 4, mode="replicate")
        box = torch.nn.functional.avg_pool2d(padded, support, stride=1)[0, 0]
        assert torch.allclose(smoothed, torch.minimum(pixels, box), atol=1e-5)
    step = torch.zeros(8, 8)
    step[:, 4:] = 1.0
    smoothed = smooth_age(step, 32, 9)
    assert not smoothed[:, :16].any() and 0 < smoothed[0, 17] < 1 and smoothed[0, 25] == 1.0


def test_the_newest_samples_win_where_ages_are_even():
    cfg = config(support=1)
    cache = FrameletCache(cfg)
    edge = pictures.moving_edge(speed=0.5, start=0.1)
    for time_s in (0.0, 0.5, 1.0):
        fill(cache, cfg, uniform(2), edge, time_s)
    image = reconstruct(cache, cfg, 0.01).image
    assert bool((image[:, :38] > 0.85).all()) and bool((image[:, 40:] < 0.15).all())
    assert int(cache.dead[cache.level != EMPTY].sum()) == 32, "the two older layers can never be seen again"


def test_the_map_of_samples_holds_the_age_and_level_of_the_newest():
    cfg = config()
    cache = FrameletCache(cfg)
    fill(cache, cfg, uniform(2), pictures.constant, 0.0)
    fill(cache, cfg, uniform(3), pictures.constant, 1.0, [0])
    fill(cache, cfg, uniform(3), pictures.constant, -1.0, [63])
    found = newest_samples(cache, cfg)
    part = found.level.shape[0] // 8
    fresh = torch.zeros_like(found.level, dtype=torch.bool)
    fresh[:part, :part] = True
    assert bool((found.level == torch.where(fresh, 3, 2)).all())
    assert bool((found.newest_s == torch.where(fresh, 1.0, 0.0).to(torch.float64)).all())


def test_nothing_cached_and_half_cached_give_no_hole_and_no_nan():
    cfg = config()
    cache = FrameletCache(cfg)
    empty = reconstruct(cache, cfg, 0.1).image
    assert bool((empty == 0).all())
    fill(cache, cfg, uniform(2), pictures.constant, 0.0, [0, 7])
    image = reconstruct(cache, cfg, 0.1).image
    assert bool(torch.isfinite(image).all()) and image.min() > 0.39
    assert not torch.isfinite(newest_samples(cache, cfg).newest_s).all()


@given(seed=st.integers(0, 10_000), support=st.sampled_from([1, 5, 33]), cycle_s=st.sampled_from([1e-4, 0.05, 10.0]))
def test_any_cache_gives_an_image_within_the_range_of_its_samples(seed, support, cycle_s):
    """Random tilings, random parts of them, random times, more than the cache holds: no hole, no NaN, no overshoot."""
    cfg = config(support)
    cache, g = FrameletCache(cfg), torch.Generator().manual_seed(seed)
    for _ in range(4):
        tiling = build(torch.rand(256, generator=g, dtype=torch.float64).repeat_interleave(64) ** 4, cfg)
        count = 1 + tiling.tile_count * (seed % 3) // 2
        chosen = torch.randperm(tiling.tile_count, generator=g)[:count].sort().values
        batch = make_batch(tiling, chosen, float(torch.rand((), generator=g)), 0, cfg)
        color = 0.2 + 0.6 * torch.rand(len(chosen), 256, 3, generator=g)
        cache.insert(batch, color, torch.zeros(len(chosen), 481))
        image = reconstruct(cache, cfg, cycle_s).image
        assert bool(torch.isfinite(image).all()) and 0.2 - 1e-5 <= image.min() and image.max() <= 0.8 + 1e-5


@given(st.integers(0, 10_000), st.sampled_from([3, 9, 33]))
def test_smoothing_twelve_decades_of_age_is_one_sided(seed, support):
    g = torch.Generator().manual_seed(seed)
    newest = -(10.0 ** (12 * torch.rand(8, 8, generator=g) - 6)).clamp(max=1e6)
    assert bool((smooth_age(newest, 64, support) <= smooth_age(newest, 64, 1)).all())


@pytest.mark.parametrize("spacing", [2, 4, 8, 16])
def test_interpolation_is_exact_but_for_one_rounding(spacing):
    """Products of rounded samples with the weights are exact, so no order of addition, nor fusing, can show."""
    bits = 24 - spacing.bit_length()
    sample = round_bits(10.0 ** (8 * torch.rand(64, 16, generator=torch.Generator().manual_seed(0)) - 4), bits)
    weights, _ = spatial_weights(16, 16 * spacing)
    unit = weights / weights.sum(1, keepdim=True)
    product = sample[:, None, :] * unit
    assert torch.equal(product.double(), sample.double()[:, None, :] * unit.double())
    assert torch.equal(sample @ unit.T, (sample.double() @ unit.T.double()).float())
    relative = (round_bits(sample * 1.37, bits) / (sample * 1.37) - 1).abs()
    assert float(relative.max()) <= 2.0**-bits


def test_interpolation_and_smoothing_do_not_depend_on_the_thread_count():
    """The size of a default image, where matrix products are shared out."""
    g = torch.Generator().manual_seed(6)
    samples, age = round_bits(torch.rand(300, 3, 16, 16, generator=g), 22), -100 * torch.rand(64, 64, generator=g)
    weights, _ = spatial_weights(16, 32)
    unit = weights / weights.sum(1, keepdim=True)
    before, results = torch.get_num_threads(), []
    try:
        for threads in (1, 2, 3, 4, 7):
            torch.set_num_threads(threads)
            results.append((round_bits(unit @ samples, 22) @ unit.T, smooth_age(age, 512, 129)))
    finally:
        torch.set_num_threads(before)
    for other in results[1:]:
        assert torch.equal(other[0], results[0][0]) and torch.equal(other[1], results[0][1])


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_same_cache_gives_the_same_bits_for_any_thread_count(threads):
    cfg = config()
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(1)
        expected = reconstruct(mixed_cache(cfg)[0], cfg, 0.05).image
        torch.set_num_threads(threads)
        assert torch.equal(reconstruct(mixed_cache(cfg)[0], cfg, 0.05).image, expected)
    finally:
        torch.set_num_threads(before)
