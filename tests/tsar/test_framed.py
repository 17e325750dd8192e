"""Framed renderers of several sizes: how late they are, what they cost, and what they show."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F

from tests.oracles import pictures, runs
from tsar.clock import fixed_clock
from tsar.config import ConfigError, TsarConfig
from tsar.policies.framed import Framed, PromptlyFramed
from tsar.policies.resampling import widened
from tsar.policy import Moment, Setting

CONFIG = TsarConfig(batch_size=16, resolution_px=128)
SIZES = {"framed": 128, "framed-1": 128, "framed-super": 256, "framed-half": 64, "framed-quarter": 32}
LATENCIES = {name: 2 if name == "framed" else 1 for name in SIZES}


def play(name: str, picture, cycles: int = 3, config: TsarConfig = CONFIG):
    return list(runs.images(name, config, pictures.tracer(picture), fixed_clock(0.1), 0.0, 0.1 * cycles))


def grid(picture, side: int, time_s: float) -> torch.Tensor:
    """The picture at the centres of a grid, ``(3, side, side)``."""
    centre = (torch.arange(side) + 0.5) / side
    x, y = centre[None].expand(side, side), centre[:, None].expand(side, side)
    return picture(x, y, torch.tensor(time_s)).permute(2, 0, 1)


@pytest.mark.parametrize("name", SIZES)
def test_latency_is_that_of_the_policy(name: str) -> None:
    shown = play(name, pictures.constant)
    assert shown[0].display_time_s <= 0.0, "something is on the display when measurement begins"
    assert all(one.display_time_s - one.sample_time_s == pytest.approx(0.1 * LATENCIES[name]) for one in shown)


@pytest.mark.parametrize("name", SIZES)
def test_a_frame_costs_its_samples(name: str) -> None:
    policy = runs.made(name, CONFIG)
    asked = policy.request(policy.start(), Moment(0.0, 0, 0.1))[1]
    assert policy.price.samples == asked.position[..., 0].numel() == SIZES[name] ** 2
    assert policy.footprint == SIZES[name] / 128
    assert (policy.price.pixel_flops > 0) == (SIZES[name] < 128)


@pytest.mark.parametrize("name", SIZES)
def test_a_frame_is_the_picture_at_its_samples(name: str) -> None:
    """Enlarged bilinearly, or averaged over pixels."""
    shown = play(name, pictures.textured_motion)[-1]
    sampled = grid(pictures.textured_motion, SIZES[name], shown.sample_time_s)[None]
    if SIZES[name] < 128:
        expected = F.interpolate(sampled, (128, 128), mode="bilinear", align_corners=False)
    else:
        expected = F.avg_pool2d(sampled, SIZES[name] // 128)
    assert torch.allclose(shown.image, expected[0].permute(1, 2, 0), atol=2e-6)


def test_a_frame_smaller_than_a_framelet_is_one_framelet() -> None:
    small = TsarConfig(batch_size=4, resolution_px=64, framelet_side=32)
    shown = play("framed-quarter", pictures.textured_motion, config=small)[-1]
    sampled = grid(pictures.textured_motion, 16, shown.sample_time_s)[None]
    expected = F.interpolate(sampled, (64, 64), mode="bilinear", align_corners=False)
    assert torch.allclose(shown.image, expected[0].permute(1, 2, 0), atol=2e-6)
    assert runs.made("framed-quarter", small).price.samples == 16**2


@pytest.mark.parametrize("axis", [3, 0.75, 0.0, -1.0, 1 / 256, float("nan"), float("inf")])
def test_sizes_that_do_not_divide_are_refused(axis: float) -> None:
    with pytest.raises(ConfigError, match="samples_per_axis: expected"):
        Framed(Setting(CONFIG), axis)
    assert PromptlyFramed(Setting(CONFIG), 1 / 128).price.samples == 1


@pytest.mark.parametrize("factor", [1, 2, 3, 4, 8])
def test_widening_is_bilinear_interpolation(factor: int) -> None:
    plane = torch.randn(3, 5, 7, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    expected = F.interpolate(plane[None], scale_factor=(1, factor), mode="bilinear", align_corners=False)[0]
    assert torch.allclose(widened(plane, factor), expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["framed-super", "framed-half", "framed-quarter"])
def test_threads_change_nothing(name: str) -> None:
    config, before, found = TsarConfig(batch_size=128, resolution_px=512), torch.get_num_threads(), []
    try:
        for threads in (1, 2, 3):
            torch.set_num_threads(threads)
            found.append(play(name, pictures.textured_motion, 1, config)[-1].image)
    finally:
        torch.set_num_threads(before)
    assert torch.equal(found[0], found[1]) and torch.equal(found[0], found[2])
