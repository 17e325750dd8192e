import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles.tiling_serial import build_serial
from tsar.config import ConfigError, TilingConfig, TsarConfig, tiles_at_least, tiles_at_most
from tsar.tiling import build, tile_of_element, uniform


def config(**tiling):
    return TsarConfig(batch_size=16, tiling=TilingConfig(**tiling))


def field(seed, decades):
    generator = torch.Generator().manual_seed(seed)
    return 10.0 ** ((torch.rand(128 * 128, generator=generator, dtype=torch.float64) - 0.5) * decades)


def covers_once(tiling, field_level=7):
    first = tiling.index << 2 * (field_level - tiling.level)
    last = (tiling.index + 1) << 2 * (field_level - tiling.level)
    return bool(first[0] == 0) and bool(last[-1] == 4**field_level) and torch.equal(last[:-1], first[1:])


@given(st.integers(0, 10_000), st.floats(0.0, 12.0), st.integers(16, 1024))
def test_a_tiling_covers_the_image_once_within_its_bounds(seed, decades, most):
    cfg = config(tile_count_max=most, level_max=6)
    tiling = build(field(seed, decades), cfg)
    assert covers_once(tiling)
    assert 16 <= tiling.tile_count <= most
    assert cfg.level_min <= int(tiling.level.min()) and int(tiling.level.max()) <= cfg.level_max


@pytest.mark.parametrize("seed", range(5))
def test_against_the_serial_construction(seed):
    density = field(seed, 3) * 6
    density[1000:1400] *= 40
    cfg = config(tile_count_max=4096, level_max=6)
    tiling = build(density, cfg)
    expected = build_serial(density.tolist(), 2, 6, 256.0)
    assert list(zip(tiling.level.tolist(), tiling.index.tolist(), strict=True)) == expected


def test_a_full_batch_always_exists():
    tiling = build(torch.full((16384,), 1e-9, dtype=torch.float64), TsarConfig(batch_size=128))
    assert tiling.tile_count >= 128 and covers_once(tiling)


@pytest.mark.parametrize("level_min", [1, 2, 3])
def test_sizes_of_tilings_are_those_of_the_coarsest_one_and_its_splits(level_min):
    sizes = [4**level_min + 3 * splits for splits in range(100)]
    for count in range(sizes[0], 300):
        assert tiles_at_most(count, level_min) == max(size for size in sizes if size <= count)
    for count in range(1, 300):
        assert tiles_at_least(count, level_min) == min(size for size in sizes if size >= count)


@pytest.mark.parametrize("batch", [16, 17, 18, 19, 128, 130])
def test_the_least_bound_that_is_accepted_fills_the_batch(batch):
    """Whether the field asks for next to nothing or for more than there may be."""
    least = tiles_at_least(batch, 2)
    cfg = TsarConfig(batch_size=batch, tiling=TilingConfig(tile_count_max=least))
    for density in (1e-9, 1e3):
        assert build(torch.full((16384,), density, dtype=torch.float64), cfg).tile_count == least >= batch
    if least > 16:
        with pytest.raises(ConfigError, match=f"between {least} "):
            TsarConfig(batch_size=batch, tiling=TilingConfig(tile_count_max=least - 1))


def test_more_density_gives_smaller_tiles():
    density = torch.full((16384,), 0.25, dtype=torch.float64)
    density[: 16384 // 4] = 64.0  # the upper left quadrant
    tiling = build(density, config(tile_count_max=2048, level_max=6))
    inside = tiling.index << 2 * (7 - tiling.level) < 4096
    assert int(tiling.level[inside].min()) > int(tiling.level[~inside].max())


@pytest.mark.parametrize("side", [16, 32])
def test_a_tile_is_split_where_more_is_asked_for_than_a_framelet_holds(side):
    cfg = TsarConfig(batch_size=32, framelet_side=side)
    asked = torch.full((16384,), 64 * side**2 / 16384, dtype=torch.float64)  # 64 framelets in all
    assert build(asked, cfg).level.tolist() == [3] * 64
    asked[0] *= 1.01
    assert build(asked, cfg).level.tolist() == [4] * 4 + [3] * 63


def test_the_greatest_rate_is_that_of_the_finest_level():
    for rate in (1, 2, 4):
        cfg = TsarConfig(tiling=TilingConfig(rate_max=rate))
        assert 2**cfg.level_max * cfg.framelet_side == rate * cfg.resolution_px
    assert TsarConfig().level_max == TsarConfig(tiling=TilingConfig(rate_max=2)).level_max
    assert TsarConfig(resolution_px=1024, sdf_side=256, tiling=TilingConfig(rate_max=4)).level_max == 8


def test_bad_fields_are_refused():
    for value in (float("nan"), float("inf"), -1.0):
        with pytest.raises(ValueError, match="finite, non-negative"):
            build(torch.full((16384,), value, dtype=torch.float64), config())


def test_tile_of_element_inverts_coverage():
    tiling = build(field(3, 6), config())
    owner = tile_of_element(tiling, 7)
    assert owner.shape == (16384,) and torch.equal(torch.bincount(owner), 4 ** (7 - tiling.level))
    assert tile_of_element(uniform(7), 7).tolist() == list(range(16384))


def test_equal_nodes_split_all_over_the_image():
    """A uniform field that wants more tiles than allowed: every quadrant gets its share, not the first corner all."""
    tiling = build(torch.full((16384,), 8.0, dtype=torch.float64), config(tile_count_max=400, level_max=6))
    fine = tiling.index[tiling.level == 5] >> 8
    assert torch.bincount(fine, minlength=4).float().std() <= 8.0 and covers_once(tiling)
