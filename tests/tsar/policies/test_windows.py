"""Pictures of any shape: not square, sides no powers of two, down to 16 pixels; every policy that takes them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from renderer.stages.control import stages
from tests.oracles.screens import Layer, Screen
from tsar.clock import fixed_clock
from tsar.config import ConfigError, TilingConfig, TsarConfig
from tsar.policies import POLICIES
from tsar.policy import Setting, run
from tsar.roots import encoded
from tsar.types import FrameletBatch, SampleBatch, ShownImage

FRAMED = ("framed", "framed-1", "framed-super", "framed-half", "framed-quarter", "framed-taa", "framed-late")
ADAPTIVE = ("tsar", "filter", "tsar-wavelets", "thesis", "frameless", "afr", "afr-simple")
SHAPES = ((101, 58), (48, 80), (128, 72), (16, 23))
"""Widths and heights."""
COMPILED = ("tsar", "filter", "thesis")


def picture(u: Tensor, v: Tensor, t: Tensor) -> Tensor:
    value = 0.5 + 0.3 * torch.sin(9.0 * u + 5.0 * v)
    return torch.stack((value, 0.9 * value, 0.8 * value), dim=-1)


def disk(u: Tensor, v: Tensor, t: Tensor) -> Tensor:
    return torch.hypot(u, v) < 0.2


STILL = Screen((Layer(picture),))
MOVING = Screen(
    (Layer(lambda u, v, t: picture(v, u, t), disk, lambda t: (0.0 * t, 0.5 * t, 0.1 * t)), Layer(picture)),
    lambda t: (0.3 * t, -0.2 * t),
)


def config_of(width: int, height: int) -> TsarConfig:
    return TsarConfig(
        batch_size=4,
        width_px=width,
        height_px=height,
        sdf_side=32,
        cache_size=64,
        warmup_cycles=8,
        tiling=TilingConfig(level_min=1),
    )


def shown(policy: str, shape: tuple[int, int], screen: Screen, end_s: float = 0.3, threads: int = 0) -> Iterator:
    """Positions of each cycle's samples, and what is shown; threads of the compiled stages, 0 for the reference's."""
    asked: list[FrameletBatch] = []

    def trace(batch: FrameletBatch) -> SampleBatch:
        asked.append(batch)
        return screen.trace(batch)

    config = config_of(*shape)
    setting = Setting(config, view=screen.view)
    if threads:
        setting = replace(setting, stages_of=lambda config: stages(config, threads=threads))
    made = POLICIES[policy](setting)
    cycle_s = max(made.price.samples / config.budget / 64.0, 1.0 / 512.0)
    for _, image in run(made, trace, fixed_clock(cycle_s), 0.0, end_s):
        yield asked[-1], image


def truth(screen: Screen, time_s: float, shape: tuple[int, int], axis: int = 4) -> Tensor:
    width, height = shape
    x, y = ((torch.arange(side * axis) + 0.5) / (side * axis) for side in shape)
    place = torch.stack(torch.meshgrid(x, y, indexing="xy"), dim=-1).to(torch.float32)
    nothing = torch.zeros(height * axis, dtype=torch.int64)
    color = screen.trace(FrameletBatch(nothing, nothing, place, time_s)).color
    return color.reshape(height, axis, width, axis, 3).mean((1, 3))


def error(image: ShownImage, screen: Screen, shape: tuple[int, int]) -> Tensor:
    """Squared error of each pixel, encoded."""
    return (encoded(image.image) - encoded(truth(screen, image.display_time_s, shape))).square().mean(2)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("policy", [*FRAMED, *ADAPTIVE])
def test_a_still_picture_of_any_shape_is_shown_up_to_its_border(policy: str, shape: tuple[int, int]) -> None:
    """All samples lie on the picture, images and maps have its shape, and the error is small, at the border too."""
    width, height = shape
    first = last = None
    for batch, image in shown(policy, shape, STILL):
        assert 0.0 <= float(batch.position.min()) and float(batch.position.max()) < 1.0
        assert image.image.shape == (height, width, 3) and bool(image.image.isfinite().all())
        first, last = first if first is not None else image, image
    assert last is not None and first is not None
    found = error(last, STILL, shape)
    inner = found[2:-2, 2:-2].mean()
    rim = torch.cat([found[:2].flatten(), found[-2:].flatten(), found[:, :2].flatten(), found[:, -2:].flatten()]).mean()
    print("RES", policy, shape, float(found.mean()), float(inner), float(rim))
    for one in last.maps.values():
        assert abs(one.values.shape[1] / one.values.shape[0] - width / height) < 0.03
    assert last.sample_map is not None and last.sample_map.newest_s.shape in ((1, 1), (height, width))


@pytest.mark.parametrize("policy", ADAPTIVE)
def test_what_is_sampled_changes_from_cycle_to_cycle_over_all_of_the_picture(policy: str) -> None:
    seen = torch.zeros(8, 8, dtype=torch.int64)
    for batch, _ in shown(policy, (101, 58), MOVING):
        cell = (batch.position.reshape(-1, 2) * 8).to(torch.int64)
        seen.view(-1).index_add_(0, cell[:, 1] * 8 + cell[:, 0], torch.ones(len(cell), dtype=torch.int64))
    assert int(seen.min()) > 0


@pytest.mark.parametrize("policy", ["tsar", "framed-taa", "framed-late", "afr"])
def test_surfaces_that_move_are_followed(policy: str) -> None:
    """The camera moves past a picture at 30 % of its width a second: what is shown is nearer to what is to be seen then
    than to what was a quarter of a second earlier."""
    *_, (_, last) = shown(policy, (101, 58), MOVING)
    late = replace(last, display_time_s=last.display_time_s - 0.25)
    assert float(error(last, MOVING, (101, 58)).mean()) < 0.3 * float(error(late, MOVING, (101, 58)).mean())


@pytest.mark.parametrize("shape", [(101, 58), (16, 23)], ids=str)
@pytest.mark.parametrize("policy", COMPILED)
def test_compiled_stages_show_what_the_reference_does(policy: str, shape: tuple[int, int]) -> None:
    theirs = [image.image for _, image in shown(policy, shape, MOVING, 0.15)]
    for threads in (1, 3):
        ours = [image.image for _, image in shown(policy, shape, MOVING, 0.15, threads)]
        assert len(ours) == len(theirs)
        if policy == "thesis":
            assert max(float((a - b).abs().max()) for a, b in zip(ours, theirs, strict=True)) < 1e-4
        else:
            assert all(torch.equal(a, b) for a, b in zip(ours, theirs, strict=True))


@pytest.mark.parametrize("policy", ["tsar-densities", "tsar-densities-wavelets", "interruptible"])
def test_policies_of_squares_alone_say_so(policy: str) -> None:
    with pytest.raises(ConfigError, match="width_px, height_px: expected a square of resolution_px for the policy"):
        POLICIES[policy](Setting(config_of(101, 58), view=STILL.view))


def test_the_square_around_a_picture_follows_from_its_sides() -> None:
    assert [TsarConfig(width_px=w, height_px=h).resolution_px for w, h in ((1920, 1080), (300, 400), (513, 9))[:2]] == [
        2048,
        512,
    ]
    assert TsarConfig(width_px=256, height_px=256, resolution_px=256).window.whole
    for bad in ({"width_px": 320}, {"width_px": 320, "height_px": 8}, {"width_px": 20000, "height_px": 64}):
        with pytest.raises(ConfigError, match=r"(width|height)_px: expected between 16 and 16384"):
            TsarConfig(**bad)
    with pytest.raises(ConfigError, match="resolution_px: expected none beside width_px and height_px"):
        TsarConfig(width_px=320, height_px=180, resolution_px=256)
