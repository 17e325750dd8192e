"""Stills without noise: nearer to the truth, and the same part of the picture where it is cropped."""

from __future__ import annotations

import pytest
import torch

from renderer.frames import pictures
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes.catalog import Look, load_seen

pytest.importorskip("pyoidn")
from analysis.tracer.denoising import denoised

SIZE = 64, 48


def test_a_noisy_still_comes_nearer_to_the_truth() -> None:
    renderer = Renderer(load_seen("quad-light", Look())[0])
    noisy = pictures(renderer, SamplePlan(1, "random"), *SIZE)
    truth = pictures(renderer, SamplePlan(256, "hammersley"), *SIZE)(0, 0.0)
    clear = denoised(noisy, lambda time_s: renderer, SIZE)(0, 0.0)

    def error(picture: torch.Tensor) -> float:
        return float((picture.clamp(0, 1).sqrt() - truth.clamp(0, 1).sqrt()).square().mean())

    assert clear.shape == truth.shape and clear.dtype == torch.float32
    assert error(clear) < 0.5 * error(noisy(0, 0.0))
    assert float(clear.mean()) == pytest.approx(float(truth.mean()), rel=0.05)
    part = denoised(
        pictures(renderer, SamplePlan(1, "random"), *SIZE, (8, 4, 40, 32)),
        lambda time_s: renderer,
        SIZE,
        (8, 4, 40, 32),
    )
    assert part(0, 0.0).shape == (32, 40, 3)


def test_values_that_are_not_finite_stay_to_be_counted_and_do_not_spread() -> None:
    renderer = Renderer(load_seen("quad-light", Look())[0])
    broken = torch.full((48, 64, 3), 0.25)
    broken[10, 10] = torch.tensor([float("nan"), float("inf"), -1.0])
    found = denoised(lambda number, time_s: broken, lambda time_s: renderer, SIZE)(0, 0.0)
    assert torch.equal(found.isfinite(), broken.isfinite())
