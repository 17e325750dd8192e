"""Surfels that are points: where they go, and what is drawn of them."""

from __future__ import annotations

from dataclasses import replace

import torch

from tests.oracles.screens import Layer, Screen
from tests.tsar.filtering.test_motion import SIDE, grey, known, sliding
from tsar.filtering.records import UNSEEN
from tsar.filtering.splats import advanced, depths, drawn

NO_RATE = torch.zeros(1, SIDE // 4, SIDE // 4)
MIDDLE = SIDE // 2


def test_points_move_and_leave_the_border_unknown() -> None:
    screen = sliding(3.0)
    estimates, surfels = known(screen)
    after, new = advanced(estimates, surfels, NO_RATE, 1.0, screen.view(1.0))
    depth = depths(new, screen.view(1.0))
    assert torch.equal(after.color[:, :, 3:], estimates.color[:, :, :-3])
    assert (new.step[0, :, 3:] == 3.0).all() and (new.instance[:, :, :3] == UNSEEN).all()
    assert not after.known[:, :, :3].any() and depth[:, :, :3].isinf().all() and (depth[:, :, 3:] == 1.0).all()


def test_of_two_points_the_nearer_stays_and_of_equals_the_one_of_least_variance() -> None:
    """Half of the columns are slid over the other half, behind or in front of it."""
    for front in (0, 1):
        half = Layer(grey, lambda u, v, t: u < 0.0, lambda t: (torch.zeros_like(t), 0.5 * t, torch.zeros_like(t)))
        screen = Screen((half, Layer(grey)))
        estimates, surfels = known(screen)
        depth = torch.where(surfels.instance == 0, 2.0 - front, 1.0 + front)
        surfels = replace(surfels, point=torch.cat((surfels.point[:2], -depth)))
        _, new = advanced(estimates, surfels, NO_RATE, 1.0, screen.view(1.0))
        assert (new.instance[:, :, MIDDLE:] == (0 if front else 1)).all()
        assert (new.instance[:, :, :MIDDLE] == UNSEEN).all()
    same = replace(surfels, instance=torch.zeros_like(surfels.instance), point=surfels.point.clone())
    same.point[..., 1] = same.point[..., 0]
    better = estimates.aged + 0.01
    better[..., 1] = 0.0
    for aged, column in ((estimates.aged, 0), (better, 1)):
        after, _ = advanced(replace(estimates, aged=aged), same, NO_RATE, 0.0, screen.view(0.0))
        assert torch.equal(after.color[..., 0], estimates.color[..., column])


def test_colours_of_different_depths_are_never_mixed_and_a_hole_shows_the_farthest() -> None:
    estimates, surfels = known(sliding(0.0))
    left = torch.arange(SIDE) < MIDDLE
    color = left.to(torch.float32).expand(3, SIDE, SIDE).contiguous()
    depth = torch.where(left, 2.0, 9.0).to(torch.float64).expand(1, SIDE, SIDE).contiguous()
    at = surfels.position.clone()
    at[0] += torch.where(left, 0.4, -0.4)  # both sides lean over the edge
    surfels = replace(surfels, position=at, step=torch.ones_like(at))
    estimates = replace(estimates, color=color, inverse=torch.full_like(estimates.inverse, 1e-6))
    shown, _ = drawn(estimates, surfels, depth)
    assert (shown[:, :, left] > 0.999).all() and (shown[:, :, ~left] < 0.001).all()
    for column in (MIDDLE - 1, MIDDLE):
        time_s, aged, holed = estimates.time_s.clone(), estimates.aged.clone(), depth.clone()
        time_s[0, 5, column], aged[0, 5, column], holed[0, 5, column] = -torch.inf, 0.1, torch.inf
        shown, _ = drawn(replace(estimates, time_s=time_s, aged=aged), surfels, holed)
        assert shown[0, 5, column] < 0.01


def test_a_pixel_is_the_mean_of_the_points_around_it_by_distance_and_variance() -> None:
    """Every point lies a quarter of a pixel to the right: a pixel shows three quarters of its own, a quarter of the one
    on the left; where that one is of a ninth of the variance, a quarter of its own."""
    estimates, surfels = known(sliding(0.0))
    at = surfels.position.clone()
    at[0] += 0.25
    moving, depth = (
        replace(surfels, position=at, step=torch.ones_like(at)),
        torch.ones(1, SIDE, SIDE, dtype=torch.float64),
    )
    estimates = replace(estimates, roughness=1e-6 * torch.ones_like(estimates.roughness))
    alternate = (torch.arange(SIDE) % 2).to(torch.float32).expand(3, SIDE, SIDE).contiguous()
    for ratio, own in ((1.0, 0.75), (9.0, 0.25)):
        aged = torch.where(alternate[:1] > 0.0, ratio * 1e-9, 1e-9)
        inverse = torch.zeros_like(aged)
        certain = replace(estimates, color=alternate, aged=aged, inverse=inverse)
        assert torch.allclose(drawn(certain, moving, depth)[0][:, :, 3::2], torch.tensor(own), atol=1e-2)
        still = drawn(certain, replace(moving, step=0.0 * at), depth)[0]
        assert torch.allclose(still, alternate, atol=2e-2), "what stands still is drawn in its pixel alone"
