"""Framed renderers that accumulate and warp, on planes whose truth is known exactly."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
import torch.nn.functional as F

from tests.oracles.planes import Planes, fine
from tsar.clock import StageTimer, fixed_clock
from tsar.config import ConfigError, TsarConfig
from tsar.policies import POLICIES
from tsar.policies.reprojected import PARTS, Reprojected
from tsar.policy import Moment, Setting, run
from tsar.types import ShownImage

CONFIG = TsarConfig(batch_size=16, resolution_px=64)
NAMES = ("framed-taa", "framed-late", "framed-taa-late")
FRAME_S = 0.128


def made(name: str, scene: Planes, config: TsarConfig = CONFIG) -> Reprojected:
    policy = POLICIES[name](Setting(config, view=scene.view))
    assert isinstance(policy, Reprojected)
    return policy


def play(name: str, scene: Planes, seconds: float = 0.3, config: TsarConfig = CONFIG) -> list[ShownImage]:
    """Images whose frames take :data:`FRAME_S`."""
    policy = made(name, scene, config)
    cycle_s = FRAME_S * policy.price.samples / config.resolution_px**2
    return [shown for _, shown in run(policy, scene.trace, fixed_clock(cycle_s), 0.0, seconds)]


def error(shown: torch.Tensor, truth: torch.Tensor, border: int = 0) -> float:
    inner = slice(border, shown.shape[0] - border)
    return float((shown - truth)[inner, inner].square().mean())


@pytest.mark.parametrize("name", NAMES)
def test_poses_are_never_later_than_the_cycle_and_one_cycle_late(name: str) -> None:
    scene, asked = Planes(pan=0.5), list[float]()

    def view(time_s: float):
        asked.append(time_s)
        return scene.view(time_s)

    policy, cycle_s = POLICIES[name](Setting(CONFIG, view=view)), 0.02
    cycles = run(policy, scene.trace, fixed_clock(cycle_s), 0.0, 0.1)
    starts = [next(cycles)[1].sample_time_s]
    asked.clear()  # of the cycles before the run
    for _, shown in cycles:
        starts.append(shown.sample_time_s)
        assert shown.display_time_s - shown.sample_time_s == pytest.approx(cycle_s)
        assert max(asked, default=starts[0]) <= shown.sample_time_s
    assert starts[0] <= 0.0 < starts[-1] and set(starts[-3:]) <= set(asked)


@pytest.mark.parametrize("name", NAMES)
def test_a_frame_is_asked_for_once_in_parts_of_one_time(name: str) -> None:
    scene = Planes()
    policy = made(name, scene)
    state, positions, times, samples = policy.start(), [], set(), 0
    parts = CONFIG.resolution_px**2 // policy.price.samples
    assert (parts > 1) == ("late" in name)
    for cycle in range(parts):
        moment = Moment(0.1 * cycle, cycle, 0.1)
        state, batch = policy.request(state, moment)
        assert batch.hits and batch.position[..., 0].numel() == policy.price.samples
        state = policy.observe(state, batch, scene.trace(batch), moment, StageTimer())
        positions.append(batch.position.reshape(-1, 2))
        times.add(batch.time_s)
        samples += policy.price.samples
    assert times == {0.0} and samples == CONFIG.resolution_px**2 and state.number == 1
    cells = (torch.cat(positions) * 64).floor().to(torch.int64)
    assert (cells[:, 1] * 64 + cells[:, 0]).unique().numel() == 64**2, "one in every pixel"
    assert bool((torch.cat(positions) * 65536 % 1 == 0).all())


def test_what_is_done_beside_tracing_is_charged() -> None:
    prices = {name: made(name, Planes()).price for name in NAMES}
    assert not any(price.adaptive_stages or price.sample_flops for price in prices.values())
    taa, late, both = (prices[name].pixel_flops for name in NAMES)
    parts = 64**2 // prices["framed-late"].samples
    assert taa > 0 and late > 0 and both == pytest.approx(late + taa / parts)


@pytest.mark.parametrize("name", NAMES)
def test_a_still_scene_converges_or_stays_as_it_is(name: str) -> None:
    """Stripes finer than a pixel: the mean of jittered samples is far nearer to the truth than one sample."""
    scene = Planes(fine)
    shown = play(name, scene)[-1].image
    truth, one = scene.image(64, 0.0, 8), scene.image(64, 0.0)
    if name == "framed-late":
        assert torch.allclose(shown, one, atol=1e-5), "nothing moves, so nothing is warped"
    else:
        assert error(shown, truth) < 0.15 * error(one, truth)


@pytest.mark.parametrize("pan", [0.3, -0.3])
@pytest.mark.parametrize("name", NAMES)
def test_a_pan_is_followed(name: str, pan: float) -> None:
    """A warp shows the poses of the middle of its display; a frame shows those of its own time."""
    scene = Planes(pan=pan)
    for shown in play(name, scene)[-6:]:
        middle_s = shown.display_time_s + 0.5 * FRAME_S / PARTS
        right = scene.image(64, middle_s if "late" in name else shown.sample_time_s, 4)
        late = scene.image(64, shown.sample_time_s - FRAME_S, 4)
        # what comes into view within two frames is not known
        found, wrong = (error(shown.image, truth, border=8) for truth in (right, late))
        assert found < 2e-4 < 1e-2 < wrong


def test_accumulation_follows_a_pan() -> None:
    """Of stripes finer than a pixel, at a whole number of pixels a frame."""
    scene = Planes(fine, pan=2.0 / 64 / FRAME_S)
    shown = play("framed-taa", scene)[-1]
    truth, one = scene.image(64, shown.sample_time_s, 8), scene.image(64, shown.sample_time_s)
    assert error(shown.image, truth, border=4) < 0.35 * error(one, truth, border=4)


def test_a_square_is_shown_where_it_is_and_leaves_the_background() -> None:
    """It moves three quarters of its width in a frame; what it hid is filled from around."""
    scene = Planes(lambda x, y: torch.full_like(x, 0.25), square=0.1875 / FRAME_S)
    for shown in play("framed-late", scene, seconds=0.2)[-8:]:
        truth = scene.image(64, shown.display_time_s + 0.5 * FRAME_S / PARTS)
        off = (shown.image - truth).abs().amax(-1) > 0.05
        planes = truth.permute(2, 0, 1)[None, :1]
        edge = F.max_pool2d(planes, 3, 1, 1) + F.max_pool2d(-planes, 3, 1, 1) > 0
        assert not bool((off & ~edge[0, 0]).any()), "but for its edges"
        assert float(shown.image.min()) > 0.24


def test_what_is_hidden_is_not_accumulated_over_what_comes_into_view() -> None:
    """The square stops no ghost of itself behind it: colours are clipped to those around."""
    scene = Planes(lambda x, y: torch.full_like(x, 0.25), square=0.25 / FRAME_S)
    shown = play("framed-taa", scene, seconds=0.2)[-1]
    truth = scene.image(64, shown.sample_time_s)
    assert int(((shown.image - truth).abs() > 0.05).any(-1).sum()) <= 17 * 4


@pytest.mark.parametrize("name", NAMES)
def test_threads_change_nothing(name: str) -> None:
    config, scene = replace(CONFIG, resolution_px=256), Planes(fine, pan=0.4, square=1.0)
    before, found = torch.get_num_threads(), []
    try:
        for threads in (1, 2, 3):
            torch.set_num_threads(threads)
            policy = made(name, scene, config)
            policy._warm_frames = 2
            clock = fixed_clock(FRAME_S * policy.price.samples / 256**2)
            found.append([shown.image for _, shown in run(policy, scene.trace, clock, 0.0, 0.01)][-1])
    finally:
        torch.set_num_threads(before)
    assert torch.equal(found[0], found[1]) and torch.equal(found[0], found[2])


def test_what_it_cannot_work_with_is_refused() -> None:
    scene = Planes()
    with pytest.raises(ConfigError, match="parts: expected a power of two, got 3"):
        Reprojected(Setting(CONFIG, view=scene.view), 3)
    with pytest.raises(ConfigError, match="policy: expected a renderer that tells poses"):
        Reprojected(Setting(CONFIG))
    panorama = replace(scene.view(0.0), kind="panorama")
    with pytest.raises(ConfigError, match="policy: expected a perspective or parallel camera.*'panorama'"):
        Reprojected(Setting(CONFIG, view=lambda time_s: panorama))

    def silent(batch):
        return replace(scene.trace(batch), hits=None)

    with pytest.raises(ConfigError, match="policy: expected a renderer that tells first hits"):
        for _ in run(made("framed-late", scene), silent, fixed_clock(0.1), 0.0, 1.0):
            pass


def test_a_small_frame_has_as_many_parts_as_framelets() -> None:
    small = TsarConfig(batch_size=4, resolution_px=64, framelet_side=32)
    policy = made("framed-late", Planes(), small)
    assert policy.price.samples == 32**2
    assert play("framed-late", Planes(), config=small)[-1].image.shape == (64, 64, 3)
