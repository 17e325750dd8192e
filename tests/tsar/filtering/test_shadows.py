"""Shadows that move over what stands still."""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin

import torch

from renderer.stages.control import stages
from renderer.trace import Renderer
from scenes import catalog
from tsar.clock import fixed_clock
from tsar.config import TilingConfig, TsarConfig
from tsar.filtering import shadows
from tsar.filtering.options import FilterOptions
from tsar.policies.filter import Filter
from tsar.policy import Setting, run
from tsar.projection import project
from tsar.roots import encoded
from tsar.types import FrameletBatch, Hits, Viewpoint

STANDING, MOVING = 0, 1  # instances


def view(time_s: float, camera: float = 0.0, kind: str = "perspective") -> Viewpoint:
    """Instance 1 moves to the right by one and turns by half a radian in a second."""
    turn = 0.5 * time_s
    rotation = torch.eye(3, dtype=torch.float64).repeat(2, 1, 1)
    rotation[1, :2, :2] = torch.tensor([[cos(turn), -sin(turn)], [sin(turn), cos(turn)]], dtype=torch.float64)
    translation = torch.tensor([[0.0, 0.0, 0.0], [time_s, 0.0, 0.0]], dtype=torch.float64)
    to_camera = 1.5 * torch.eye(3, dtype=torch.float64)
    offset = torch.tensor([camera * time_s, 0.3, -2.0], dtype=torch.float64)
    return Viewpoint(time_s, torch.arange(2), rotation, translation, to_camera, offset, kind, 0.7, 0.5)


def hits(instance: list[int], occluder: list[int], point: torch.Tensor) -> Hits:
    return Hits(torch.tensor([instance], dtype=torch.int32), point[None], torch.tensor([occluder], dtype=torch.int32))


def random_points(count: int) -> torch.Tensor:
    made = torch.Generator().manual_seed(3)
    return torch.rand(count, 3, generator=made) * torch.tensor([1.0, 1.0, -2.0]) - torch.tensor([0.5, 0.5, 1.0])


def test_a_shadow_moves_as_the_body_would_there() -> None:
    point = random_points(40)
    for kind in ("perspective", "parallel"):
        now, before = view(0.25, 0.4, kind), view(0.0, 0.4, kind)
        found = shadows.drift(hits([STANDING] * 40, [MOVING] * 40, point), now, before)
        rigid = now.rotation[1].T @ (point.to(torch.float64).T - now.translation[1][:, None])
        carried, _ = project(before, torch.full((40,), MOVING), rigid.T)
        stayed, _ = project(before, torch.full((40,), STANDING), point)
        torch.testing.assert_close(found, (carried - stayed).abs().amax(1), rtol=1e-9, atol=1e-12)
        assert float(found.min()) > 0.01


def test_what_stands_or_moves_along_has_no_drift() -> None:
    point = random_points(6)
    found = shadows.drift(
        hits([STANDING, MOVING, -1, STANDING, STANDING, MOVING], [STANDING, MOVING, MOVING, -1, -2, -1], point),
        view(0.25, 0.4),
        view(0.0),
    )
    assert found.tolist() == [0.0] * 6


def test_drift_is_finite_behind_the_camera_and_for_what_has_shrunk_to_nothing() -> None:
    point = torch.tensor([[0.1, 0.2, 9.0], [0.1, 0.2, -3.0]])
    now, before = view(0.25), view(0.0)
    shrunk = replace(now, rotation=now.rotation * torch.tensor([1.0, 0.0])[:, None, None])
    for later in (now, shrunk):
        found = shadows.drift(hits([STANDING] * 2, [MOVING] * 2, point), later, before)
        assert bool(found.isfinite().all())


def test_an_element_keeps_the_fastest_shadow_of_its_newest_samples() -> None:
    before = torch.tensor([[[0.5, 0.25], [0.0, 1.0]]])
    drift_s = torch.tensor([0.1, 0.3, 0.0], dtype=torch.float64)
    after = shadows.last_seen(before, drift_s, torch.tensor([0, 0, 3]))
    torch.testing.assert_close(after, torch.tensor([[[0.3, 0.25], [0.0, 0.0]]]))


def test_change_is_expected_in_and_beside_shadows_that_move() -> None:
    drift_s = torch.zeros(1, 5, 5)
    drift_s[0, 2, 2] = 0.0625
    rate = shadows.expected_rate(drift_s, reach=0.125)[0]
    assert torch.equal(rate > 0.0, torch.nn.functional.pad(torch.ones(3, 3), (1, 1, 1, 1)) > 0.0)
    assert float(rate.max()) == torch.tensor(0.5 * shadows.CONTRAST)
    assert float(shadows.expected_rate(1e3 * drift_s, 0.125).max()) <= shadows.CROSSINGS_MAX * shadows.CONTRAST


def test_the_shadow_of_a_car_is_found_where_it_lies() -> None:
    """Shadows on the street drift with the car. Wheels that turn under its body have some too."""
    renderer = Renderer(catalog.load("corner-exit"), "cpu", footprint_resolution_px=64)
    side = 64
    at = (torch.arange(side) + 0.5) / side
    place = torch.stack(torch.meshgrid(at, at, indexing="xy"), dim=-1).reshape(side, side, 2).to(torch.float32)
    none = torch.zeros(side, dtype=torch.int64)
    time_s = 0.8
    batch = FrameletBatch(none, none, place, torch.full((side, side), time_s, dtype=torch.float64), hits=True)
    found = renderer.trace(batch).hits
    assert found is not None
    now, before = renderer.viewpoint(time_s), renderer.viewpoint(time_s - 0.01)
    drift = shadows.drift(found, now, before).reshape(side, side) / 0.01
    moving = now.track_of_instance[found.instance.reshape(side, side).clamp(min=0).to(torch.int64)] > 0
    dark = (drift > 0.0) & ~moving
    assert 10 <= int(dark.sum()) <= 400
    car = moving.nonzero().to(torch.float32)
    away = torch.cdist(dark.nonzero().to(torch.float32), car).amin(1)
    assert float(away.max()) < 8.0
    position, _ = project(now, found.instance.reshape(-1), found.point.reshape(-1, 3))
    earlier, _ = project(before, found.instance.reshape(-1), found.point.reshape(-1, 3))
    speed = ((position - earlier).abs().amax(1) / 0.01).reshape(side, side)[moving]
    assert float(speed.min()) / 3.0 < float(drift[dark].median()) < 3.0 * float(speed.max())


def test_no_shadow_stays_where_a_car_has_left() -> None:
    """Where shadows say nothing, that of the car lies on the street long after it."""
    config = TsarConfig(batch_size=4, resolution_px=64, tiling=TilingConfig(level_min=1))
    renderer = Renderer(catalog.load("corner-exit"), "cpu", footprint_resolution_px=256)
    gone_s, end_s = 1.45, 1.6
    truth = {}

    def error(expects: bool) -> float:
        policy = Filter(Setting(config, stages, view=renderer.viewpoint), FilterOptions(shadows=expects))
        found = []
        for _, shown in run(policy, renderer.trace, fixed_clock(1.0 / 128.0), 0.6, end_s):
            if shown.display_time_s > gone_s:
                if shown.display_time_s not in truth:
                    truth[shown.display_time_s] = renderer.render_frame(shown.display_time_s, 64, 64, 2)
                found.append(float((encoded(shown.image) - encoded(truth[shown.display_time_s])).square().mean()))
        return sum(found) / len(found)

    assert error(True) < 0.7 * error(False)
