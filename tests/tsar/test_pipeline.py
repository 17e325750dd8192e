from itertools import pairwise

import pytest
import torch

from tests.oracles import pictures, runs
from tsar.choices import SOLVERS
from tsar.clock import StageTimer, fixed_clock
from tsar.config import ConfigError, ReconstructionConfig, ResponseConfig, TilingConfig, TsarConfig
from tsar.morton import raster_to_morton
from tsar.types import SampleBatch

CYCLE = 1 / 60


def small(**more):
    return TsarConfig(batch_size=32, resolution_px=256, **{"warmup_cycles": 16, **more})


def play(config, picture, cycles, start_s=0.0):
    return list(
        runs.play("thesis", config, pictures.tracer(picture), fixed_clock(CYCLE), start_s, start_s + cycles * CYCLE)
    )


def element_grid(field, side=128):
    return field[raster_to_morton(side)].reshape(side, side)


def test_a_constant_image_has_no_error_and_asks_for_nothing():
    config = small()
    record, display = play(config, pictures.constant, 100)[-1]
    assert torch.allclose(display.image, torch.full((256, 256, 3), 0.4), atol=1e-6)
    # Nobody asks for density, so all of it goes into the surplus and is still accounted for.
    assert float(record.densities.temporal.max()) == pytest.approx(config.response.temporal_min)
    assert float(record.densities.spatial.max()) == pytest.approx(config.spatial_bounds[0])
    floor = 4**config.level_min * config.samples * config.response.temporal_min
    assert record.surplus == pytest.approx(config.budget - floor) and record.conservation_residual < 1e-9
    bounded = small(response=ResponseConfig(surplus_max=0.1))
    assert play(bounded, pictures.constant, 20)[-1][0].surplus == pytest.approx(0.1 * bounded.budget)


def test_a_static_scene_lets_temporal_density_fall_to_its_floor():
    """Fine static detail asks for space and frees time; the flat half frees both."""
    config = small()
    record, _ = play(config, pictures.static_stripes, 150)[-1]
    assert float(record.densities.temporal.max()) <= config.response.temporal_min * 1.01
    spatial = element_grid(record.densities.spatial)
    assert float(spatial[:, 8:56].median()) == pytest.approx(config.spatial_bounds[1])
    assert float(spatial[:, 72:].median()) == pytest.approx(config.spatial_bounds[0])


def test_density_gathers_on_a_moving_edge_and_follows_it():
    speed = 0.25
    config = small()
    records = [r for r, _ in play(config, pictures.moving_edge(speed, start=0.1), 120)]
    x = (torch.arange(128) + 0.5) / 128
    lag = mass = 0.0
    for record in records[-60:]:
        combined = element_grid(record.densities.combined()).mean(0)
        edge = 0.1 + speed * record.sim_time_s
        near = (x - edge).abs() < 0.06
        assert float(combined[near].mean()) > 2 * float(combined[(x - edge).abs() > 0.2].mean())
        temporal = element_grid(record.densities.temporal).mean(0)
        band = (temporal - 2 * temporal.median()).clamp(min=0.0)  # empty in a cycle in which all is at the floor
        lag += float((band * (edge - x)).sum())
        mass += float(band.sum())
    # The refreshed band trails the edge by no more than what it travels in a third of a second.
    assert abs(lag / mass) < speed / 3


def test_bounds_conservation_coverage_and_full_batches_on_every_cycle():
    config = small()
    low, high = config.spatial_bounds
    for record, display in play(config, pictures.textured_motion, 40):
        assert record.conservation_residual <= 1e-9
        d = record.densities
        assert low * (1 - 1e-12) <= float(d.spatial.min()) and float(d.spatial.max()) <= high * (1 + 1e-12)
        assert float(d.temporal.min()) >= config.response.temporal_min * (1 - 1e-12) and float(d.temporal.max()) <= 1.0
        assert float((0.25 ** record.tiling.level.to(torch.float64)).sum()) == 1.0
        assert record.selected.unique().numel() == config.batch_size
        assert bool(torch.isfinite(display.image).all())


def test_latency_is_three_cycles_and_two_frames():
    for record, display in play(small(), pictures.constant, 2):
        assert display.display_time_s - record.sim_time_s == pytest.approx(3 * CYCLE)
    frames = list(runs.images("framed", small(), pictures.tracer(pictures.constant), fixed_clock(0.1), 0.0, 0.5))
    assert frames[0].display_time_s <= 0.0, "something is on the display when measurement begins"
    assert all(f.display_time_s - f.sample_time_s == pytest.approx(0.2) for f in frames)
    assert frames[1].sample_time_s - frames[0].sample_time_s == pytest.approx(0.1)


def test_framed_image_is_the_picture_at_pixel_centres():
    config = small()
    frame = next(
        iter(runs.images("framed", config, pictures.tracer(pictures.textured_motion), fixed_clock(0.1), 0.0, 0.5))
    )
    centre = (torch.arange(256) + 0.5) / 256
    time = torch.tensor(frame.sample_time_s, dtype=torch.float32)
    expected = pictures.textured_motion(centre[None].expand(256, 256), centre[:, None].expand(256, 256), time)
    assert torch.allclose(frame.image, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("counts", "cycles"),
    [((1, 3), 2), pytest.param((1, 2, 3), 8, marks=pytest.mark.slow)],
    ids=["few cycles", "many cycles"],
)
@pytest.mark.parametrize(
    "config",
    [
        small(warmup_cycles=4),
        small(warmup_cycles=4, sdf_side=256),
        TsarConfig(warmup_cycles=2, batch_size=256, framelet_side=32),
    ],
    ids=["small", "large field", "large framelets"],
)
def test_results_do_not_depend_on_the_thread_count(config, counts, cycles):
    runs = []
    for threads in counts:
        torch.set_num_threads(threads)
        runs.append(play(config, pictures.textured_motion, cycles))
    for run_ in runs[1:]:
        for (record, display), (expected, shown) in zip(run_, runs[0], strict=True):
            assert torch.equal(display.image, shown.image)
            assert torch.equal(record.errors.spatial, expected.errors.spatial)
            assert torch.equal(record.errors.temporal, expected.errors.temporal)
            assert torch.equal(record.densities.spatial, expected.densities.spatial)
            assert torch.equal(record.densities.temporal, expected.densities.temporal)
            assert record.surplus == expected.surplus and torch.equal(record.selected, expected.selected)
            assert torch.equal(record.tiling.level, expected.tiling.level)
            assert torch.equal(record.tiling.index, expected.tiling.index)


def test_seeds_repeat_and_differ():
    same = [play(small(seed=s), pictures.textured_motion, 6)[-1][1].image for s in (3, 3, 4)]
    assert torch.equal(same[0], same[1]) and not torch.equal(same[0], same[2])


def test_nonfinite_samples_are_counted_and_never_shown():
    def trace(batch):
        color = pictures.tracer(pictures.textured_motion)(batch).color
        color[:, ::17] = float("nan")
        return SampleBatch(color, {})

    for record, display in runs.play("thesis", small(warmup_cycles=2), trace, fixed_clock(CYCLE), 0.0, 0.05):
        assert record.nonfinite == 32 * 16 and bool(torch.isfinite(display.image).all())


def test_radiance_at_the_end_of_float32_reaches_neither_image_nor_densities():
    def trace(batch):
        color = pictures.tracer(pictures.textured_motion)(batch).color
        color[:, ::31] = torch.finfo(torch.float32).max
        return SampleBatch(color, {})

    for record, display in runs.play("thesis", small(warmup_cycles=2), trace, fixed_clock(CYCLE), 0.0, 0.05):
        assert record.nonfinite == 32 * 9 and bool(torch.isfinite(display.image).all()) and display.image.max() <= 1.0
        assert bool(torch.isfinite(record.densities.spatial).all())


def test_wall_clock_time_advances_by_what_a_cycle_took():
    trace = pictures.tracer(pictures.constant)
    run_ = runs.play("thesis", small(warmup_cycles=2), trace, lambda counters, wall_s: wall_s, 0.0, 1e9)
    records = [next(run_)[0] for _ in range(5)]
    for now, after in pairwise(records):
        assert after.sim_time_s == pytest.approx(now.sim_time_s + now.cost_s)
        assert now.cost_s == pytest.approx(sum(now.stage_s.values()), rel=1e-6)


def test_static_content_settles_and_is_shown_as_it_is():
    """Nothing moves: once every tile has been rendered at its level, the image stops changing and matches the picture.

    Not so within half a sample of a border between fine and coarse tiles, where ages still decide how the two blend.
    """
    images = [d.image for _, d in play(small(), pictures.static_stripes, 200)[-40:]]
    steady = [torch.cat((image[:, :124], image[:, 132:]), dim=1) for image in images]
    assert all(float((image - steady[0]).abs().max()) < 1e-5 for image in steady)
    assert torch.allclose(steady[0][:, 124:], torch.tensor(0.3), atol=1e-6)
    centre = (torch.arange(512) + 0.5) / 512
    fine = pictures.static_stripes(centre[None].expand(512, 512), centre[:, None].expand(512, 512), None)
    box = fine.reshape(256, 2, 256, 2, 3).mean((1, 3))
    # All but the few tiles that the bound on their number keeps a level coarser.
    wrong = (steady[0][:, :116] - box[:, :116]).abs().amax(2) > 1e-5
    assert float(wrong.float().mean()) < 0.05


@pytest.mark.parametrize("speed", [0.2, 0.5, 1.0])
def test_temporal_density_gathers_where_a_moving_edge_is_and_leaves_where_it_was(speed):
    """Among the elements the edge crossed within the last moments temporal density is high; long after, it is low."""
    config = small()
    record = play(config, pictures.moving_edge(speed, start=0.05), int(0.6 / speed / CYCLE))[-1][0]
    x = (torch.arange(128) + 0.5) / 128
    edge = 0.05 + speed * record.sim_time_s
    temporal = element_grid(record.densities.temporal).mean(0)
    recent = (x <= edge) & (x > edge - max(0.06, 6 * speed * CYCLE))
    ahead = x > edge + 0.15
    assert float(temporal[recent].max()) > 4 * float(temporal[ahead].median())
    assert float(temporal[recent].mean()) > 2 * float(temporal[ahead].mean())


def test_a_clock_that_stops_time_is_refused():
    for seconds in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="finite, positive cycle time"):
            next(runs.play("thesis", small(), pictures.tracer(pictures.constant), fixed_clock(seconds), 0.0, 1.0))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TsarConfig(batch_size=-3), r"batch_size: expected between 1 and 8192 framelets, got -3"),
        (lambda: TsarConfig(resolution_px=500), r"resolution_px: expected a power of two in \[64, 8192\], got 500"),
        (lambda: TsarConfig(framelet_side=8), r"framelet_side: expected 16 or 32, got 8"),
        (
            lambda: TilingConfig(threshold_samples=1e-7),
            r"tiling.threshold_samples: expected 0 or a number in \[1e-6, 1e12\], got 1e-07",
        ),
        (lambda: ResponseConfig(temporal_min=0.0), r"response.temporal_min: expected a density in \[1e-6, 1\], got 0"),
        (lambda: TsarConfig(batch_size=64, tiling=TilingConfig(tile_count_max=32)), r"tiling.tile_count_max: expected"),
        (
            lambda: TsarConfig(tiling=TilingConfig(tile_count_max=128)),
            r"tiling.tile_count_max: expected between 130 \(a tiling has 16 \+ 3 k tiles, and every batch must",
        ),
        (
            lambda: TsarConfig(batch_size=512, tiling=TilingConfig(tile_count_max=512)),
            r"tiling.tile_count_max: expected between 514 .* got 512",
        ),
        (lambda: TsarConfig(batch_size=100, resolution_px=64), r"batch_size: expected at most 64 \(all tiles"),
        (
            lambda: TsarConfig(resolution_px=64),
            r"resolution_px: expected room for a batch of 128 .* fits\), got 64",
        ),
        (
            lambda: TsarConfig(batch_size=2, response=ResponseConfig(temporal_min=0.5)),
            r"response.temporal_min: expected at most 0.125 \(a batch of 2 for the 16 tiles of the coarsest level\)",
        ),
        (lambda: ResponseConfig(gain=float("inf")), r"response.gain: expected a number in \[1e-6, 1e6\], got inf"),
        (lambda: TilingConfig(threshold_samples=float("inf")), r"tiling.threshold_samples: .* got inf"),
        (
            lambda: TsarConfig(batch_size=16, resolution_px=64, reconstruction=ReconstructionConfig(65)),
            r"age_support_px: .* got 65",
        ),
        (lambda: TsarConfig(tiling=TilingConfig(level_max=9)), r"tiling.level_max: expected between 2 and 7, got 9"),
        (lambda: TilingConfig(rate_max=3), r"tiling.rate_max: expected 1, 2, 4 or 8, or 0, got 3"),
        (lambda: TilingConfig(level_max=6, rate_max=4), r"tiling.rate_max: expected 0 beside a level_max, .* got 4"),
        (
            lambda: TsarConfig(resolution_px=1024, tiling=TilingConfig(rate_max=4)),
            r"tiling.rate_max: expected at most 2 at sdf_side 128, got 4",
        ),
        (
            lambda: TsarConfig(resolution_px=64, batch_size=64, tiling=TilingConfig(level_min=3, rate_max=1)),
            r"tiling.rate_max: expected one that tiles of level 3 do not exceed, got 1",
        ),
    ],
)
def test_bad_configuration_names_field_and_value(make, message):
    with pytest.raises(ConfigError, match=message):
        make()


@pytest.mark.parametrize(
    "config",
    [
        TsarConfig(batch_size=32, resolution_px=256, framelet_side=32, warmup_cycles=4),
        TsarConfig(batch_size=256, resolution_px=256, sdf_side=64, warmup_cycles=4),
        TsarConfig(batch_size=16, resolution_px=64, sdf_side=256, warmup_cycles=4),
        TsarConfig(batch_size=16, resolution_px=128, warmup_cycles=4, response=ResponseConfig(bias=1.0, gain=0.3)),
        *(small(warmup_cycles=4, response=ResponseConfig(solver=name)) for name in SOLVERS),
    ],
)
def test_other_sizes_and_solvers_run_and_conserve(config):
    for record, display in play(config, pictures.textured_motion, 6):
        assert record.conservation_residual <= 1e-9 and bool(torch.isfinite(display.image).all())
        assert record.selected.numel() == config.batch_size


def test_stages_that_share_a_span_divide_it():
    timer = StageTimer()
    timer.divide(2.0, {"response": 3, "tiling": 1})
    timer.divide(1.0, {"tiling": 0, "selection": 0})  # a clock too coarse to tell
    assert timer.seconds == {"response": 1.5, "tiling": 0.5, "selection": 0.0}
    with pytest.raises(KeyError), timer("tiling"):
        raise KeyError
    assert timer.seconds["tiling"] > 0.5 and timer.total == sum(timer.seconds.values())
