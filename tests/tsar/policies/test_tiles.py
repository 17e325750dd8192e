"""The kd-tree over a picture, node by node, beside loops."""

from __future__ import annotations

import pytest
import torch

from tsar.policies import tiles
from tsar.policies.tiles import TileTree
from tsar.window import Window

WINDOWS = (Window(8, 8, 8), Window(8, 5, 8), Window(6, 8, 8), Window(5, 7, 8))
DEPTH = 6


def pixels_of(node: int, window: Window) -> list[int]:
    """Raster indices of the pixels of a node within the picture, by halving the plane: x first, the left half first."""
    x, y, width, height = 0, 0, window.side_px, window.side_px
    for bit, step in enumerate(bin(node)[3:]):
        # bits of a kd index choose halves of y and x in turn, as bits of a Morton index do
        if bit % 2 == 0:
            height //= 2
            y += height * int(step)
        else:
            width //= 2
            x += width * int(step)
    inside = [(u, v) for v in range(y, y + height) for u in range(x, x + width)]
    return [v * window.width_px + u for u, v in inside if u < window.width_px and v < window.height_px]


@pytest.mark.parametrize("window", WINDOWS, ids=str)
def test_every_pixel_of_a_node_is_reached_and_no_other(window: Window) -> None:
    tree = tiles.initial(DEPTH, 8, 3, window)
    for node in range(1, 2 ** (DEPTH + 1)):
        expected = pixels_of(node, window)
        assert int(tree.shown_px[node]) == len(expected)
        if expected:
            share = (torch.arange(len(expected), dtype=torch.float64) + 0.5) / len(expected)
            found = tiles.place(torch.full_like(share, node, dtype=torch.int64), share, DEPTH, window)
            assert sorted(found.tolist()) == sorted(expected), node
            if not window.whole:
                assert found.tolist() == expected, "by rows"


@pytest.mark.parametrize("window", WINDOWS, ids=str)
def test_values_of_leaves_are_drawn_where_their_pixels_are(window: Window) -> None:
    tree = grown(window)
    drawn = tiles.per_pixel(tree.leaves.double(), tree, DEPTH, window)
    expected = torch.zeros(window.width_px * window.height_px, dtype=torch.float64)
    for node in tree.leaves.tolist():
        expected[pixels_of(node, window)] = node
    assert torch.equal(drawn, expected)


def grown(window: Window) -> TileTree:
    """A cut of 8 leaves of different depths: 8 and 9 are merged into 4, and 15 is split."""
    tree = tiles.initial(DEPTH, 8, 3, window)
    tree.leaf[8], tree.leaf[9], tree.leaf[15] = False, False, False
    tree.leaf[4], tree.leaf[30], tree.leaf[31] = True, True, True
    return tree


def filled(tree: TileTree, variances: dict[int, float]) -> TileTree:
    """Sums of two samples a leaf with mean luminance 1 and given variances."""
    for node in tree.leaves.tolist():
        tree.sums[:, node] = torch.tensor([2.0, 2.0, 2.0 * (1.0 + variances.get(node, 0.0))])
    return tree


def test_the_error_is_variance_times_area() -> None:
    tree = filled(tiles.initial(DEPTH, 8, 3, Window(8, 5, 8)), {8: 0.5, 14: 0.25})
    found = tiles.error(tree.sums[:, tree.leaves], tree.leaves, tree)
    # 64 pixels of the plane; leaves 8 and 14 have 8 pixels, of which 8 and 2 are within 5 rows
    shown = [len(pixels_of(node, Window(8, 5, 8))) for node in (8, 14)]
    assert float(found[0]) == pytest.approx(0.5 * shown[0] / 64, rel=1e-5)
    assert float(found[6]) == pytest.approx(0.25 * shown[1] / 64, rel=1e-5, abs=1e-9)
    assert found[1:6].abs().max() < 1e-6


def test_leaves_of_most_error_are_split_and_the_calmest_pairs_are_merged() -> None:
    tree = filled(tiles.initial(DEPTH, 8, 3, Window(8, 8, 8)), {8: 0.9, 9: 0.9, 10: 0.3, 11: 0.3, 12: 0.2, 13: 0.2})
    tree.sums[1:, 14] = torch.tensor([2.0, 2.0])
    found = tiles.adapt(tree, DEPTH)
    # 0.9 x 8 / 64 of 8 and of 9 are more than the 0 of the pair 14 and 15, and the 0.2 x 16 / 64 of 12 and 13
    assert found.leaves.tolist() == [6, 7, 10, 11, 16, 17, 18, 19]
    assert found.sums[:, 7].tolist() == [4.0, 4.0, 4.0]
    assert torch.equal(found.sums[:, 16], tree.sums[:, 8] / 2) and torch.equal(found.sums[:, 17], tree.sums[:, 8] / 2)


def test_only_pairs_of_leaves_are_merged_and_pixels_are_not_split() -> None:
    """4 has no leaf beside it (10 and 11 lie below 5); of 30 and 31 both are leaves."""
    tree = filled(grown(Window(8, 8, 8)), {4: 0.5, 10: 0.2, 11: 0.2, 12: 0.1, 13: 0.1, 14: 0.1})
    found = tiles.adapt(tree, DEPTH)
    assert found.leaves.tolist() == [8, 9, 10, 11, 12, 13, 14, 15]
    lowest = tiles.initial(2, 4, 3, Window(2, 2, 2))
    assert tiles.adapt(filled(lowest, {4: 0.5}), 2).leaves.tolist() == [4, 5, 6, 7]


def test_old_samples_fade() -> None:
    tree = filled(tiles.initial(DEPTH, 8, 3, Window(8, 8, 8)), {})
    found = tiles.gather(
        tree, torch.tensor([8, 8, 15]), torch.tensor([[1.0, 1.0, 1.0], [0.5, 0.25, 3.0], [0.0] * 3]), 4.0
    )
    assert found.sums[0, [8, 9, 15]].tolist() == pytest.approx(
        [2 * 0.7788008 + 2.0, 2 * 0.7788008, 2 * 0.7788008 + 1.0]
    )
    assert found.sums[1, [8, 9, 15]].tolist() == pytest.approx(
        [2 * 0.7788008 + 0.75, 2 * 0.7788008, 2 * 0.7788008 + 3.0]
    )
