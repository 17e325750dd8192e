"""Images read between their pixels."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F

from tsar.policies.resampling import bilinear, cubic, nearest

GENERATOR = torch.Generator().manual_seed(0)
IMAGE = torch.rand(9, 12, 3, dtype=torch.float64, generator=GENERATOR)
PLACES = torch.rand(50, 2, dtype=torch.float64, generator=GENERATOR) * torch.tensor([14.0, 11.0]) - 1.0


def test_bilinear_is_that_of_torch() -> None:
    scaled = (PLACES + 0.5) / torch.tensor([6.0, 4.5]) - 1.0
    planes = IMAGE.permute(2, 0, 1)[None]
    expected = F.grid_sample(planes, scaled[None, None], padding_mode="border", align_corners=False)[0, :, 0].T
    assert torch.allclose(bilinear(IMAGE, PLACES), expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("read", [bilinear, cubic, nearest])
def test_centres_give_their_pixels(read) -> None:
    row, column = torch.meshgrid(torch.arange(9), torch.arange(12), indexing="ij")
    assert torch.equal(read(IMAGE, torch.stack([column, row], dim=-1).to(torch.float64)), IMAGE)


def test_cubic_keeps_squares() -> None:
    """Weights of Catmull and Rom give back any polynomial of second degree."""
    row, column = torch.meshgrid(*(torch.arange(n, dtype=torch.float64) for n in (9, 12)), indexing="ij")

    def curved(x, y):
        return (0.3 * x * x - x * y + 0.2 * y * y + 2.0 * x - y + 1.0)[..., None]

    inner = PLACES.clamp(min=1.0) * 0.7
    inner = torch.maximum(inner, torch.ones(2, dtype=torch.float64))
    assert torch.allclose(cubic(curved(column, row), inner), curved(*inner.unbind(-1)), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("read", [bilinear, cubic, nearest])
def test_beyond_the_border_its_pixels_repeat_and_nowhere_is_the_first(read) -> None:
    far = torch.tensor([[-50.0, 3.0], [500.0, 20.0], [torch.nan, torch.inf]], dtype=torch.float64)
    assert torch.allclose(read(IMAGE, far), torch.stack([IMAGE[3, 0], IMAGE[8, 11], IMAGE[0, 0]]))
