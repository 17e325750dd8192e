"""The filter's compiled stages against the reference: the same bits, whatever the threads."""

from __future__ import annotations

from dataclasses import fields, replace
from math import inf

import pytest
import torch
from torch import Tensor

from renderer.stages.control import stages
from renderer.stages.filtering import filter_stages
from tests.oracles.screens import Layer, Screen
from tsar.config import TilingConfig, TsarConfig
from tsar.filtering.noise import detailed
from tsar.filtering.options import DEFAULT, FilterOptions
from tsar.filtering.records import ELEMENT_PX, UNSEEN, VARIANCE_MAX, Estimates, Surfels, centres
from tsar.filtering.stages import FilterStages
from tsar.policies.filter import Filter
from tsar.policy import Moment, Setting, step
from tsar.types import Hits, Viewpoint

REFERENCE = FilterStages()
SIDES = [16, 64, 128]


def equal(ours: object, theirs: object) -> None:
    for field in fields(theirs):  # type: ignore[arg-type]
        mine, wanted = getattr(ours, field.name), getattr(theirs, field.name)
        assert mine.dtype is wanted.dtype and torch.equal(mine, wanted), field.name


def planes(side: int, seed: int) -> tuple[Tensor, Tensor, Tensor]:
    """Colours, variances up to the greatest, and roughnesses over many octaves."""
    made = torch.Generator().manual_seed(seed)
    variance = torch.rand(1, side, side, generator=made) ** 4 * VARIANCE_MAX
    roughness = 10.0 ** (-6.0 * torch.rand(1, side, side, generator=made))
    return torch.rand(3, side, side, generator=made), variance, roughness


def rates(side: int, seed: int) -> Tensor:
    """Variances per second of elements."""
    return planes(side // ELEMENT_PX, seed + 50)[1] + 1e-5


def scene(side: int, kind: str, seed: int) -> tuple[Estimates, Surfels, Viewpoint]:
    """Surfels of three instances that have moved by up to some pixels, of the sky, and of pixels that hold none."""
    made = torch.Generator().manual_seed(seed)
    color, variance, roughness = planes(side, seed)

    def uniform(*shape: int) -> Tensor:
        return torch.rand(*shape, generator=made)

    seen = torch.where(uniform(1, side, side) < 0.1, torch.tensor(-inf, dtype=torch.float64), 0.5)
    estimates = Estimates(color, variance, uniform(1, side, side), seen, roughness)
    across = (centres(side) / side - 0.5) * 2.0
    depth = 1.0 + (uniform(1, side, side) * 3.0).floor()
    point = torch.cat((across[:1] * depth, -across[1:] * depth, -depth))
    instance = torch.randint(UNSEEN, 3, (1, side, side), generator=made)
    angle = torch.tensor([0.0, 0.03, -0.05], dtype=torch.float64)
    rotation = torch.zeros(3, 3, 3, dtype=torch.float64)
    rotation[:, 0, 0] = rotation[:, 1, 1] = angle.cos()
    rotation[:, 0, 1], rotation[:, 1, 0], rotation[:, 2, 2] = -angle.sin(), angle.sin(), 1.0
    translation = torch.tensor([[0.0, 0.0, 0.0], [0.03, 0.0, 0.1], [0.0, -0.02, 2.5]], dtype=torch.float64)
    view = Viewpoint(0.5, torch.arange(3), rotation, translation, torch.eye(3, dtype=torch.float64),
                     torch.tensor([0.01, 0.0, 0.0], dtype=torch.float64), kind, 1.0, 1.0)  # type: ignore[arg-type]  # fmt: skip
    return estimates, Surfels(instance, point, centres(side) + 0.1, uniform(2, side, side)), view


@pytest.mark.parametrize("threads", [1, 3, 16])
@pytest.mark.parametrize("kind", ["perspective", "parallel"])
@pytest.mark.parametrize("side", SIDES)
def test_surfels_move_as_the_reference_moves_them(side: int, kind: str, threads: int) -> None:
    compiled = filter_stages(side, threads)
    assert compiled.advanced is not REFERENCE.advanced
    for seed in range(4):
        estimates, surfels, view = scene(side, kind, seed)
        arguments = estimates, surfels, rates(side, seed), 0.02 * seed, view
        for ours, theirs in zip(compiled.advanced(*arguments), REFERENCE.advanced(*arguments), strict=True):
            equal(ours, theirs)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("side", SIDES)
def test_tiles_are_those_of_the_reference(side: int, threads: int) -> None:
    compiled = filter_stages(side, threads)
    for seed in range(4):
        _, variance, roughness = planes(side, seed)
        surfels = scene(side, "perspective", seed)[1] if seed else None
        count = 1 + seed * (side // 16) ** 2
        arguments = variance, roughness, rates(side, seed), surfels, 0.01, count, DEFAULT
        for ours, theirs in zip(compiled.chosen(*arguments), REFERENCE.chosen(*arguments), strict=True):
            assert torch.equal(ours, theirs)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("side", SIDES)
def test_pictures_are_those_of_the_reference(side: int, threads: int) -> None:
    compiled = filter_stages(side, threads)
    for seed in range(4):
        estimates, surfels, _ = scene(side, "perspective", seed)
        between = planes(side, seed + 20)[2] if seed > 1 else None
        arguments = estimates, surfels if seed % 2 else None, rates(side, seed), 0.02 * seed, between
        for ours, theirs in zip(compiled.displayed(*arguments), REFERENCE.displayed(*arguments), strict=True):
            assert torch.equal(ours, theirs)


@pytest.mark.parametrize("threads", [1, 3, 16])
@pytest.mark.parametrize("picture", [(16, 16), (64, 64), (64, 1), (33, 50), (1, 64)])
def test_noise_is_told_as_in_the_reference(picture: tuple[int, int], threads: int) -> None:
    side = 16 if max(picture) <= 16 else 64
    compiled = filter_stages(side, threads, picture)
    for seed in range(3):
        estimates, _, _ = scene(side, "perspective", seed)
        inverse = estimates.inverse if seed else torch.ones_like(estimates.inverse)
        smooth = replace(estimates, color=0.5 + 0.1 * seed * (estimates.color - 0.5), inverse=inverse)
        assert torch.equal(compiled.detailed(smooth), detailed(smooth, picture))


@pytest.mark.parametrize("kind", ["perspective", "parallel"])
@pytest.mark.parametrize("side", SIDES)
def test_shadows_move_as_in_the_reference(side: int, kind: str) -> None:
    compiled = filter_stages(side)
    for seed in range(4):
        _, surfels, view = scene(side, kind, seed)
        angle = view.rotation.flip(0) if seed % 2 else view.rotation
        earlier = replace(view, rotation=angle, translation=view.translation + 0.01 * (seed + 1))
        made = torch.Generator().manual_seed(seed)
        count = (side // 8) ** 2
        instance, occluder = torch.randint(-2, 3, (2, count, 64), generator=made, dtype=torch.int32)
        point = surfels.point.reshape(3, -1)[:, : count * 64].T.reshape(count, 64, 3).contiguous()
        hits = Hits(instance.clamp(min=-1), point, occluder)
        before = rates(side, seed)
        arguments = before, torch.rand(count, 64, 2, generator=made), hits, view, earlier, 0.02
        found, wanted = compiled.drifted(*arguments), REFERENCE.drifted(*arguments)
        assert torch.equal(found, wanted)
        assert (wanted > 0.0).any() and not torch.equal(wanted, before)


OPTIONS = {
    "tsar": DEFAULT,
    "filter": FilterOptions(reprojection=False, probes=False, share_max=1.0),
    "replaces": FilterOptions(accumulation=False, spread=False),
}


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_runs_have_the_bits_of_the_reference(options: FilterOptions) -> None:
    def checkers(u, v, t):
        value = 0.5 + 0.3 * torch.sign(torch.sin(50.0 * u) * torch.sin(35.0 * v))
        return value[..., None].expand(*u.shape, 3)

    screen = Screen((Layer(checkers),), lambda t: (t / 2.0, torch.zeros_like(t)))
    config = TsarConfig(batch_size=4, resolution_px=64, tiling=TilingConfig(level_min=1))
    setting = Setting(config, view=screen.view)
    reference = Filter(setting, options)
    compiled = Filter(replace(setting, stages_of=lambda config: stages(config, threads=2)), options)
    ours, theirs = compiled.start(), reference.start()
    for cycle in range(40):
        moment = Moment(cycle / 200.0, cycle, 1.0 / 200.0)
        one = step(compiled, ours, screen.trace, moment)
        other = step(reference, theirs, screen.trace, moment)
        assert torch.equal(one.shown.image, other.shown.image), cycle
        ours, theirs = one.after, other.after
    for name in ("estimates", "surfels", "change"):
        equal(getattr(ours, name), getattr(theirs, name))
