"""Pictures of any shape: not square, sides no powers of two, down to 16 pixels; every policy that takes them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from renderer.stages.control import stages
from tests.oracles.screens import Layer, Screen
from tsar.clock import StageTimer
from tsar.config import ConfigError, TilingConfig, TsarConfig
from tsar.morton import curve
from tsar.policies import POLICIES
from tsar.policies.framed import finite
from tsar.policy import Moment, Picture, Setting
from tsar.projection import project
from tsar.roots import encoded
from tsar.types import FrameletBatch
from tsar.window import Window

FRAMED = ("framed", "framed-1", "framed-super", "framed-half", "framed-quarter", "framed-taa", "framed-late")
ADAPTIVE = ("tsar", "filter", "thesis", "frameless", "afr", "afr-simple")
SHAPES = ((101, 58), (48, 80), (128, 72), (16, 23))
"""Widths and heights."""
LEAST = {"framed-half": 2e-4, "framed-quarter": 1e-3, "thesis": 1e-3, "framed-late": 1e-3}
"""Greatest error of a still picture of 101 x 58 pixels, where it is not 1e-4."""
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


def shown(
    policy: str, shape: tuple[int, int], screen: Screen, cycles: int, threads: int = 1
) -> Iterator[tuple[FrameletBatch, Picture, float]]:
    """Samples asked for, picture, and the time for which it is shown, of every cycle; threads of the compiled stages, 0
    for the reference's."""
    config = config_of(*shape)
    setting = Setting(config, view=screen.view)
    if threads:
        setting = replace(setting, stages_of=lambda config: stages(config, threads=threads))
    made = POLICIES[policy](setting)
    state, cycle_s = made.start(), max(made.price.samples / config.budget / 64.0, 1.0 / 256.0)
    for cycle in range(cycles):
        moment = Moment(cycle * cycle_s, cycle, cycle_s)
        asked, batch = made.request(state, moment)
        state = made.observe(asked, batch, screen.trace(batch), moment, StageTimer())
        yield batch, made.fitted(made.image(state, moment)), moment.time_s + made.latency_cycles * cycle_s


def truth(screen: Screen, time_s: float, shape: tuple[int, int], axis: int = 4) -> Tensor:
    width, height = shape
    x, y = ((torch.arange(side * axis) + 0.5) / (side * axis) for side in shape)
    place = torch.stack(torch.meshgrid(x, y, indexing="xy"), dim=-1).to(torch.float32)
    nothing = torch.zeros(height * axis, dtype=torch.int64)
    color = screen.trace(FrameletBatch(nothing, nothing, place, time_s)).color
    return color.reshape(height, axis, width, axis, 3).mean((1, 3))


def error(image: Tensor, screen: Screen, time_s: float, shape: tuple[int, int]) -> Tensor:
    """Squared error of each pixel, encoded."""
    return (encoded(image) - encoded(truth(screen, time_s, shape))).square().mean(2)


CASES = [*((policy, shape) for policy in (*FRAMED, *ADAPTIVE) for shape in SHAPES), ("tsar-wavelets", SHAPES[3])]


@pytest.mark.parametrize(("policy", "shape"), CASES, ids=str)
def test_a_still_picture_is_shown_up_to_its_border(policy: str, shape: tuple[int, int]) -> None:
    """All samples lie on the picture, images and maps have its shape, and the error falls, at the border too."""
    (width, height), last, errors = shape, None, []
    cycles = {"tsar": 120, "filter": 40, "tsar-wavelets": 30, "thesis": 40}.get(policy, 16)
    for batch, last, time_s in shown(policy, shape, STILL, cycles):
        assert 0.0 <= float(batch.position.min()) and float(batch.position.max()) < 1.0
        assert last.image.shape == (height, width, 3) and bool(last.image.isfinite().all())
        if not errors or len(errors) == cycles - 1:
            errors.append(error(last.image, STILL, time_s, shape))
        else:
            errors.append(errors[-1])
    assert last is not None
    mean, rim = float(errors[-1].mean()), torch.ones(height, width, dtype=torch.bool)
    rim[2:-2, 2:-2] = False
    least = LEAST.get(policy, 1e-4) * (101 * 58 / (width * height)) ** 1.5
    assert mean < least and (policy.startswith("framed") or mean < max(0.6 * float(errors[0].mean()), 1e-5))
    assert float(errors[-1][rim].mean()) < 12.0 * mean + 1e-6
    for rows, columns in (one.values.shape for one in last.maps.values()):
        assert height % rows == 0 and rows * width == columns * height
    assert last.sample_map is not None and last.sample_map.newest_s.shape in ((1, 1), (height, width))


@pytest.mark.parametrize("policy", ["tsar", "filter", "frameless", "afr", "afr-simple"])
def test_all_of_the_picture_is_sampled(policy: str) -> None:
    seen = torch.zeros(64, dtype=torch.int64)
    for batch, _, _ in shown(policy, (101, 58), MOVING, 120 if policy == "tsar" else 12):
        cell = (batch.position.reshape(-1, 2) * 8).to(torch.int64)
        seen.index_add_(0, cell[:, 1] * 8 + cell[:, 0], torch.ones(len(cell), dtype=torch.int64))
    assert int(seen.min()) > 0


@pytest.mark.parametrize("policy", ["tsar", "framed-taa-late", "framed-late", "afr"])
def test_surfaces_that_move_are_followed(policy: str) -> None:
    """The camera moves past a picture by a third of its width in a second: what is shown is nearer to what is to be
    seen then than to what was an eighth of a second earlier."""
    *_, (_, last, time_s) = shown(policy, (101, 58), MOVING, 160 if policy == "tsar" else 40)
    now, late = (float(error(last.image, MOVING, at, (101, 58)).mean()) for at in (time_s, time_s - 0.125))
    assert now < 0.5 * late


@pytest.mark.parametrize("shape", [(101, 58), (16, 23)], ids=str)
@pytest.mark.parametrize("policy", COMPILED)
def test_compiled_stages_show_what_the_reference_does(policy: str, shape: tuple[int, int]) -> None:
    theirs = [one.image for _, one, _ in shown(policy, shape, MOVING, 10, threads=0)]
    for threads in (1, 3):
        ours = [one.image for _, one, _ in shown(policy, shape, MOVING, 10, threads)]
        if policy == "thesis":
            assert max(float((a - b).abs().max()) for a, b in zip(ours, theirs, strict=True)) < 1e-4
        else:
            assert all(torch.equal(a, b) for a, b in zip(ours, theirs, strict=True))


@pytest.mark.parametrize("policy", ["tsar", "afr", "framed-late", "thesis"])
def test_threads_of_torch_do_not_change_a_bit(policy: str) -> None:
    found, before = [], torch.get_num_threads()
    for threads in (1, 3):
        torch.set_num_threads(threads)
        found.append([one.image for _, one, _ in shown(policy, (101, 58), MOVING, 6, threads=0)])
    torch.set_num_threads(before)
    assert all(torch.equal(a, b) for a, b in zip(*found, strict=True))


def test_nonfinite_samples_are_replaced_by_their_neighbours() -> None:
    height, width = 48, 80
    ramp = (torch.arange(height)[:, None] + torch.arange(width)).to(torch.float32)
    color = ramp.reshape(-1)[curve(height, width)][:, None].repeat(1, 3)
    spoiled = color.clone()
    spoiled[::37] = torch.nan
    found = finite(spoiled[None], (height, width), 16).reshape(-1, 3)
    assert float((found - color).abs().max()) <= 2.0


def test_the_poses_of_a_plane_place_things_where_those_of_the_picture_do() -> None:
    window, place = (
        Window(300, 170, 512),
        torch.rand(64, 2, generator=torch.Generator().manual_seed(0)).to(torch.float64),
    )
    for kind, far in (("parallel", 1.0), ("perspective", 3.0)):
        view = replace(MOVING.view(0.3), kind=kind, tan_x=0.9, tan_y=0.5)
        depth = 1.0 + torch.arange(64.0) / far
        unit = depth if kind == "perspective" else torch.ones(64)
        seen = torch.stack(((2 * place[:, 0] - 1) * 0.9 * unit, (1 - 2 * place[:, 1]) * 0.5 * unit, -depth), dim=1)
        world = seen - view.to_camera_offset
        point = torch.linalg.solve(view.rotation[0], (world - view.translation[0]).T).T
        instance = torch.zeros(64, dtype=torch.int64)
        there, at = project(window.on_plane(view), instance, point)
        wanted = place * torch.tensor([300.0, 170.0]) / 512.0
        assert torch.allclose(there, wanted, atol=1e-6) and torch.allclose(at, depth.to(torch.float64), atol=1e-6)


@pytest.mark.parametrize("policy", ["tsar-densities", "tsar-densities-wavelets", "surfel", "interruptible"])
def test_policies_of_squares_alone_say_so(policy: str) -> None:
    with pytest.raises(ConfigError, match="width_px, height_px: expected a square of resolution_px for the policy"):
        POLICIES[policy](Setting(config_of(101, 58), view=STILL.view))


def test_the_square_around_a_picture_follows_from_its_sides() -> None:
    sides = [TsarConfig(width_px=w, height_px=h).resolution_px for w, h in ((1920, 1080), (300, 400), (513, 64))]
    assert sides == [2048, 512, 1024]
    assert TsarConfig(width_px=256, height_px=256, resolution_px=256).window.whole
    for bad in ({"width_px": 320}, {"width_px": 320, "height_px": 8}, {"width_px": 20000, "height_px": 64}):
        with pytest.raises(ConfigError, match=r"(width|height)_px: expected between 16 and 16384"):
            TsarConfig(**bad)
    with pytest.raises(ConfigError, match="resolution_px: expected none beside width_px and height_px"):
        TsarConfig(width_px=320, height_px=180, resolution_px=256)
