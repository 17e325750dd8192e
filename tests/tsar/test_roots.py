"""Square roots to the last bit."""

import math

import pytest
import torch

from tsar.roots import square_root


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_roots_are_the_nearest_numbers(dtype: torch.dtype) -> None:
    generator = torch.Generator().manual_seed(0)
    values = torch.rand(3, 5000, generator=generator, dtype=dtype) * 10.0 ** torch.arange(-1, 2)[:, None]
    exact = [math.sqrt(value) for value in values.flatten().tolist()]
    assert torch.equal(square_root(values).flatten(), torch.tensor(exact, dtype=torch.float64).to(dtype))
    assert torch.equal(square_root(values.T), square_root(values).T)


def test_odd_values() -> None:
    values = torch.tensor([0.0, torch.inf, 1e-45, -1.0, torch.nan])
    roots = square_root(values)
    assert roots[:2].tolist() == [0.0, math.inf] and 0.0 < float(roots[2]) < 1e-22 and bool(roots[3:].isnan().all())
    assert float(square_root(torch.tensor(2.0))) == pytest.approx(math.sqrt(2.0))
