import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles import curves
from tsar import morton


def tensor(*values):
    return torch.tensor(values, dtype=torch.int64)


def test_interleave_example_of_the_thesis():
    assert morton.interleave(tensor(3), tensor(2)).item() == 13


@given(st.integers(0, 65535), st.integers(0, 65535))
def test_interleave_is_the_bitwise_definition_and_inverts(x, y):
    slow = sum(((x >> b & 1) << 2 * b) | ((y >> b & 1) << (2 * b + 1)) for b in range(16))
    index = morton.interleave(tensor(x), tensor(y))
    assert index.item() == slow
    back = morton.deinterleave(index)
    assert (back[0].item(), back[1].item()) == (x, y)


def test_min_child_and_overlap_examples_of_the_thesis():
    assert curves.kd_min_child(tensor(5), 4).item() == 20
    assert curves.kd_min_child(tensor(20, 23), 2).tolist() == [5, 5]
    # Tile 4 at kd depth 2 covers fine tiles 64..79 at depth 6.
    first = curves.kd_min_child(tensor(4), 6).item()
    assert (first, first + curves.kd_overlap(tensor(4), 6).item() - 1) == (64, 79)


@pytest.mark.parametrize("depth", [0, 3, 6])
def test_kd_indices_by_enumeration(depth):
    """Children are 2k and 2k + 1, and the last tile of a depth covers as many descendants as any other."""
    for k in range(1, 2**7):
        own = k.bit_length() - 1
        assert morton.floor_log2(tensor(k)).item() == own
        descendants = [d for d in range(2**depth, 2 ** (depth + 1)) if depth >= own and d >> (depth - own) == k]
        assert curves.kd_overlap(tensor(k), depth).item() == len(descendants)
        expected = descendants[0] if descendants else k >> (own - depth)
        assert curves.kd_min_child(tensor(k), depth).item() == expected


def test_a_quad_level_is_two_kd_depths():
    """A cell of half the coordinates has the index without its two lowest bits."""
    x, y = torch.meshgrid(torch.arange(16), torch.arange(16), indexing="ij")
    assert torch.equal(morton.interleave(x, y) >> 2, morton.interleave(x >> 1, y >> 1))


def test_depth_first_order_makes_every_subtree_contiguous():
    """Sorted by depth-first position, the tiling of the thesis has the tiles below kd tile 5 in one run (eq. 4.14)."""
    tiles = tensor(4, 7, 20, 21, 23, 24, 25, 26, 27, 88, 89, 90, 91)
    ordered = tiles[torch.argsort(curves.depth_first(tiles, 6))]
    assert ordered.tolist() == [4, 20, 21, 88, 89, 90, 91, 23, 24, 25, 26, 27, 7]
    below = [int(k) >> (int(k).bit_length() - 3) == 5 for k in ordered]
    assert below == [False] + [True] * 7 + [False] * 5


def test_depth_first_order_of_the_thesis():
    tiles = tensor(4, 20, 21, 88, 89, 90, 91, 23, 24, 25, 26, 27, 7)
    expected = [3, 36, 43, 53, 54, 56, 57, 58, 68, 75, 83, 90, 97]
    assert curves.depth_first(tiles, 6).tolist() == expected


@pytest.mark.parametrize("depth_max", [1, 4, 9])
def test_depth_first_is_the_recurrence(depth_max):
    def recurrence(k):
        if k == 1:
            return 1
        sibling = 2 ** (depth_max - (k.bit_length() - 1) + 1) - 1
        return 1 + recurrence(k >> 1) + (sibling if k & 1 else 0)

    tiles = torch.arange(1, 2 ** (depth_max + 1))
    position = curves.depth_first(tiles, depth_max)
    assert position.tolist() == [recurrence(int(k)) for k in tiles]
    assert sorted(position.tolist()) == list(range(1, len(tiles) + 1))


def test_integrals_over_a_field_that_spans_twelve_decades():
    generator = torch.Generator().manual_seed(3)
    field = 10.0 ** (torch.rand(128 * 128, generator=generator, dtype=torch.float64) * 12 - 6)
    prefix = curves.prefix_sum(field.to(torch.float32))
    for level in range(2, 8):
        index = torch.arange(4**level)
        ours = curves.tile_integral(prefix, torch.full_like(index, level), index, 7)
        exact = field.to(torch.float32).to(torch.float64).reshape(4**level, -1).sum(1)
        # Greatest loss of a prefix sum in float64: half a unit in the last place of the total for every added element.
        half_unit = math.ulp(float(field.sum())) / 2
        assert (ours - exact).abs().max() <= half_unit * (4 ** (7 - level) + 1)
    # The same in float32 loses small tiles altogether: the reason for float64.
    single = torch.cumsum(field.to(torch.float32), 0)
    lost = (single[1:] - single[:-1]) == 0
    assert lost.any()


def test_means_of_tiles_agree_with_their_integrals_and_are_exact_among_equals():
    generator = torch.Generator().manual_seed(4)
    field = 10.0 ** (torch.rand(64 * 64, generator=generator, dtype=torch.float64) * 12 - 6)
    level = torch.tensor([0, 1, 1, 3, 4, 6, 6])
    index = torch.tensor([0, 0, 3, 17, 255, 0, 4095])
    wanted = [float(field.reshape(4**at, -1)[i].mean()) for at, i in zip(level.tolist(), index.tolist(), strict=True)]
    assert morton.tile_mean(field, level, index, 6).tolist() == pytest.approx(wanted, rel=1e-14)
    assert bool((morton.tile_mean(torch.full((64 * 64,), 0.1).double(), level, index, 6) == torch.tensor(0.1)).all())


def test_integral_example_of_the_thesis():
    """Quad tile 0 of level 1, kd tile 4, covers the fine tiles 64..79 of level 3: the first sixteen elements."""
    first, last = morton.tile_interval(tensor(1), tensor(4 - 2**2), 3)
    assert (first.item(), last.item()) == (64 - 2**6, 80 - 2**6)
    prefix = curves.prefix_sum(torch.arange(64.0))
    assert curves.tile_integral(prefix, tensor(1), tensor(0), 3).item() == sum(range(16))


def test_a_total_is_the_sum_and_does_not_depend_on_the_thread_count():
    generator = torch.Generator().manual_seed(8)
    field = 10.0 ** (torch.rand(512 * 512, generator=generator, dtype=torch.float64) * 12 - 6)
    before, totals = torch.get_num_threads(), set()
    try:
        for threads in (1, 2, 3, 7):
            torch.set_num_threads(threads)
            totals.add(morton.total(field))
    finally:
        torch.set_num_threads(before)
    assert len(totals) == 1 and totals.pop() == pytest.approx(math.fsum(field.tolist()), rel=1e-12)
    assert morton.total(torch.zeros(0)) == 0.0


@pytest.mark.parametrize("side", [2, 16, 128])
def test_raster_and_morton_orders_are_inverse(side):
    to_morton, to_raster = morton.raster_to_morton(side), morton.morton_to_raster(side)
    assert torch.equal(to_morton[to_raster], torch.arange(side * side))
    assert to_morton[3 if side > 3 else 1] == morton.interleave(tensor(3 if side > 3 else 1), tensor(0))[0]
