"""What the samples of a batch say about pixels, beside loops."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tests.oracles.screens import Layer, Screen
from tsar.filtering import samples
from tsar.filtering.records import UNSEEN, Surfels
from tsar.morton import deinterleave
from tsar.types import FrameletBatch

SIDE = 8


def batch(count: int = 3, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Positions, pixels, of tiles of 64 samples, some outside the picture, and their colours."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.0, SIDE + 1.0, (count, 64, 2)), rng.uniform(0.0, 1.0, (count, 64, 3))


def test_pixels_of_positions() -> None:
    position = torch.tensor([[0.0, 0.0], [7.99, 7.99], [8.0, 3.0], [3.0, 8.0], [-0.01, 3.0], [2.5, 6.0], [6.0, 2.5]])
    assert samples.pixels_of(position, SIDE).tolist() == [0, 63, 64, 64, 64, 6 * 8 + 2, 2 * 8 + 6]
    assert samples.pixels_of(position, SIDE, (3, 7)).tolist() == [0, 64, 64, 64, 64, 64, 2 * 8 + 6]


def test_samples_are_gathered_by_pixels() -> None:
    where, color = batch()
    pixel = samples.pixels_of(torch.from_numpy(where).float().reshape(-1, 2), SIDE)
    time_s = torch.linspace(4.0, 5.0, 192, dtype=torch.float64).reshape(3, 64)
    semivariance, roughness = torch.full((3, 64), 0.25), torch.full((1, SIDE, SIDE), 0.05)
    spacing = torch.tensor([1.0, 1.0, 1.0])
    found = samples.gathered(
        torch.from_numpy(color).float(), time_s, spacing, pixel, 5.0, roughness, semivariance
    )  # fmt: skip
    for at in range(SIDE * SIDE):
        own = [number for number, cell in enumerate(pixel.tolist()) if cell == at]
        y, x = divmod(at, SIDE)
        assert int(found.count[0, y, x]) == len(own) and int(found.newest[at]) == (own[-1] if own else -1)
        if own:
            mean = color.reshape(-1, 3)[own].mean(axis=0)
            assert found.color[:, y, x].numpy() == pytest.approx(mean, rel=1e-5)
            assert float(found.time_s[0, y, x]) == pytest.approx(float(time_s.reshape(-1)[own].mean()), abs=1e-6)
    near = torch.nn.functional.max_pool2d(found.count, 3, 1, 1) > 0.0
    assert found.roughness[near].numpy() == pytest.approx(0.5 * (0.05 + 0.25), rel=1e-5)
    assert not (~near).any() or float(found.roughness[~near].max()) == pytest.approx(0.05)


@pytest.mark.parametrize(("before", "expected"), [(0.01, 0.125), (0.2, 0.2), (0.5, 0.25)])
def test_coarse_samples_bound_the_roughness(before: float, expected: float) -> None:
    """At 4 pixels' distance a semivariance of 0.25 is from 0.25 / 2 for smooth surfaces to 0.25 for random ones."""
    pixel = torch.arange(64)
    found = samples.gathered(
        torch.zeros(1, 64, 3), torch.zeros(1, 64, dtype=torch.float64), torch.tensor([4.0]), pixel, 0.0,
        torch.full((1, SIDE, SIDE), before), torch.full((1, 64), 0.25),
    )  # fmt: skip
    assert found.roughness.numpy() == pytest.approx(0.5 * (before + expected), rel=1e-5)


def test_fine_samples_are_scaled_to_a_pixel() -> None:
    """At half a pixel's distance half the semivariance lies between them."""
    found = samples.gathered(
        torch.zeros(1, 64, 3), torch.zeros(1, 64, dtype=torch.float64), torch.tensor([0.5]), torch.arange(64), 0.0,
        torch.full((1, SIDE, SIDE), 0.1), torch.full((1, 64), 0.25),
    )  # fmt: skip
    assert found.roughness.numpy() == pytest.approx(0.5 * (0.1 + 0.5), rel=1e-5)


def test_semivariance_is_over_the_neighbours_in_the_tile() -> None:
    _, color = batch(2, 1)
    found = samples.semivariance_of(torch.from_numpy(color).float())
    column, row = (part.tolist() for part in deinterleave(torch.arange(64)))
    number = {(x, y): at for at, (x, y) in enumerate(zip(column, row, strict=True))}
    for tile in range(2):
        for (x, y), at in number.items():
            beside = [number[one] for one in ((x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)) if one in number]
            squares = [((color[tile, at] - color[tile, one]) ** 2).mean() for one in beside]
            assert float(found[tile, at]) == pytest.approx(0.5 * np.mean(squares), rel=1e-5)


def test_surfels_of_a_batch() -> None:
    """A layer moves by a pixel a cycle to the right before one that stands still; every fourth pixel is sampled."""
    rate = 1.0 / SIDE / 0.1

    def colored(u, v, t):
        return torch.stack((u, v, t.expand_as(u)), dim=-1)

    moving = Layer(colored, lambda u, v, t: v > 0.0, lambda t: (torch.zeros_like(t), rate * t, torch.zeros_like(t)))
    screen = Screen((moving, Layer(colored)))
    x, y = (part.reshape(-1) for part in torch.meshgrid(torch.arange(SIDE), torch.arange(SIDE), indexing="xy"))
    some = ((x % 2 == 0) & (y % 2 == 0)).nonzero().squeeze(1)[:16]
    position = (torch.stack((x[some], y[some]), dim=1).double() + 0.5) / SIDE
    nothing = torch.zeros(1, dtype=torch.int64)
    asked = FrameletBatch(nothing, nothing, position[None], 0.1, hits=True)
    hits = screen.trace(asked).hits
    assert hits is not None
    newest, count = torch.full((SIDE * SIDE,), -1), torch.zeros(1, SIDE, SIDE)
    newest[some] = torch.arange(16)
    count.reshape(-1)[some] = 1.0
    plane = torch.zeros(1, SIDE, SIDE)
    seen = samples.PixelBatch(plane.expand(3, -1, -1), plane.double(), count, newest, plane)
    before = Surfels(
        torch.full((1, SIDE, SIDE), UNSEEN), torch.zeros(3, SIDE, SIDE), torch.zeros(2, SIDE, SIDE),
        torch.zeros(2, SIDE, SIDE),
    )  # fmt: skip
    before.instance[0, :2] = 0
    before.instance[0, 6:] = 0
    before.step[0, 6:] = 1.0
    found = samples.met(hits, seen, before, screen.view(0.1), screen.view(0.0))
    for number, at in enumerate(some.tolist()):
        row, column = divmod(at, SIDE)
        front = row < SIDE // 2
        assert int(found.surfels.instance[0, row, column]) == (0 if front else 1)
        assert torch.equal(found.surfels.point[:, row, column], hits.point[0, number])
        assert found.surfels.position[:, row, column].tolist() == pytest.approx([column + 0.5, row + 0.5], abs=1e-4)
        assert found.surfels.step[:, row, column].tolist() == pytest.approx([1.0 if front else 0.0, 0.0], abs=1e-4)
        assert bool(found.same[0, row, column]) == (row < 2)
        # another surface is met below row 2; it moves against the one before where only one of them moves
        assert bool(found.replaced[0, row, column]) == (2 <= row < 4 or row >= 6)
    assert not (found.same | found.replaced)[count == 0.0].any()
    assert found.least_share[0, 6:].unique().item() == pytest.approx(1.0 / 17.0) and not found.least_share[0, :6].any()
