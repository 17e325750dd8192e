"""The estimators beside the wavelet transform, on signals whose power is known."""

import math

import pytest
import torch

from tests.oracles import pictures, runs
from tsar.config import ErrorConfig, TsarConfig
from tsar.error import errors_of
from tsar.estimators import FFT_UPDATES, measure, octave_power, state_size
from tsar.morton import morton_to_raster

SIDE = 16


def waves(across: int, along: int, updates: int = FFT_UPDATES) -> torch.Tensor:
    """``(t, 1, samples)``: a wave of so many cycles over the tile and over the updates, of variance 1/2."""
    t, _, x = torch.meshgrid(torch.arange(updates), torch.arange(SIDE), torch.arange(SIDE), indexing="ij")
    picture = torch.cos(2 * math.pi * (across * x / SIDE + along * t / FFT_UPDATES) + 0.3)
    return picture.flatten(1)[:, None, morton_to_raster(SIDE)]


def stream(signals: torch.Tensor, config: ErrorConfig, parts: int = 1):
    """Power of tiles after all updates."""
    count, samples = signals.shape[1:]
    state, known = torch.zeros(count, state_size(samples, config)), torch.zeros(count, dtype=torch.bool)
    for signal in signals:
        spatial, temporal, state = measure(signal, state, known, parts, config)
        known = torch.ones_like(known)
    return spatial, temporal


@pytest.mark.parametrize(
    ("across", "along", "axis", "octave"),
    [(6, 0, 0, 0), (4, 0, 0, 1), (2, 0, 0, 2), (1, 0, 0, 3), (0, 3, 1, 0), (0, 2, 1, 1), (2, 3, 1, 0), (6, 2, 0, 0)],
)
def test_a_wave_lies_in_the_octave_of_its_finer_frequency(across: int, along: int, axis: int, octave: int) -> None:
    """Most of its power; the window spreads some to the frequencies beside, some of them of other octaves."""
    power = octave_power(waves(across, along).transpose(0, 1))
    every = torch.cat(power)[:, 0]
    assert float(power[axis][octave, 0]) == float(every.max()) > 0.55 * float(every.sum())
    assert 0.15 < float(every.sum()) < 0.6, "the variance of a wave is 1/2, but for what the window weighs"


def test_power_by_frequency_sums_to_the_variance_under_the_window() -> None:
    noise = torch.randn(100, FFT_UPDATES, SIDE**2, generator=torch.Generator().manual_seed(0))
    still = noise[:, :1].expand_as(noise).contiguous()
    spatial, temporal = octave_power(still)
    assert float(temporal.max()) < 1e-6 and float(spatial.sum(0).mean()) == pytest.approx(1.0, abs=0.05)
    spatial, temporal = octave_power(noise)
    assert float((spatial.sum(0) + temporal.sum(0)).mean()) == pytest.approx(1.0, abs=0.1)
    assert float(temporal.mean()) > float(spatial.mean()), "most frequencies of white noise are finer in time"


def test_variance_is_that_of_the_samples_of_a_part() -> None:
    signals = torch.rand(2, 5, SIDE**2, generator=torch.Generator().manual_seed(1))
    for parts in (1, 16):
        spatial, temporal = stream(signals, ErrorConfig(estimator="variance"), parts)
        cut = signals[1].reshape(5, parts, -1)
        assert torch.allclose(spatial.power[0], cut.var(2, correction=0), atol=1e-6)
        pairs = signals.var(0, correction=0).reshape(5, parts, -1).mean(2)
        assert torch.allclose(temporal.power[0], pairs, atol=1e-6)


@pytest.mark.parametrize("estimator", ["variance", "fft"])
def test_noise_at_the_template_is_about_where_it_should_be(estimator: str) -> None:
    """White noise whose wavelet coefficients have the power of a flat template has no error in space, by any estimator.

    A finest coefficient ghh of samples of variance v has power v, hgh too, and ggh 4 v; coarser ones have less.
    """
    noise = 0.1 * torch.randn(20, 64, SIDE**2, generator=torch.Generator().manual_seed(2))
    still = noise[:1].expand(20, -1, -1)
    level = math.log2(6 * 0.01 * 85 / 64 / 4 * 3)
    templates = level - 2.0, 0.0, level - 2.0, 0.0
    wavelet = stream(still, ErrorConfig(*templates))[0]
    other = stream(still, ErrorConfig(*templates, estimator=estimator))[0]
    ratios = [float((one.power.sum(0) / one.tolerated.sum()).mean()) for one in (wavelet, other)]
    assert 0.4 < ratios[0] / ratios[1] < 2.5, ratios


@pytest.mark.parametrize("estimator", ["dwt", "variance", "fft"])
def test_a_still_tile_has_too_many_refreshes_and_a_new_one_is_not_known(estimator: str) -> None:
    config = ErrorConfig(estimator=estimator, extent="tile")
    signal = 0.5 + waves(6, 0, 20) * 0.4
    state, known = torch.zeros(1, state_size(SIDE**2, config)), torch.tensor([False])
    for number in range(20):
        phi, state = errors_of(signal[0], state, known, 64, config)
        known = torch.tensor([True])
        assert float(phi[0]) > 0.5
        enough = number >= (FFT_UPDATES - 1 if estimator == "fft" else 1)
        assert float(phi[1]) == pytest.approx(-1.0 if enough else 0.0, abs=1e-6)


@pytest.mark.parametrize("estimator", ["variance", "fft"])
def test_a_tile_that_changes_asks_for_refreshes(estimator: str) -> None:
    config = ErrorConfig(estimator=estimator, extent="tile")
    state, known = torch.zeros(1, state_size(SIDE**2, config)), torch.tensor([False])
    for signal in 0.5 + 0.3 * waves(0, 3, 20):
        phi, state = errors_of(signal, state, known, 64, config)
        known = torch.tensor([True])
    assert float(phi[1]) > 0.5 and float(phi[0]) < 0.0


@pytest.mark.parametrize("extent", ["tile", "element"])
@pytest.mark.parametrize("estimator", ["variance", "fft"])
def test_a_run_closes_the_loop(estimator: str, extent: str) -> None:
    error = ErrorConfig(estimator=estimator, extent=extent)
    config = TsarConfig(batch_size=32, resolution_px=64, sdf_side=32, warmup_cycles=4, error=error)

    def clock(counters: object, wall_s: float) -> float:
        return 0.01

    found = list(runs.play("thesis", config, pictures.tracer(pictures.textured_motion), clock, 0.0, 0.3))
    assert all(record.conservation_residual < 1e-9 for record, _ in found)
    last = found[-1][0]
    assert last.densities.temporal.std() > 0.01 and last.errors.temporal.abs().max() > 0.1
    assert all(bool(torch.isfinite(display.image).all()) for _, display in found)
