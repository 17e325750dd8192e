"""Estimates that go with their surfaces."""

from __future__ import annotations

from dataclasses import replace

import torch

from tests.oracles.screens import Layer, Screen
from tsar.filtering.motion import moved
from tsar.filtering.records import UNSEEN, Estimates, Surfels, centres

SIDE = 32


def known(screen: Screen) -> tuple[Estimates, Surfels]:
    """One surfel in the middle of every pixel, coloured by its number, at time 0."""
    from tsar.types import FrameletBatch

    at = (centres(SIDE) / SIDE).reshape(2, -1).T[None]
    none = torch.zeros(1, dtype=torch.int64)
    hits = screen.trace(FrameletBatch(none, none, at, 0.0, hits=True)).hits
    assert hits is not None
    number = torch.arange(SIDE * SIDE, dtype=torch.float32).reshape(1, SIDE, SIDE)
    estimates = replace(
        Estimates.empty(SIDE),
        color=number.expand(3, SIDE, SIDE).contiguous(),
        aged=torch.zeros(1, SIDE, SIDE),
        time_s=torch.zeros(1, SIDE, SIDE, dtype=torch.float64),
    )
    surfels = replace(
        Surfels.empty(SIDE),
        instance=hits.instance.reshape(1, SIDE, SIDE).to(torch.int64),
        point=hits.point.reshape(-1, 3).T.reshape(3, SIDE, SIDE).contiguous(),
    )
    return estimates, surfels


def grey(u, v, t):
    return torch.full((*u.shape, 3), 0.5, dtype=torch.float64)


def sliding(pixels: float) -> Screen:
    """A plane that moves right by so many pixels a second."""
    return Screen((Layer(grey, pose=lambda t: (torch.zeros_like(t), pixels / SIDE * t, torch.zeros_like(t))),))


def test_nothing_moves_in_a_still_scene() -> None:
    screen = sliding(0.0)
    estimates, surfels = known(screen)
    for _ in range(5):
        after, new = moved(estimates, surfels, screen.view(1.0))
        assert all(torch.equal(a, b) for a, b in zip(vars(after).values(), vars(estimates).values(), strict=True))
        assert torch.equal(new.instance, surfels.instance) and not new.step.any()
        estimates, surfels = after, new


def test_whole_pixels_shift_the_picture_and_leave_the_border_unknown() -> None:
    screen = sliding(3.0)
    estimates, surfels = known(screen)
    after, new = moved(estimates, surfels, screen.view(1.0))
    assert torch.equal(after.color[:, :, 3:], estimates.color[:, :, :-3])
    assert (new.step[0, :, 3:] == 3.0).all() and (new.instance[:, :, :2] == UNSEEN).all()
    assert (after.time_s[:, :, :2] == -torch.inf).all() and (after.variance[:, :, :2] == 0.1).all()


def test_many_small_steps_neither_blur_nor_lose_surfaces() -> None:
    """Ten pixels in 80 steps: every pixel holds a surfel that lies within a pixel of it, with the colour it had."""
    screen = sliding(10.0)
    estimates, surfels = known(screen)
    for step in range(1, 81):
        estimates, surfels = moved(estimates, surfels, screen.view(step / 80.0))
    inner = slice(11, SIDE)
    assert (surfels.instance[:, :, inner] == 0).all()
    number = estimates.color[0][:, inner]
    wanted = torch.arange(SIDE * SIDE, dtype=torch.float32).reshape(SIDE, SIDE)[:, : SIDE - 11]
    assert torch.equal(number % 1.0, torch.zeros_like(number)), "no colour is a mixture"
    assert (number - wanted).abs().max() <= 1.0


def test_the_surface_in_front_is_seen_and_the_one_behind_comes_back_only_where_it_was_known() -> None:
    def square(u, v, t):
        return (u.abs() < 0.25) & (v.abs() < 0.25)

    front = Layer(grey, square, lambda t: (torch.zeros_like(t), 8.0 / SIDE * t, torch.zeros_like(t)))
    screen = Screen((front, Layer(grey)))
    estimates, surfels = known(screen)
    _, new = moved(estimates, surfels, screen.view(1.0))
    row = new.instance[0, SIDE // 2]
    assert (row[16:32] == 0).all(), "the square covers what was background"
    assert (row[:8] == 1).all()
    assert (row[10:15] == UNSEEN).all(), "what it uncovers is unknown"
