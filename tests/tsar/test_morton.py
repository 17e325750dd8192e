import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

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
    assert morton.kd_min_child(tensor(5), 4).item() == 20
    assert morton.kd_min_child(tensor(20, 23), 2).tolist() == [5, 5]
    # Tile 4 at kd depth 2 covers fine tiles 64..79 at depth 6.
    first = morton.kd_min_child(tensor(4), 6).item()
    assert (first, first + morton.kd_overlap(tensor(4), 6).item() - 1) == (64, 79)


def test_depth_first_order_of_the_thesis():
    tiles = tensor(4, 20, 21, 88, 89, 90, 91, 23, 24, 25, 26, 27, 7)
    expected = [3, 36, 43, 53, 54, 56, 57, 58, 68, 75, 83, 90, 97]
    assert morton.depth_first(tiles, 6).tolist() == expected


@pytest.mark.parametrize("depth_max", [1, 4, 9])
def test_depth_first_is_the_recurrence(depth_max):
    def recurrence(k):
        if k == 1:
            return 1
        sibling = 2 ** (depth_max - (k.bit_length() - 1) + 1) - 1
        return 1 + recurrence(k >> 1) + (sibling if k & 1 else 0)

    tiles = torch.arange(1, 2 ** (depth_max + 1))
    position = morton.depth_first(tiles, depth_max)
    assert position.tolist() == [recurrence(int(k)) for k in tiles]
    assert sorted(position.tolist()) == list(range(1, len(tiles) + 1))


def test_integrals_over_a_field_that_spans_twelve_decades():
    generator = torch.Generator().manual_seed(3)
    field = 10.0 ** (torch.rand(128 * 128, generator=generator, dtype=torch.float64) * 12 - 6)
    prefix = morton.prefix_sum(field.to(torch.float32))
    for level in range(2, 8):
        index = torch.arange(4**level)
        ours = morton.tile_integral(prefix, torch.full_like(index, level), index, 7)
        exact = field.to(torch.float32).to(torch.float64).reshape(4**level, -1).sum(1)
        # What a prefix sum in float64 can lose: a few units in the last place of the total.
        assert (ours - exact).abs().max() <= 1e-11 * float(field.sum())
    # The same in float32 loses small tiles altogether: the reason for float64.
    single = torch.cumsum(field.to(torch.float32), 0)
    lost = (single[1:] - single[:-1]) == 0
    assert lost.any()


@pytest.mark.parametrize("side", [2, 16, 128])
def test_raster_and_morton_orders_are_inverse(side):
    to_morton, to_raster = morton.raster_to_morton(side), morton.morton_to_raster(side)
    assert torch.equal(to_morton[to_raster], torch.arange(side * side))
    assert to_morton[3 if side > 3 else 1] == morton.interleave(tensor(3 if side > 3 else 1), tensor(0))[0]
