"""Noise of the samples told from detail of the picture."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest
import torch
from torch import Tensor

from renderer.stages.control import stages
from tests.oracles.screens import Layer, Screen
from tests.tsar.filtering.test_filter import CONFIG, checkers, error, shown
from tsar.filtering.noise import detailed
from tsar.filtering.options import FilterOptions
from tsar.filtering.records import Estimates
from tsar.policies.filter import Filter
from tsar.policy import Setting
from tsar.types import FrameletBatch, SampleBatch

SIDE = 64


def estimated(mean: Tensor, deviation: float, count: int) -> Estimates:
    """Estimates of encoded colours ``mean``, from ``count`` samples a pixel with normal noise; their roughness is the
    semivariance of the samples, that of the colours and that of the noise."""
    made = torch.Generator().manual_seed(3)
    color = (mean + deviation / count**0.5 * torch.randn(3, SIDE, SIDE, generator=made)).clamp(0.0, 1.0) ** 2
    between = 0.5 * (mean.diff(dim=2).square().mean() + mean.diff(dim=1).square().mean()) / 2.0
    one = torch.ones(1, SIDE, SIDE)
    never = torch.full((1, SIDE, SIDE), -inf, dtype=torch.float64)
    return Estimates(color, 0.0 * one, one / count, never, (float(between) + deviation**2) * one)


GREY = torch.full((3, SIDE, SIDE), 0.5)
DETAIL = (0.3 + 0.4 * torch.rand(1, SIDE, SIDE, generator=torch.Generator().manual_seed(5))).expand(3, -1, -1)


@pytest.mark.parametrize("count", [2, 4, 16])
def test_noise_confirms_only_what_its_samples_leave(count: int) -> None:
    """Noise alone: the mean is near ``g i``; a part of the pixels differ from their neighbours by chance."""
    estimates = estimated(GREY, 0.05, count)
    share = detailed(estimates) / estimates.roughness
    assert 1.0 / count <= float(share.min()) and float(share.mean()) < 1.25 / count + 0.1


@pytest.mark.parametrize("count", [2, 4, 16])
def test_detail_keeps_its_roughness(count: int) -> None:
    estimates = estimated(DETAIL, 0.0, count)
    share = detailed(estimates) / estimates.roughness
    assert float(share.median()) > 0.9 and float(share.max()) <= 1.0 + 1e-6


def test_one_sample_a_pixel_tells_nothing() -> None:
    estimates = estimated(GREY, 0.05, 1)
    assert torch.equal(detailed(estimates), estimates.roughness)


def test_nothing_outside_the_picture_counts() -> None:
    estimates = estimated(GREY, 0.05, 4)
    color = estimates.color.clone()
    color[:, 40:] = color[:, :, 31:] = 7.0
    found, wanted = detailed(replace(estimates, color=color), (40, 31)), detailed(estimates, (40, 31))
    assert torch.equal(found, wanted) and not found[:, 40:].any() and not found[:, :, 31:].any()


class Noisy(Screen):
    """A screen whose samples have noise that depends on their positions and times."""

    def trace(self, batch: FrameletBatch) -> SampleBatch:
        samples = super().trace(batch)
        place = batch.position.to(torch.float64) @ torch.tensor([7919.0, 104729.0], dtype=torch.float64)
        noise = torch.sin(1e3 * (place + 31.0 * batch.times))
        return replace(samples, color=samples.color * (1.0 + 0.6 * noise[..., None].to(torch.float32)))


def test_noisy_pictures_are_nearer_to_the_truth_and_others_stay_the_same() -> None:
    screen = Screen((Layer(lambda u, v, t: (0.3 + 0.2 * u)[..., None].expand(*u.shape, 3)),))
    found = {}
    for noise in (True, False):
        setting = Setting(CONFIG, stages, view=screen.view, random=lambda: True)
        last = shown(Filter(setting, FilterOptions(noise=noise)), Noisy(screen.layers), 0.3)[-1]
        found[noise] = error(last, screen, 0.3)
    assert found[True] < 0.7 * found[False], found
    sharp = Screen((Layer(checkers),))
    images = [
        shown(Filter(Setting(CONFIG, stages, view=sharp.view), FilterOptions(noise=noise)), sharp, 0.1)[-1].image
        for noise in (True, False)
    ]
    assert torch.equal(*images)


def test_the_compiled_picture_of_noise_is_that_of_the_reference() -> None:
    screen = Noisy((Layer(checkers),))
    images = [
        shown(Filter(Setting(CONFIG, made, view=screen.view, random=lambda: True)), screen, 0.1)[-1].image
        for made in (stages, lambda config: stages(config, "reference"))
    ]
    assert torch.equal(*images)
