"""What came into sight, and where the light changed, on scenes where that is known exactly."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from analysis.study.sight import first_hits, places
from tests.oracles.screens import Layer, Screen
from tsar.types import Hits

SIDE = 32


def grey(u, v, t):
    return torch.full((*u.shape, 3), 0.5)


def square(left: float, right: float):
    return lambda u, v, t: (u >= left) & (u < right)


def columns(flags: Tensor) -> list[int]:
    """Numbers of the columns that are marked; each is marked whole or not at all."""
    assert bool((flags == flags[:1]).all())
    return flags[0].nonzero().squeeze(1).tolist()


def moving(pixels_per_s: float) -> Screen:
    """A board of 8 columns, whose left edge is at column 8 at time 0, before a wall."""

    def pose(t):
        return torch.zeros_like(t), pixels_per_s / SIDE * t, torch.zeros_like(t)

    return Screen((Layer(grey, square(-0.25, 0.0), pose), Layer(grey)))


def between(screen: Screen, before_s: float, now_s: float):
    now, before = (first_hits(screen.trace, SIDE, time_s) for time_s in (now_s, before_s))
    return places(now, before, screen.view(before_s))


def test_a_board_uncovers_the_wall_behind_it() -> None:
    """It moves 4 columns to the right: columns 8 to 11 come into sight, and a pixel beside them on each side."""
    found = between(moving(4.0), 0.0, 1.0)
    assert columns(found.uncovered) == [*range(7, 13)] and not found.relit.any()


def test_what_stands_still_has_not_come_into_sight() -> None:
    found = between(moving(0.0), 0.0, 1.0)
    assert not found.uncovered.any() and not found.relit.any()


@pytest.mark.parametrize(("shift", "first"), [(4.0, 28), (4.3, 28), (4.6, 27)])
def test_a_camera_uncovers_what_was_outside(shift: float, first: int) -> None:
    """Pixels whose centres lay beyond the border, and one beside them."""
    screen = Screen((Layer(grey),), lambda t: (shift / SIDE * t, torch.zeros_like(t)))
    found = between(screen, 0.0, 1.0)
    assert columns(found.uncovered) == [*range(first - 1, SIDE)]


def lit(hits: Hits, first: int, last: int) -> Hits:
    """All but some columns of the picture see the light."""
    shaded = torch.arange(SIDE).repeat(SIDE)
    occluder = torch.where((shaded >= first) & (shaded < last), 5, -1)
    return replace(hits, occluder=occluder[None].to(torch.int32))


def test_a_shadow_that_slides_changes_the_light_at_both_ends() -> None:
    """Columns 8 to 11 have the light again and 18 to 21 have lost it, with a pixel beside them on each side."""
    screen = Screen((Layer(grey),))
    hits = first_hits(screen.trace, SIDE, 0.0)
    found = places(lit(hits, 12, 22), lit(hits, 8, 18), screen.view(0.0))
    assert columns(found.relit) == [*range(7, 13), *range(17, 23)]
    assert not found.uncovered.any()


def test_a_shadow_that_goes_with_the_surface_changes_nothing() -> None:
    """Both ends are found again among the nearest pixels, also where the camera moved by a part of a pixel."""
    screen = Screen((Layer(grey),), lambda t: (3.5 / SIDE * t, torch.zeros_like(t)))
    now, before = (first_hits(screen.trace, SIDE, time_s) for time_s in (1.0, 0.0))
    found = places(lit(now, 8, 16), lit(before, 12, 20), screen.view(0.0))
    assert not found.relit.any()


def test_another_instance_at_the_same_depth_is_not_the_same_surface() -> None:
    screen = Screen((Layer(grey),))
    hits = first_hits(screen.trace, SIDE, 0.0)
    other = replace(hits, instance=torch.where(torch.arange(SIDE).repeat(SIDE) < 4, 1, hits.instance[0])[None].int())
    two = replace(screen.view(0.0), track_of_instance=torch.tensor([0, 0]))
    assert columns(places(other, hits, two).uncovered) == [*range(5)]


def test_a_renderer_that_returns_no_hits_is_refused() -> None:
    screen = Screen((Layer(grey),))
    with pytest.raises(ValueError, match="returns them"):
        first_hits(lambda batch: replace(screen.trace(batch), hits=None), SIDE, 0.0)
