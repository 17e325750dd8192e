"""The policies tsar and filter: what they show of scenes whose pictures are known exactly."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode

from renderer.stages.control import stages
from tests.oracles.screens import Layer, Screen
from tsar.clock import StageTimer, fixed_clock
from tsar.config import TilingConfig, TsarConfig
from tsar.filtering import display
from tsar.filtering.options import FilterOptions
from tsar.policies import POLICIES
from tsar.policies.filter import Filter
from tsar.policy import Moment, Policy, Setting, run, step
from tsar.roots import square_root
from tsar.stages import REFERENCE
from tsar.types import FrameletBatch, SampleBatch, ShownImage

CONFIG = TsarConfig(batch_size=4, resolution_px=64, warmup_cycles=2, tiling=TilingConfig(level_min=1))
CYCLE_S = 1.0 / 64.0


def checkers(u, v, t):
    value = 0.5 + 0.3 * torch.sign(torch.sin(50.0 * u) * torch.sin(35.0 * v))
    return value[..., None].expand(*u.shape, 3)


def shown(policy: Policy, screen: Screen, end_s: float) -> list[ShownImage]:
    images = run(policy, screen.trace, fixed_clock(CYCLE_S), 0.0, end_s)
    return [image for _, image in images if image.sample_time_s >= -1e-9]


def error(image: ShownImage, screen: Screen, time_s: float) -> float:
    return float((image.image - screen.picture(time_s, 64)).square().mean())


def framed_error(screen: Screen, late_s: float) -> float:
    return float((screen.picture(1.0 - late_s, 64, 1) - screen.picture(1.0, 64)).square().mean())


def panned(pixels_per_s: float) -> Screen:
    def camera(t):
        return pixels_per_s / 64.0 * t, torch.zeros_like(t)

    return Screen((Layer(checkers),), camera)


@pytest.mark.parametrize("name", ["tsar", "filter"])
def test_a_still_picture_converges(name: str) -> None:
    """With 16 samples a pixel the error is below a half of that of one, with 32 below a third, and it stays there."""
    screen = panned(0.0)
    options = FilterOptions(reprojection=name == "tsar", share_max=1.0 / 8.0)  # longer cycles, for the test's speed
    policy = Filter(Setting(replace(CONFIG, resolution_px=128), stages, view=screen.view), options)
    state, cycles = policy.start(), 32 * 128**2 // policy.price.samples
    cycle_s, truth = 4.0 / cycles, screen.picture(0.0, 128)
    framed = float((screen.picture(0.0, 128, 1) - truth).square().mean())
    for cycle in range(cycles * 5 // 4):
        done = step(policy, state, screen.trace, Moment(cycle * cycle_s, cycle, cycle_s))
        state, wrong = done.after, float((done.shown.image - truth).square().mean())
        assert cycle < cycles // 2 or wrong < framed / (2.0 if cycle < cycles else 3.0), (cycle, wrong / framed)


def test_surfaces_are_followed() -> None:
    """On a pan the estimates on surfaces are below half the error of those in pixels."""
    screen = panned(40.0)
    found = {}
    for name in ("tsar", "surfel", "filter"):
        last = shown(POLICIES[name](Setting(CONFIG, stages, view=screen.view)), screen, 1.0)[-1]
        found[name] = error(last, screen, last.display_time_s + 0.5 * CYCLE_S)
    assert max(found["tsar"], found["surfel"]) < 0.5 * found["filter"], found


def test_a_picture_is_right_in_the_middle_of_its_display() -> None:
    """Half a cycle of motion before and after, its error is at least 1.5 times as large; so errors of moments that meet
    cycles at changing phases swing."""
    screen = panned(120.0)
    last = shown(POLICIES["tsar"](Setting(CONFIG, stages, view=screen.view)), screen, 1.0)[-1]
    start, middle, end = (error(last, screen, last.display_time_s + share * CYCLE_S) for share in (0.0, 0.5, 1.0))
    assert min(start, end) > 1.5 * middle, (start, middle, end)


def test_without_poses_nothing_is_reprojected() -> None:
    screen = panned(0.0)
    options = FilterOptions(reprojection=False)
    with_poses = shown(Filter(Setting(CONFIG, stages, view=screen.view), options), screen, 0.2)
    without = shown(Filter(Setting(CONFIG)), screen, 0.2)
    assert all(torch.equal(one.image, other.image) for one, other in zip(with_poses, without, strict=True))


@pytest.mark.parametrize("name", ["tsar", "surfel"])
def test_a_panorama_is_not_reprojected(name: str) -> None:
    screen = panned(0.0)
    view = lambda time_s: replace(screen.view(time_s), kind="panorama")  # noqa: E731
    assert torch.isfinite(shown(POLICIES[name](Setting(CONFIG, view=view)), screen, 0.1)[-1].image).all()


@pytest.mark.parametrize("name", ["tsar", "filter", "tsar-densities-wavelets", "surfel"])
def test_threads_change_no_bit(name: str) -> None:
    screen, before = panned(30.0), torch.get_num_threads()
    found = []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            found.append(
                [one.image for one in shown(POLICIES[name](Setting(CONFIG, stages, view=screen.view)), screen, 0.15)]
            )
    finally:
        torch.set_num_threads(before)
    assert all(torch.equal(one, other) for one, other in zip(*found, strict=True))


@pytest.mark.parametrize("name", ["tsar", "surfel"])
def test_samples_that_are_not_finite_are_never_shown(name: str) -> None:
    screen = panned(10.0)

    def spoilt(batch: FrameletBatch) -> SampleBatch:
        found = screen.trace(batch)
        color = found.color.clone()
        color[:, ::5] = torch.nan
        color[::3, 1] = torch.inf
        return replace(found, color=color)

    images = run(POLICIES[name](Setting(CONFIG, stages, view=screen.view)), spoilt, fixed_clock(CYCLE_S), 0.0, 0.3)
    assert all(bool(torch.isfinite(image.image).all()) for _, image in images)


@pytest.mark.parametrize("part", ["smoothing", "accumulation", "jitter", "by_gain", "spread", "probes"])
def test_every_part_can_be_left_out(part: str) -> None:
    screen = panned(20.0)
    whole = shown(Filter(Setting(CONFIG, stages, view=screen.view)), screen, 0.2)[-1].image
    less = shown(Filter(Setting(CONFIG, stages, view=screen.view), FilterOptions(**{part: False})), screen, 0.2)[
        -1
    ].image
    assert torch.isfinite(less).all() and not torch.equal(whole, less)


def test_every_sample_that_is_charged_is_asked_for() -> None:
    policy = POLICIES["tsar"](Setting(CONFIG, view=panned(0.0).view))
    _, batch = policy.request(policy.start(), Moment(0.0, 0, CYCLE_S))
    assert batch.position[..., 0].numel() == policy.price.samples == 64**2 / 16
    assert batch.times.min() == 0.0 and batch.times.max() < CYCLE_S


@pytest.mark.parametrize(
    ("side", "share", "most"),
    [
        (32, 1 / 32, 90),
        (64, 1 / 32, 256),
        (128, 1 / 32, 724),
        (256, 1 / 32, 2048),
        (1024, 1 / 32, 32768),
        (64, 1, 4096),
    ],
)
def test_cycles_of_small_pictures_are_longer(side: int, share: float, most: int) -> None:
    assert FilterOptions(share_max=share).samples_max(side * side) == most


ARITHMETIC = {
    "add", "sub", "rsub", "mul", "div", "reciprocal", "sqrt", "pow", "square", "clamp", "clamp_min", "clamp_max",
    "minimum", "maximum", "floor", "abs", "avg_pool2d", "max_pool2d_with_indices", "mean", "sum", "amax", "lt", "gt",
    "le", "ge", "eq", "ne", "scatter_reduce", "index_add_", "add_",
}  # fmt: skip


class Counting(TorchDispatchMode):
    """Counts operations on floats, one for each element that an arithmetic operation reads or makes."""

    def __init__(self) -> None:
        super().__init__()
        self.operations = 0

    def __torch_dispatch__(self, function, types, arguments=(), given=None):
        made = function(*arguments, **(given or {}))
        name = function.overloadpacket.__name__
        if name in ARITHMETIC:
            first = made[0] if isinstance(made, tuple) else made
            read = [one.numel() for one in arguments if isinstance(one, Tensor)]
            reduces = name in {"avg_pool2d", "mean", "sum", "amax", "max_pool2d_with_indices"}
            floats = [one for one in arguments if isinstance(one, Tensor) and one.is_floating_point()]
            if floats or first.is_floating_point():
                self.operations += max(read) if reduces and read else first.numel()
        return made


PRICED = "tsar", "filter", "tsar-densities", "surfel"


@pytest.mark.parametrize("name, noisy", [(name, False) for name in PRICED] + [("tsar", True)])
def test_the_price_is_what_the_code_counts(name: str, noisy: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Operations of a cycle in its steady state, at a size at which samples are few beside pixels. The reference takes
    a batch in everywhere, compiled stages where its samples lie."""

    def counted_root(value: Tensor) -> Tensor:
        count.operations += value.numel()  # the library that finds roots is not seen by the mode
        return square_root(value)

    monkeypatch.setattr(display, "square_root", counted_root)
    config = replace(CONFIG, resolution_px=256, batch_size=1)
    screen = panned(10.0)
    count, taken = Counting(), []

    def taken_in(*arguments):
        before = count.operations
        found = REFERENCE.filtering.taken_in(*arguments)
        taken.append(count.operations - before)
        return found

    filtering = replace(REFERENCE.filtering, taken_in=taken_in)
    made = lambda config: replace(REFERENCE, filtering=filtering)  # noqa: E731
    setting = Setting(config, made, view=screen.view, random=lambda: noisy)
    policy = POLICIES[name](setting)
    state = policy.start()
    for cycle in range(2):
        state = step(policy, state, screen.trace, Moment(cycle * CYCLE_S, cycle, CYCLE_S)).after
    moment, count.operations = Moment(2 * CYCLE_S, 2, CYCLE_S), 0
    with count:
        state, batch = policy.request(state, moment)
    samples = screen.trace(batch)
    with count:
        policy.observe(state, batch, samples, moment, StageTimer())
    found = (count.operations - taken[-1]) / 256**2
    assert 0.8 * policy.price.pixel_flops < found <= policy.price.pixel_flops, found
    assert taken[-1] / 256**2 <= 135.0  # of a pixel, of which there is one at most for each sample


def test_without_prediction_the_latency_decides_when_a_picture_is_shown_and_nothing_else() -> None:
    screen = panned(20.0)
    setting = Setting(CONFIG, stages, view=screen.view)
    found = [
        shown(Filter(setting, FilterOptions(prediction=False, latency_cycles=cycles)), screen, 0.2) for cycles in (1, 3)
    ]
    for one, late in zip(*found, strict=True):
        assert torch.equal(one.image, late.image) and one.sample_time_s == late.sample_time_s
        assert late.display_time_s - one.display_time_s == pytest.approx(2.0 * CYCLE_S)


@pytest.mark.parametrize("cycles", [1, 3])
def test_a_steady_pan_is_shown_where_it_is_in_the_middle_of_the_display(cycles: int) -> None:
    screen = panned(60.0)
    setting = Setting(CONFIG, stages, view=screen.view)
    foretold, known = (
        shown(Filter(setting, FilterOptions(prediction=on, latency_cycles=cycles)), screen, 0.3)[-1]
        for on in (True, False)
    )
    middle_s = known.display_time_s + 0.5 * CYCLE_S
    assert error(foretold, screen, middle_s) < 0.7 * error(known, screen, middle_s)


@pytest.mark.parametrize("cycles", [1, 3])
def test_estimates_move_to_the_poses_of_the_middle_of_the_display(cycles: int) -> None:
    screen = panned(60.0)
    policy = Filter(Setting(CONFIG, stages, view=screen.view), FilterOptions(latency_cycles=cycles))
    state = policy.start()
    for cycle in range(3):
        done = step(policy, state, screen.trace, Moment(cycle * CYCLE_S, cycle, CYCLE_S))
        state = done.after
    assert state.view is not None and state.view.time_s == pytest.approx((2.0 + cycles + 0.5) * CYCLE_S)
    right = screen.view(state.view.time_s)
    assert torch.allclose(state.view.to_camera_offset, right.to_camera_offset, atol=1e-9)


def test_what_is_shown_of_another_picture_is_blended_alike() -> None:
    """A picture of one colour stays that; twice as bright a picture is shown twice as bright; nothing is clipped from
    below; and without smoothing pixels are shown as they are."""
    screen = panned(20.0)
    setting = Setting(CONFIG, stages, view=screen.view)
    last = shown(Filter(setting), screen, 0.3)[-1]
    assert last.carried is not None
    plain, noise = torch.full((64, 64, 3), 0.25), torch.rand(64, 64, 3, generator=torch.Generator().manual_seed(1))
    assert torch.allclose(last.carried(plain), plain, atol=1e-5)
    assert torch.allclose(last.carried(noise), 2.0 * last.carried(0.5 * noise), atol=1e-5)
    assert (last.carried(noise) - noise).abs().max() > 0.05
    before = last.image.clone()
    last.carried(noise)
    assert torch.equal(last.image, before)
    assert shown(Filter(setting, FilterOptions(smoothing=False)), screen, 0.1)[-1].carried is None
