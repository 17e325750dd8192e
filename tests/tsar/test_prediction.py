"""Poses extrapolated by steady motion."""

from __future__ import annotations

from math import cos, sin

import torch

from tsar.prediction import foretold, predicted
from tsar.types import Viewpoint

STEP_S = 0.01


def view(time_s: float, place: float = 0.0, angle: float = 0.0, camera: float = 0.0) -> Viewpoint:
    rotation = torch.eye(3, dtype=torch.float64).repeat(2, 1, 1)
    rotation[1, :2, :2] = torch.tensor([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]], dtype=torch.float64)
    translation = torch.tensor([[0.0, 0.0, 0.0], [place, 0.0, 0.0]], dtype=torch.float64)
    offset = torch.tensor([0.0, camera, -3.0], dtype=torch.float64)
    return Viewpoint(time_s, torch.arange(2), rotation, translation, torch.eye(3, dtype=torch.float64), offset,
                     "perspective", 0.5, 0.5)  # fmt: skip


def close(found: Viewpoint, right: Viewpoint, tolerance: float = 1e-12) -> bool:
    pairs = ((found.rotation, right.rotation), (found.translation, right.translation),
             (found.to_camera, right.to_camera), (found.to_camera_offset, right.to_camera_offset))  # fmt: skip
    return all(float((a - b).abs().max()) <= tolerance for a, b in pairs)


def test_steady_motion_goes_on() -> None:
    known = [view(STEP_S * k, place=0.3 * k, camera=-0.2 * k) for k in range(3)]
    found = predicted(known, 3.5 * STEP_S)
    assert close(found, view(0.0, place=1.05, camera=-0.7)) and found.time_s == 3.5 * STEP_S


def test_a_turn_goes_on_up_to_the_square_of_its_angle() -> None:
    angle = 0.05
    found = predicted([view(STEP_S * k, angle=angle * k) for k in range(3)], 3 * STEP_S)
    assert close(found, view(0.0, angle=3 * angle), 1.1 * angle**2)


def test_what_starts_stops_or_jumps_stays_where_it_was_last_known() -> None:
    for places in ([0.0, 0.0, 0.4], [0.0, 0.4, 0.4], [0.0, 0.1, 7.0]):
        known = [view(STEP_S * k, place=place, camera=0.1 * k) for k, place in enumerate(places)]
        assert close(predicted(known, 3 * STEP_S), view(0.0, place=places[-1], camera=0.3))


def test_two_views_are_too_few() -> None:
    known = [view(STEP_S * k, place=0.3 * k) for k in range(2)]
    assert predicted(known, 1.0) is known[-1]


def test_what_is_displayed_for_a_cycle_has_the_poses_of_its_middle() -> None:
    def motion(time_s: float) -> Viewpoint:
        assert time_s <= 1.0  # no pose later than the start of the cycle is looked at
        return view(time_s, place=4.0 * time_s, camera=-7.0 * time_s)

    found = foretold(motion, 1.0, STEP_S)
    assert close(found, view(0.0, place=4.0 * (1.0 + 1.5 * STEP_S), camera=-7.0 * (1.0 + 1.5 * STEP_S)))
