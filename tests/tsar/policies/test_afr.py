"""Adaptive frameless rendering: crosshairs, tiles, the deep buffer and the filter over space and time."""

from __future__ import annotations

import pytest
import torch

from tests.oracles import pictures
from tests.oracles.screens import Layer, Screen
from tsar.clock import fixed_clock
from tsar.config import TilingConfig, TsarConfig
from tsar.morton import floor_log2
from tsar.policies import POLICIES, afr, deep_buffer, tiles
from tsar.policies.deep_buffer import DeepBuffer
from tsar.policy import Setting, run
from tsar.types import FrameletBatch, Hits

CONFIG = TsarConfig(batch_size=4, resolution_px=64, warmup_cycles=24, tiling=TilingConfig(level_min=1))
CYCLE_S, DEPTH = 1.0 / 64.0, 12


def checkers(u, v, t):
    value = 0.5 + 0.3 * torch.sin(40.0 * u) * torch.sin(30.0 * v)
    return value[..., None].expand(*u.shape, 3)


def moving(speed: float) -> Screen:
    return Screen((Layer(checkers, pose=lambda t: (torch.zeros_like(t), speed * t, torch.zeros_like(t))),))


def error(screen: Screen, poses: bool) -> float:
    """Mean squared error of the last picture in the middle of its display."""
    policy = POLICIES["afr"](Setting(CONFIG, view=screen.view if poses else None))
    *_, (_, last) = run(policy, screen.trace, fixed_clock(CYCLE_S), 0.0, 2 * CYCLE_S)
    return float((last.image - screen.picture(last.display_time_s + 0.5 * CYCLE_S, 64)).square().mean())


def test_crosshairs_are_a_place_in_their_tile_and_four_beside_it() -> None:
    node, place = afr.draw(tiles.initial(DEPTH, 64, 6, CONFIG.window), DEPTH, CONFIG, 5)
    assert node.numel() == 204 and place.shape == (1024, 2) and 0.0 <= float(place.min()) <= float(place.max()) < 1.0
    centre, *beside = (place[: 5 * 204] * 64).reshape(5, 204, 2)
    assert all(bool(((arm - centre).abs().sum(1) - 1.0).abs().max() < 0.01) for arm in beside)
    x, y = (centre / 8).to(torch.int64).unbind(1)
    assert 64 * 3 >= (y * 8 + x).unique().numel() == 64, "every tile has its turn"


def test_tiles_keep_their_number_and_cover_the_picture() -> None:
    tree = tiles.initial(DEPTH, 64, 6, CONFIG.window)
    for cycle in range(20):
        node, place = afr.draw(tree, DEPTH, CONFIG, cycle)
        x, y = place[:204].unbind(1)
        luminance = pictures.moving_edge(0.0, 0.3)(x, y, torch.zeros(204))[:, 0]
        values = torch.stack((torch.ones(204), luminance, luminance.square(), *torch.zeros(3, 204)))
        tree = tiles.adapt(tiles.gather(tree, node, values, 4.0), DEPTH)
        assert tree.leaves.numel() == 64
        assert float(torch.exp2(-floor_log2(tree.leaves).double()).sum()) == 1.0
    # Small tiles gather on the edge at x = 0.3.
    _, place = afr.draw(tree, DEPTH, CONFIG, 99)
    assert float(((place[:204, 0] - 0.3).abs() < 0.05).float().mean()) > 0.25


def test_extents_follow_the_gradients() -> None:
    """Eight times the squared gradient in space, or an eighth of that in time, is twice the extent."""
    base = torch.tensor([1.0, 0.5, 0.3, 1e-3, 1e-2, 1.0])
    found = []
    for factor in ((1.0, 1.0), (8.0, 1.0), (1.0, 0.125)):
        tree = tiles.initial(DEPTH, 64, 6, CONFIG.window)
        tree.sums[:, 64:128] = (base * torch.tensor([1.0, 1.0, 1.0, factor[0], factor[1], 1.0]))[:, None]
        found.append(float(afr.extents(tree, DEPTH, CONFIG, CYCLE_S)[0]))
    assert found[1] == pytest.approx(2.0 * found[0], rel=0.01) and found[2] == pytest.approx(2.0 * found[0], rel=0.01)


def test_values_of_crosshairs() -> None:
    """The greater difference along each axis, and the change since the newest earlier sample of the pixel."""
    # compressed luminance l of grey l² / (1 - l²): centres, right, left, below, above of two crosshairs
    luminance = torch.tensor([0.5, 0.2, 0.6, 0.2, 0.2, 0.1, 0.5, 0.4, 0.7, 0.3])
    color = (luminance.square() / (1.0 - luminance.square()))[:, None].expand(10, 3)
    place = torch.tensor([[0.5, 0.5], [0.1, 0.1]] + [[0.9, 0.9]] * 8)
    buffer = DeepBuffer.empty(4)
    for held, time_s, at in ((0.3, 1.0, 0.5), (0.45, 1.5, 0.5), (0.9, 2.0, 0.5)):
        grey = torch.full((1, 3), held**2 / (1.0 - held**2))
        buffer.add(grey, time_s, torch.full((1, 2), at), None)
    found = afr._values(
        buffer, buffer.seen(None, (8, 8)), afr.Crosshairs(torch.tensor([64, 65]), place), color, 2.0, (8, 8)
    )
    assert found[0].tolist() == [1.0] * 10
    assert found[1].tolist() == pytest.approx(luminance.tolist(), abs=1e-6)
    assert found[2].tolist() == pytest.approx(luminance.square().tolist(), abs=1e-6)
    first, second = 0.5 * (0.3**2 + 0.2**2), 0.5 * (0.1**2 + 0.2**2)
    assert found[3].tolist() == pytest.approx([first, second] * 5, abs=1e-6)
    # the sample of now does not count, and of the others the newest does; elsewhere nothing is held
    assert found[4].tolist() == pytest.approx([(0.5 - 0.45) ** 2] + [0.0] * 9, abs=1e-6)
    assert found[5].tolist() == pytest.approx([0.25] + [0.0] * 9)


def test_reprojection_takes_what_moves_along() -> None:
    """A picture that moves by a pixel a cycle is shown as well as one that stands, and far better than without it."""
    moved, stale, still = error(moving(1.0), True), error(moving(1.0), False), error(moving(0.0), True)
    assert moved < 4.0 * still and moved < stale / 4.0, (moved, stale, still)


def test_the_buffer_drops_what_is_hidden_and_outside_and_the_oldest() -> None:
    card = Layer(
        lambda u, v, t: torch.ones(*u.shape, 3),
        lambda u, v, t: (u.abs() < 0.1) & (v.abs() < 0.1),
        lambda t: (torch.zeros_like(t), t, torch.zeros_like(t)),
    )
    floor = Layer(
        lambda u, v, t: torch.zeros(*u.shape, 3), pose=lambda t: (torch.zeros_like(t), t * 0, 0.6 * (t > 0.5))
    )
    screen = Screen((card, floor))
    place = torch.tensor([[0.5, 0.5], [0.7, 0.5], [0.7, 0.51], [0.2, 0.3]])
    nothing = torch.zeros(1, dtype=torch.int64)
    answer = screen.trace(FrameletBatch(nothing, nothing, place[None], 0.0, hits=True))
    assert answer.hits is not None
    buffer = DeepBuffer.empty(4)
    buffer.add(answer.color[0], 0.0, place, answer.hits)
    assert buffer.seen(screen.view(0.0), (8, 8)).sample.tolist() == [0, 1, 2, 3]
    # the card at (0.5, 0.5) moves over the floor at (0.7, 0.5)
    assert buffer.seen(screen.view(0.2), (8, 8)).sample.tolist() == [0, 3]
    # the floor has left the picture at its top
    assert buffer.seen(screen.view(0.51), (8, 8)).sample.tolist() == []
    assert buffer.seen(None, (8, 8)).sample.tolist() == [0, 1, 2, 3]
    hits = Hits(*(values[:, :1] for values in vars(answer.hits).values()))
    buffer.add(torch.full((1, 3), 0.5), 0.1, place[:1], hits)
    assert buffer.seen(None, (8, 8)).sample.tolist() == [1, 2, 3, 0] and buffer.time_s.tolist() == [0.1, 0.0, 0.0, 0.0]


def test_a_sample_is_hidden_where_one_in_its_pixel_or_six_around_it_are_nearer() -> None:
    """The limits of depth, beside a count of the pixels around each sample that hold a nearer one."""
    random, shape = torch.Generator().manual_seed(5), (7, 9)
    pixel = torch.randint(shape[0] * shape[1], (300,), generator=random)
    depth = 1.0 + 0.4 * torch.rand(300, generator=random, dtype=torch.float64)
    depth[::17] = torch.inf
    nearest = {divmod(at, shape[1]): depth[pixel == at].amin().item() for at in pixel.unique().tolist()}
    limit, visible = deep_buffer._farthest(depth, pixel, shape), []
    for at, z in zip(pixel.tolist(), depth.tolist(), strict=True):
        row, column = divmod(at, shape[1])
        around = [(row + r, column + c) for r in (-1, 0, 1) for c in (-1, 0, 1) if r or c]
        nearer = sum(nearest.get(one, torch.inf) * 1.07 < z for one in around)
        visible.append(nearest[row, column] * 1.3 >= z and nearer < 6)
    assert (depth <= limit[pixel]).tolist() == visible
    assert 50 < sum(visible) < 250
