"""The streaming estimate on made-up signals, and how directions are compared."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from analysis.command.progress import Task
from analysis.spectrum.estimate_check import (
    Rates,
    Tiles,
    agreement,
    angle_deg,
    check_estimate,
    joined,
    measure,
    measure_example,
    measure_input,
    streaming_error,
)
from analysis.spectrum.ideal_density import ideal_band, power_norm, share_of_total
from analysis.spectrum.options import SpectrumOptions
from tests.analysis.signals import disk, noise, separable
from tests.oracles.batches import make_batch
from tsar.cache import FrameletCache
from tsar.config import ErrorConfig, TsarConfig
from tsar.error import estimate
from tsar.morton import interleave, morton_to_raster
from tsar.tiling import uniform

ERROR = ErrorConfig()


@pytest.mark.parametrize("error", [ERROR, ErrorConfig(extent="tile"), ErrorConfig(estimator="fft")])
def test_estimate_is_the_pipelines_own(error: ErrorConfig) -> None:
    """At a stride that leaves one framelet: the error that the pipeline finds for a tile refreshed at those times."""
    planes = (0.4 + 0.05 * noise(1, 5, 32, 32, seed=4).float()).clamp(0.1, 0.8)
    found = streaming_error(planes, 2, 2, error, 64)
    assert found.shape == (1, 2, 2)
    config = TsarConfig(batch_size=1, error=error)
    signal = planes[:, ::2, 1::2, 1::2].flatten(2)[..., morton_to_raster(16)][0, :, :, None].expand(-1, -1, 3)
    radiance = signal.square() / (1.0 - signal.square())  # of that compressed luminance
    cache = FrameletCache(config)
    for refresh in range(3):
        batch = make_batch(uniform(4), torch.tensor([7]), float(refresh), refresh, config)
        done = estimate(batch, radiance[refresh][None], cache, config)
        cache.insert(batch, done.color, done.coefficients)
        covered = slice(7 * 64, 8 * 64)
        if refresh:
            phi = torch.stack((done.errors.spatial[covered].mean(), done.errors.temporal[covered].mean()))
            torch.testing.assert_close(found[0, refresh - 1], phi, atol=1e-5, rtol=1e-4)


def test_estimate_of_a_tile_is_the_mean_over_its_framelets() -> None:
    planes = noise(1, 3, 64, 64, seed=5).float() * 0.1
    whole = streaming_error(planes, 1, 1, ERROR, 64)
    parts = [
        streaming_error(planes[..., y : y + 16, x : x + 16], 1, 1, ERROR, 4)
        for y in range(0, 64, 16)
        for x in range(0, 64, 16)
    ]
    torch.testing.assert_close(whole, torch.stack(parts).mean(0))


def test_rates_and_true_directions() -> None:
    rates = Rates((4, 2), (2, 8))
    assert rates.densities(64, 32).tolist() == [[16, 16], [16, 4], [32, 16], [32, 4]]
    volume = separable(64, 32, 8, 4)
    flat = volume.flatten(2)[..., morton_to_raster(64)].float()
    tiles, power = measure(flat, rates, ERROR, 64)
    assert power.shape == (1, 17, 33, 33)
    f_s, f_t = (int(f) for f in ideal_band(share_of_total(tiles.norm), 0.01))
    true = tiles.true(share_of_total(tiles.norm), 0.01)
    assert true.shape == (1, 4, 2)
    np.testing.assert_allclose(true[0, 1], [np.log2(2 * f_s / 16), np.log2(2 * f_t / 4)])
    np.testing.assert_allclose(true[0, 2], [np.log2(2 * f_s / 32), np.log2(2 * f_t / 16)])


def test_angles() -> None:
    a = np.array([[1.0, 0.0], [1.0, 1.0], [2.0, 0.0], [0.0, -3.0], [0.0, 0.0]])
    b = np.array([[5.0, 0.0], [-2.0, -2.0], [0.0, 1.0], [1.0, -1.0], [1.0, 0.0]])
    np.testing.assert_allclose(angle_deg(a, b)[:4], [0.0, 180.0, 90.0, 45.0])
    assert np.isnan(angle_deg(a, b)[4]) and np.isnan(angle_deg(b, a)[4])


def vectors(tiles: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((tiles, 3, 2))


def test_perfect_opposite_and_random_estimates() -> None:
    true = vectors(300, 0)
    same, opposite, random = (agreement(phi, true) for phi in (0.1 * true, -true, vectors(300, 1)))
    for found, angle, share in ((same, 0.0, 1.0), (opposite, 180.0, 0.0)):
        assert found["angle_median_deg"]["value"] == pytest.approx(angle, abs=1e-6)
        assert found["share_within_45_deg"]["value"] == found["share_same_quadrant"]["value"] == share
        assert found["share_sign_space"]["value"] == found["share_sign_time"]["value"] == share
        assert found["angle_median_deg"]["permuted"] == pytest.approx(90.0, abs=4.0)
        assert found["space"]["pearson"] == pytest.approx(2 * share - 1)
        assert found["time"]["spearman"] == pytest.approx(2 * share - 1)
    for name in ("angle_median_deg", "share_within_45_deg", "share_same_quadrant", "share_sign_space"):
        low, high = random[name]["interval"]
        assert low < random[name]["value"] < high
        assert random[name]["value"] == pytest.approx(random[name]["isotropic"], rel=0.15)
        permuted_low, permuted_high = random[name]["permuted_interval"]
        assert permuted_low < random[name]["value"] < permuted_high
    assert abs(random["space"]["spearman"]) < 0.15


def test_dealing_keeps_how_often_each_sign_occurs() -> None:
    """An estimate that is the same for every tile is no better than chance, however often it is right."""
    true = np.abs(vectors(100, 2))
    found = agreement(np.ones_like(true), true)
    assert found["share_same_quadrant"]["value"] == 1.0
    assert found["share_same_quadrant"]["permuted"] == 1.0
    assert found["angle_median_deg"]["permuted"] == pytest.approx(found["angle_median_deg"]["value"])
    assert np.isnan(found["space"]["spearman"])


def test_tables_of_signs_and_pairs_without_direction() -> None:
    phi = np.array([[[0.5, -0.5]], [[0.5, 0.5]], [[-0.5, -0.5]], [[-0.5, 0.5]]])
    true = np.array([[[1.0, -1.0]], [[0.0, -2.0]], [[1.0, -1.0]], [[0.0, 0.0]]])
    found = agreement(phi, true)
    assert found["space"]["signs"] == [[0, 1, 1], [0, 1, 1]]
    assert found["time"]["signs"] == [[2, 0, 0], [1, 1, 0]]
    assert found["pairs"] == 4 and found["pairs_without_direction"] == 1
    assert found["share_sign_space"]["value"] == pytest.approx(2 / 3)
    assert found["share_sign_time"]["value"] == pytest.approx(2 / 3)
    assert found["share_same_quadrant"]["value"] == pytest.approx(1 / 3)


def test_intervals_are_of_95_percent() -> None:
    """One tile of three is wrong: it is drawn three times with a chance of 1/27, which is 3.7 %."""
    true = np.array([[[1.0, 1.0]], [[1.0, 1.0]], [[1.0, -1.0]]])
    for sign, ends in ((1.0, (0.0, 1.0)), (-1.0, (0.0, 1.0))):
        assert agreement(np.abs(true) * sign, true)["share_sign_time"]["interval"] == ends
    # of 28 tiles one may get its own estimate or one of 27 others: right with a chance of 1/28, which is 3.6 %
    lone = np.ones((28, 1, 2))
    lone[0, 0, 1] = -1.0
    low, high = agreement(lone, lone)["share_sign_time"]["permuted_interval"]
    assert (low, high) == (pytest.approx(26 / 28), 1.0)


SMALL = SpectrumOptions(
    ideal_samples=32,
    ideal_frames=16,
    tile_level=2,
    tile_at=(0.3, 0.6),
    agreement_samples=64,
    agreement_frames=16,
    tiles_per_input=8,
)


def test_an_example_in_physical_units() -> None:
    example = measure_example(SMALL, disk, Task())
    assert example.index == int(interleave(torch.tensor(1), torch.tensor(2)))
    assert example.place(512) == (128.0, 256.0, 128.0)
    assert example.unit == (4 / 512, 2.0) and example.power.shape == (17, 17)
    assert example.tiles.theta.tolist() == [[16, 8], [16, 4], [32, 8], [32, 4]]
    found = example.summary()
    assert found["samples_per_pixel_side"] == 2 * found["f_s"] * 4 / 512
    assert found["refresh_ms"] == pytest.approx(1e3 * 0.5 / (2 * found["f_t"]))
    assert found["realizable"]["samples_per_pixel_side"] == (0.125, 2.0)
    slow, fast = found["realizable"]["refreshes_per_s"]
    assert fast == pytest.approx(1 / SMALL.cycle_s()) and slow == pytest.approx(fast / 16)
    assert [row["tau"] for row in found["other_tau"]] == [0.003, 0.01, 0.03, 0.1]
    by_index = measure_example(
        SpectrumOptions(ideal_samples=32, ideal_frames=8, tile_level=2, tile_index=9), disk, Task()
    )
    assert by_index.index == 9 and by_index.place(512) == (128.0, 256.0, 128.0)


def test_tiles_of_an_input_and_the_check() -> None:
    task = Task()
    first = measure_input(SMALL, 0, disk, 6.0, task)
    assert task.done == 4 * 16 and first.phi.shape == first.phi_last.shape == (8, 9, 2)
    assert first.theta.tolist() == Rates((4, 2, 1), (2, 4, 8)).densities(64, 16).tolist()
    again, other = measure_input(SMALL, 0, disk, 6.0, Task()), measure_input(SMALL, 1, disk, 6.0, Task())
    assert torch.equal(first.norm, again.norm) and not torch.equal(first.norm, other.norm)
    found = check_estimate({"a": first, "b": other}, 0.01)
    assert found["all"]["tiles"] == 16 and found["all"]["pairs"] == 16 * 9
    assert found["inputs"]["a"]["tiles"] == found["inputs"]["b"]["tiles"] == 8
    assert [(row["norm"], row["tau"]) for row in found["thresholds"]][:2] == [("share", 0.003), ("share", 0.01)]
    same = next(row for row in found["thresholds"] if (row["norm"], row["tau"]) == ("share", 0.01))
    assert same["angle_median_deg"] == found["all"]["angle_median_deg"]


def test_the_check_knows_a_good_estimate() -> None:
    """Estimates that are the truth itself agree with it, whatever the tiles show."""
    base = measure(noise(6, 16, 64 * 64, seed=7).float(), Rates((4,), (2, 4)), ERROR, 64)[0]
    norm = power_norm(
        torch.rand(6, 9, 33, 33, dtype=torch.float64) / (1 + torch.arange(33)) ** torch.arange(6)[:, None, None, None]
    )
    truth = torch.from_numpy(Tiles(norm, base.theta, base.phi, base.phi).true(share_of_total(norm), 0.01))
    good = Tiles(norm, base.theta, 0.1 * truth, -truth)
    found = check_estimate({"a": joined([good, good])}, 0.01)
    assert found["all"]["angle_median_deg"]["value"] == pytest.approx(0.0, abs=1e-6)
    assert found["one_update"]["angle_median_deg"]["value"] == pytest.approx(180.0, abs=1e-6)
    assert found["all"]["tiles"] == 12
