"""Interruptible rendering: what is refined, when a frame is interrupted, and what is shown meanwhile."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tests.oracles import pictures
from tests.oracles.screens import Layer, Screen
from tsar.clock import fixed_clock
from tsar.config import TilingConfig, TsarConfig
from tsar.policies import POLICIES, interruptible, refinement
from tsar.policy import Moment, Policy, Price, Setting, run

CONFIG = TsarConfig(batch_size=4, resolution_px=64, warmup_cycles=2, tiling=TilingConfig(level_min=1))
CYCLE_S = 1.0 / 64.0


def checkers(u, v, t):
    value = 0.5 + 0.4 * torch.sign(torch.sin(60.0 * u) * torch.sin(45.0 * v))
    return value[..., None].expand(*u.shape, 3)


def made(screen: Screen) -> Policy:
    return POLICIES["interruptible"](Setting(CONFIG, view=screen.view))


def frame_times(policy: Policy, trace, cycles: int) -> list[float]:
    shown = [image for _, image in run(policy, trace, fixed_clock(CYCLE_S), 0.0, cycles * CYCLE_S)]
    return [float(image.sample_map.newest_s[0, 0]) for image in shown if image.sample_map is not None]


def moving(speed: float) -> Screen:
    return Screen((Layer(checkers, pose=lambda t: (torch.zeros_like(t), speed * t, torch.zeros_like(t))),))


def test_what_moves_faster_is_interrupted_sooner() -> None:
    times = {speed: len(set(frame_times(made(moving(speed)), moving(speed).trace, 40))) for speed in (0.0, 0.1, 2.0)}
    assert times[0.0] < times[0.1] < times[2.0], times
    assert times[0.0] <= 2 and times[2.0] >= 20, times


def test_a_still_frame_is_refined_while_it_is_shown() -> None:
    screen = moving(0.0)
    truth = screen.picture(0.0, 64)
    shown = [image for _, image in run(made(screen), screen.trace, fixed_clock(CYCLE_S), 0.0, 40 * CYCLE_S)]
    errors = [float((image.image - truth).square().mean()) for image in shown]
    assert errors[-1] < errors[8] / 2 < errors[0] / 8, (errors[0], errors[8], errors[-1])


@pytest.mark.parametrize("poses", [True, False])
def test_a_change_without_motion_is_seen_by_probes(poses: bool) -> None:
    """The light changes at 0.3 s: within three cycles a frame that was begun after it is shown."""

    def lit(u, v, t):
        return checkers(u, v, t) * torch.where(t < 0.3, 1.0, 0.2)[..., None]

    screen = Screen((Layer(lit),))
    policy = POLICIES["interruptible"](Setting(CONFIG, view=screen.view if poses else None))
    shown = [image for _, image in run(policy, screen.trace, fixed_clock(CYCLE_S), 0.0, 0.5)]
    before = [image for image in shown if image.display_time_s < 0.3]
    after = [image for image in shown if image.display_time_s >= 0.3 + 4 * CYCLE_S]
    assert float(before[-1].image.mean()) > 0.4 > 0.15 > max(float(image.image.mean()) for image in after)


def test_the_static_error_is_near_the_true_one() -> None:
    screen = moving(0.0)
    policy, state, ratios = made(screen), None, []
    truth = refinement.encoded(screen.picture(0.0, 64, axis=1))
    from tsar.policy import step

    state = policy.start()
    for cycle in range(3):
        state = step(policy, state, screen.trace, Moment(0.0, cycle, CYCLE_S)).after
        found = float((refinement.encoded(state.back.image) - truth).square().mean())
        ratios.append(state.back.static / found)
    assert all(0.3 < ratio < 3.0 for ratio in ratios), ratios


def test_spread_covers_the_picture_with_different_pixels() -> None:
    pixel, regular = refinement.spread(64, 1000, torch.Generator().manual_seed(3))
    assert regular == 256 and pixel.unique().numel() == pixel.numel() == 1000
    cells = pixel[:regular] // 64 // 4 * 16 + pixel[:regular] % 64 // 4
    assert cells.sort().values.equal(torch.arange(256))
    whole, _ = refinement.spread(64, 64 * 64, torch.Generator().manual_seed(3))
    assert whole.sort().values.equal(torch.arange(64 * 64))


def test_samples_go_where_the_picture_changes() -> None:
    """Half of the picture is plain: after a coarse grid all samples go to the other, to pixels without one first."""
    random = torch.Generator().manual_seed(0)
    pixel, _ = refinement.spread(64, 512, random)
    x, y = (pixel % 64 + 0.5) / 64, (pixel // 64 + 0.5) / 64
    color, count = torch.zeros(64 * 64, 3), torch.zeros(64 * 64)
    color[pixel], count[pixel] = pictures.static_stripes(x, y, None), 1.0
    tree = refinement.levels(color.T.reshape(3, 64, 64), count.reshape(64, 64))
    found = refinement.worthiest(tree, 700, random)
    assert found.numel() == 700 and found.unique().numel() > 690 and int(count[found].sum()) == 0
    assert float((found % 64 < 34).float().mean()) > 0.95
    error = refinement.remaining(tree, 1.0)
    assert float(error[:, :30].mean()) > 50 * float(error[:, 36:].mean())


def test_contrast_is_of_known_cells_beside() -> None:
    color, count = torch.zeros(3, 4, 4), torch.ones(4, 4)
    color[:, 1, 1] = 1.0
    count[1, 2] = 0.0
    finest = refinement.levels(color, count)[-1].contrast
    assert finest[1, 1] == 1.0 and finest[1, 2] == 0.0 and float(finest[0, 1]) == pytest.approx(1 / 3)
    assert finest[3, 3] == 0.0


def test_the_standard_error_of_probes() -> None:
    """Their encoded colours change by 0.1, 0.2, 0.5 and 0.2 in every channel."""
    change, empty = torch.tensor([0.1, 0.2, 0.5, 0.2]), torch.zeros(0, dtype=torch.int64)
    before = torch.full((4, 3), 0.09)
    frame = interruptible.Frame(
        0.0, before, torch.ones(4), torch.zeros(4, 2, dtype=torch.float64), torch.zeros(4, dtype=torch.int32),
        torch.zeros(4, 3), torch.arange(4), before,
    )  # fmt: skip
    asked = interruptible.Asked(empty, torch.arange(4))
    found = interruptible._probed(frame, asked, (0.3 + change[:, None]).square().expand(4, 3))
    squared = np.array([0.01, 0.04, 0.25, 0.04])
    assert found == pytest.approx((squared.mean(), squared.std(ddof=1) / 2.0), rel=1e-4)


def test_the_change_that_probes_show_goes_on() -> None:
    """Without poses nothing is known to move: 0.02 after three quarters of a second is 0.02 x 1 / 0.75 after one."""
    policy = POLICIES["interruptible"](Setting(CONFIG))
    assert isinstance(policy, interruptible.Interruptible)
    frame = interruptible.Frame.empty(CONFIG, 1.0, torch.arange(4))
    view = interruptible.View(frame, torch.zeros(64, 64, 3), torch.zeros(64, 64), 0.0, [], 0)
    for probes, expected in (((0.02, 1e-4), 0.02 / 0.75), (None, 0.0)):
        assert policy._dynamic(view, Moment(1.75, 0, 0.25), probes) == pytest.approx(expected)
    assert policy._dynamic(view, Moment(1.0, 0, 0.25), (0.02, 1e-4)) == 0.0


def test_the_price_is_the_sum_of_its_parts() -> None:
    """Refinement 130, pyramid and roots 84, and displacement 42 for each of two buffers."""
    assert made(moving(0.0)).price == Price(4 * 256, pixel_flops=298.0, sample_flops=34.0)
