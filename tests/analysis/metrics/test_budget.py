"""Shares of an image's error on constructed images: they add up, and each finds the error that was put there."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from analysis.metrics.budget import SHARES, Places, budget
from analysis.metrics.quality import encode, pixel_errors

SIDE = 16
NONE = torch.zeros(SIDE, SIDE, dtype=torch.bool)
NOWHERE = Places(NONE, NONE)


def picture(seed: int) -> Tensor:
    return torch.rand(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(seed))


def left(columns: int) -> Tensor:
    found = NONE.clone()
    found[:, :columns] = True
    return found


@given(st.integers(0, 10_000), st.integers(0, 8), st.integers(0, 8))
def test_shares_add_up_to_the_error(seed: int, uncovered: int, relit: int) -> None:
    shown, carried, late, now = (picture(seed + one) * 1.3 for one in range(4))
    places = Places(left(uncovered), left(relit).flip(1))
    found = budget(shown, carried, late, now, places)
    assert sum(found[name] for name in SHARES) == pytest.approx(pixel_errors(shown, now)[0].mse, rel=1e-6)
    assert found["floor"] == pytest.approx(pixel_errors(late, now)[0].mse, rel=1e-6)
    assert (found["uncovered"], found["relit"]) == (uncovered / SIDE, relit / SIDE)


def only(found: dict[str, float], name: str, mse: float) -> None:
    assert mse > 1e-3 and found[name] == pytest.approx(mse, rel=1e-6)
    assert all(found[other] == pytest.approx(0.0, abs=1e-12) for other in SHARES if other != name)


def test_a_perfect_late_picture_is_wrong_by_its_latency_alone() -> None:
    late, now = picture(1), picture(2)
    found = budget(late, late, late, now, Places(left(3), NONE))
    only(found, "latency", found["floor"])


def test_what_the_blends_make_of_a_perfect_picture_is_blur() -> None:
    now = picture(1)
    soft = now.mean((0, 1)).expand_as(now)
    found = budget(soft, soft, now, now, NOWHERE)
    only(found, "blur", pixel_errors(soft, now)[0].mse)
    assert found["floor"] == 0.0


@pytest.mark.parametrize(
    ("name", "places"),
    [
        ("disocclusion", Places(left(8), NONE)),
        ("shadows", Places(NONE, left(8))),
        ("aliasing", Places(left(8).logical_not(), NONE)),
    ],
)
def test_wrong_estimates_count_where_they_are(name: str, places: Places) -> None:
    """Only the left half is wrong, and it lies in one kind of place."""
    now = picture(1)
    shown = torch.where(left(8)[..., None], picture(2), now)
    only(budget(shown, now, now, now, places), name, pixel_errors(shown, now)[0].mse)


def test_what_offsets_the_latency_has_a_negative_share() -> None:
    """The picture was darker; the image is wrong in the other direction by half as much. By hand, in encoded values:
    terms of -0.2 and 0.1, an error of -0.1, shares of 0.02 and -0.01."""
    levels = torch.linspace(0.0, 1.0, 100_001)
    linear = lambda value: levels[(encode(levels.expand(3, -1).T[None])[0, :, 0] - value).abs().argmin()]  # noqa: E731
    shown, late, now = (torch.full((SIDE, SIDE, 3), float(linear(value))) for value in (0.5, 0.4, 0.6))
    found = budget(shown, late, late, now, NOWHERE)
    assert found["latency"] == pytest.approx(0.02, rel=1e-3) and found["aliasing"] == pytest.approx(-0.01, rel=1e-3)


def test_values_that_are_not_finite_count_as_black() -> None:
    now = picture(1)
    shown = now.clone()
    shown[0, 0] = torch.tensor([torch.nan, torch.inf, -torch.inf])
    black = now.clone()
    black[0, 0] = 0.0
    assert budget(shown, now, now, now, NOWHERE) == budget(black, now, now, now, NOWHERE)
