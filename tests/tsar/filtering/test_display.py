"""The picture of the estimates: what is known stays, what is not known takes its surroundings."""

import pytest
import torch

from tsar.filtering.display import smoothed


def test_what_is_known_keeps_its_colour_above_white_too() -> None:
    color = torch.rand(3, 16, 16, generator=torch.Generator().manual_seed(0)) * 8.0
    shown, remaining = smoothed(color, torch.full((1, 16, 16), 1e-9), torch.ones(1, 16, 16))
    torch.testing.assert_close(shown, color, rtol=1e-5, atol=1e-5)
    assert float(remaining.max()) < 2e-9


@pytest.mark.parametrize("lamp", [1.5, 16.0])
def test_uncertain_surroundings_of_a_lamp_are_the_mean_of_square_roots(lamp: float) -> None:
    color = torch.zeros(3, 2, 2)
    color[:, 0, 0] = lamp
    shown, _ = smoothed(color, torch.full((1, 2, 2), 0.05), torch.full((1, 2, 2), 1e-9))
    assert shown.flatten().tolist() == pytest.approx([lamp / 16.0] * 12, rel=1e-4)
