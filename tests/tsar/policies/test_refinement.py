"""The tree of one picture, cell by cell, beside loops."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tsar.policies import refinement
from tsar.policies.refinement import LEAST_CONTRAST, Level, levels, remaining, worthiest

SIDE = 8


def sampled(seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """Sums of colours, and numbers of samples of which half are none."""
    rng = np.random.default_rng(seed)
    count = rng.integers(0, 4, (SIDE, SIDE)) * rng.integers(0, 2, (SIDE, SIDE))
    color = rng.uniform(0.0, 1.0, (3, SIDE, SIDE)) * count
    return torch.from_numpy(color).float(), torch.from_numpy(count).float()


def slow_contrast(color: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Mean squared difference of a cell's encoded colour from that of the known cells beside it."""
    side = count.shape[0]
    found = np.zeros((side, side))
    encoded = np.sqrt(np.clip(color / np.maximum(count, 1.0), 0.0, 1.0))
    for y in range(side):
        for x in range(side):
            beside = [(y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)]
            known = [(v, u) for v, u in beside if 0 <= v < side and 0 <= u < side and count[v, u] > 0]
            if count[y, x] > 0 and known:
                squares = [((encoded[:, y, x] - encoded[:, v, u]) ** 2).mean() for v, u in known]
                found[y, x] = np.mean(squares)
    return found


def halved(plane: np.ndarray) -> np.ndarray:
    return plane[..., ::2, ::2] + plane[..., 1::2, ::2] + plane[..., ::2, 1::2] + plane[..., 1::2, 1::2]


@pytest.mark.parametrize("seed", range(3))
def test_levels_have_the_contrast_and_the_samples_of_their_cells(seed: int) -> None:
    color, count = sampled(seed)
    found, own, many = levels(color, count), color.numpy().astype(float), count.numpy().astype(float)
    assert [level.count.shape[0] for level in found] == [2, 4, 8]
    for level in reversed(found):
        assert np.array_equal(level.count.numpy(), many)
        assert level.contrast.numpy() == pytest.approx(slow_contrast(own, many), abs=1e-6)
        own, many = halved(own), halved(many)


def test_the_error_of_an_empty_pixel_is_that_of_the_finest_known_cell_around_it() -> None:
    coarse = Level(torch.tensor([[0.4, 0.8], [0.2, 0.6]]), torch.tensor([[1.0, 2.0], [1.0, 1.0]]))
    fine = Level(torch.arange(16.0).reshape(4, 4) / 16.0, torch.zeros(4, 4))
    fine.count[0, 2], fine.count[0, 3], fine.count[3, 0] = 1.0, 4.0, 2.0
    found = remaining([coarse, fine], 3.0)
    assert found[0, 2] == 0.5 * 2 / 16 and found[0, 3] == 0.5 * 3 / 16 / 4.0 and found[3, 0] == 0.5 * 12 / 16 / 2.0
    known = fine.count > 0
    around = torch.tensor([[0.4, 0.4, 0.8, 0.8], [0.4, 0.4, 0.8, 0.8], [0.2, 0.2, 0.6, 0.6], [0.2, 0.2, 0.6, 0.6]])
    assert torch.allclose(found[~known], 3.0 * around[~known])


def test_what_a_sample_removes() -> None:
    fine = Level(torch.full((4, 4), 0.5), torch.ones(4, 4))
    fine.count[0, 0], fine.count[1, 3], fine.count[0, 1] = 0.0, 0.0, 3.0
    coarse = Level(torch.tensor([[0.1, 0.2], [0.3, 0.4]]), torch.tensor([[5.0, 3.0], [4.0, 0.0]]))
    score, samples = refinement._offer(coarse, fine)
    assert samples.tolist() == [[1, 1], [0, 0]], "empty children"
    expected = [[0.25 * (0.1 + LEAST_CONTRAST) / 4, 0.25 * (0.2 + LEAST_CONTRAST) / 4], [0.0, 0.0]]
    assert score.numpy() == pytest.approx(np.array(expected), rel=1e-6)
    score, samples = refinement._offer(fine, None)
    assert samples.unique().tolist() == [1]
    own = 0.5 * (0.5 + 0.01 * LEAST_CONTRAST) / 16
    assert score[0, 0] == score[1, 3] == 0.0
    assert float(score[2, 2]) == pytest.approx(own / 2) and float(score[0, 1]) == pytest.approx(own / 12)


def test_the_worthiest_come_first_and_empty_children_before_more_samples() -> None:
    """One cell of 2 x 2 has contrast beside the others; one child of it is empty."""
    color, count = torch.zeros(3, 4, 4), torch.ones(4, 4)
    color[:, 2:, 2:] = 1.0
    count[3, 3] = 0.0
    color[:, 3, 3] = 0.0
    tree = levels(color, count)
    random = torch.Generator().manual_seed(0)
    assert worthiest(tree, 1, random).tolist() == [15]
    some = worthiest(tree, 5, random).tolist()
    edge = {1 * 4 + 2, 1 * 4 + 3, 2 * 4 + 1, 2 * 4 + 2, 3 * 4 + 1, 2 * 4 + 3, 3 * 4 + 2}
    assert some[0] == 15 and set(some[1:]) <= edge and len(set(some)) == 5


def test_each_empty_child_gets_a_pixel_within_it() -> None:
    level, finer = Level(torch.zeros(4, 4), torch.ones(4, 4)), Level(torch.zeros(8, 8), torch.ones(8, 8))
    for y, x in ((2, 4), (3, 5), (7, 0)):
        finer.count[y, x] = 0.0
    cells, random = torch.tensor([1 * 4 + 2, 3 * 4 + 0, 0]), torch.Generator().manual_seed(1)
    seen = set()
    for _ in range(60):
        pixels = refinement._empty_children(cells, level, finer, 16, random).tolist()
        assert [(at // 16 // 2, at % 16 // 2) for at in pixels] == [(2, 4), (3, 5), (7, 0)]
        seen |= set(pixels)
    assert len(seen) == 12, "every pixel of the three cells of 2 x 2"
