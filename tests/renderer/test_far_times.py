"""Far from time zero everything is as it is near it: times are float64 until they are relative.

The scene and the run begin later by a whole number of seconds. All times are multiples of 1/1024 s, which float64 holds
exactly up to 1e9 s and beyond, so not a bit may differ.
"""

import dataclasses
import math
from typing import get_args

import numpy as np
import pytest
import torch

from analysis.metrics.causes import Truths
from analysis.study.cases import SCALES
from analysis.study.displays import Measuring, watch
from renderer.frames import render_image
from renderer.sampling.plan import SamplePlan
from renderer.stages.control import stages
from renderer.trace import Renderer
from scenes.canonical import Scene
from tests.renderer.builders import driving_scene
from tests.tsar.policies.every import STAGED
from tsar.clock import fixed_clock
from tsar.config import StagesName, TilingConfig, TsarConfig
from tsar.policies import POLICIES
from tsar.policies.filter import Filter
from tsar.policy import Setting, run

CYCLE_S, CYCLES, MOST_S, RATE_HZ = 37 / 1024, 8, 6 * 37 / 1024, 32.0
LATE_S = (1e5, 1e6, 1e9)
CONFIG = TsarConfig(
    batch_size=16, resolution_px=64, sdf_side=32, warmup_cycles=8, tiling=TilingConfig(tile_count_max=64)
)


def scene(later_s: float) -> Scene:
    """The driving scene on tracks of dyadic times that begin later."""

    def moved(thing):
        if thing.track is None:
            return thing
        return dataclasses.replace(thing, track=dataclasses.replace(thing.track, start_s=later_s, interval_s=0.125))

    found = driving_scene()
    return dataclasses.replace(found, camera=moved(found.camera), instances=tuple(map(moved, found.instances)))


@pytest.fixture(scope="module")
def renderers():
    return {later: Renderer(scene(later), threads=1) for later in (0.0, *LATE_S)}


def truths_of(renderer: Renderer, start_s: float) -> Truths:
    side = CONFIG.resolution_px
    return Truths(lambda number: renderer.render_frame(start_s + number / RATE_HZ, side, side, 2), start_s, RATE_HZ, 8)


def play(policy: str, renderer: Renderer, start_s: float, kind: StagesName = "reference") -> list:
    """Records and pictures of some cycles; a cycle of fewer samples than a batch has is as much shorter."""
    truth = truths_of(renderer, start_s).at
    made = POLICIES[policy](
        Setting(CONFIG, lambda config: stages(config, kind, 1), truth, renderer.trace, renderer.viewpoint)
    )
    cycle_s = CYCLE_S * min(made.price.samples / CONFIG.budget, 1.0)
    return list(run(made, renderer.trace, fixed_clock(cycle_s), start_s, start_s + min(CYCLES * cycle_s, MOST_S)))


CASES = [
    pytest.param(
        name, kind, marks=[pytest.mark.slow] if name not in ("thesis", "filter") and kind != "compiled" else []
    )
    for name in STAGED
    for kind in get_args(StagesName)
]
CASES += [pytest.param(name, "reference") for name in POLICIES.names() if name not in STAGED]


@pytest.mark.parametrize(("policy", "kind"), CASES)
def test_a_run_far_from_time_zero_is_the_run_at_time_zero(
    renderers, monkeypatch: pytest.MonkeyPatch, policy: str, kind: StagesName
) -> None:
    monkeypatch.setattr(Filter, "warmup_cycles", 8)
    near = play(policy, renderers[0.0], 0.0, kind)
    assert any(not torch.equal(one[1].image, near[-1][1].image) for one in near[:-1])
    for later in LATE_S:
        far = play(policy, renderers[later], later, kind)
        assert len(far) == len(near)
        for (record, shown), (expected, image) in zip(far, near, strict=True):
            assert shown.display_time_s - later == image.display_time_s
            assert shown.sample_time_s - later == image.sample_time_s
            assert torch.equal(shown.image, image.image)
            assert (shown.sample_map is None) == (image.sample_map is None)
            if shown.sample_map is not None and image.sample_map is not None:
                # the mean time of several samples of a pixel is rounded as times are
                off_s = (shown.sample_map.newest_s - later - image.sample_map.newest_s).nan_to_num(0.0)
                assert torch.equal(shown.sample_map.newest_s.isfinite(), image.sample_map.newest_s.isfinite())
                assert float(off_s.abs().max()) <= 0.5 * math.ulp(later)
            if record is not None:
                assert record.sim_time_s - later == expected.sim_time_s
                assert record.age_spread_s == expected.age_spread_s
                assert torch.equal(record.densities.spatial, expected.densities.spatial)


@pytest.mark.parametrize("policy", ["thesis", "framed"])
def test_errors_far_from_time_zero_are_those_at_time_zero(renderers, policy: str) -> None:
    scale = dataclasses.replace(SCALES["quick"], seconds=0.25, reference_rate_hz=RATE_HZ)
    found = {}
    for later in (0.0, *LATE_S):
        shown = play(policy, renderers[later], later, "compiled")
        times_s = later + np.arange(4) / RATE_HZ
        measuring = Measuring(metrics=("ssim", "flip"), stride=scale.stride, causes=True)
        seen = watch({policy: shown}, truths_of(renderers[later], later), times_s, measuring)[policy]
        found[later] = [{name: value for name, value in row.items() if name != "time_s"} for row in seen.rows]
    assert sum(row["mse"] for row in found[0.0]) > 0
    for later in LATE_S:
        for far, near in zip(found[later], found[0.0], strict=True):
            np.testing.assert_equal(far, near)


@pytest.mark.parametrize("later", LATE_S)
def test_a_frame_with_an_open_shutter_far_from_time_zero(renderers, later: float) -> None:
    plan = SamplePlan(samples_per_pixel=4, point_set="sobol")
    near, far = (render_image(renderers[start], plan, 48, 32, start + 0.25, (0.0, 0.0625)) for start in (0.0, later))
    # only times within the shutter are rounded: by 1.2e-7 s at 1e9 s
    assert (near - far).abs().amax(-1).gt(1e-3).float().mean() < 0.01
