"""Animations of glTF files: rigid motion of nodes and of what hangs below them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenes.animation import pose_at
from scenes.canonical import Instance, SceneError
from scenes.catalog import Look, load_seen
from scenes.formats.losses import LossReport
from scenes.models import read_model
from tests.scenes.models.files import Gltf

TURN = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)]], np.float32)


def animated(folder: Path, *channels: tuple[int, str, Any, Any, str]) -> Gltf:
    """A wheel (node 1, with the mesh) on a car (node 0) with a scale of 2; each channel is a node, a path, times,
    values and an interpolation."""
    file = Gltf(folder)
    file.json["nodes"] = [
        {"children": [1], "translation": [1.0, 0.0, 0.0], "scale": [2.0, 2.0, 2.0]},
        {"mesh": 0, "translation": [0.0, 1.0, 0.0], "name": "wheel"},
    ]
    samplers, made = [], []
    for node, path, times_s, values, kind in channels:
        pair = {"input": file.accessor(np.array(times_s, np.float32)),
                "output": file.accessor(np.array(values, np.float32)), "interpolation": kind}  # fmt: skip
        made.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
        samplers.append(pair)
    file.json["animations"] = [{"samplers": samplers, "channels": made}]
    return file


def where(part: Instance, point: tuple[float, float, float], time_s: float) -> np.ndarray:
    world = part.to_world if part.track is None else pose_at(part.track, time_s) @ part.to_world
    return (world @ np.append(point, 1.0))[:3]


def test_a_wheel_turns_on_a_moving_car(tmp_path: Path) -> None:
    moves = 0, "translation", [0.0, 1.0], [[1, 0, 0], [3, 0, 0]], "LINEAR"
    file = animated(tmp_path, moves, (1, "rotation", [0.0, 0.5], TURN, "LINEAR"))
    report = LossReport()
    (part,) = read_model(file.written(), report)
    assert not report.losses and part.track is not None
    for time_s in (0.0, 0.25, 0.5, 1.0, 9.0):
        turn = Rotation.from_euler("z", min(time_s / 0.5, 1.0) * 90.0, degrees=True)
        car = 1.0 + 2.0 * min(time_s, 1.0)
        expected = np.array([car, 0.0, 0.0]) + 2.0 * (turn.apply(np.eye(3)[0]) + np.eye(3)[1])
        np.testing.assert_allclose(where(part, (1.0, 0.0, 0.0), time_s), expected, atol=1e-6)
    scene, losses = load_seen(str(file.path), Look(up="z", integrator="path"))
    assert scene.duration_s == pytest.approx(1.0) and scene.integrator.kind == "path" and losses == ()


def test_what_hangs_below_an_animated_node_moves_with_it(tmp_path: Path) -> None:
    (part,) = read_model(animated(tmp_path, (0, "translation", [0.5, 1.5], [[0, 0, 0], [0, 0, 4]], "STEP")).written())
    for time_s, height in ((0.0, 0.0), (1.4, 0.0), (1.5, 4.0)):
        np.testing.assert_allclose(where(part, (0.0, 0.0, 0.0), time_s), (0.0, 2.0, height), atol=1e-6)


def test_a_cubic_spline_follows_its_tangents(tmp_path: Path) -> None:
    """Hermite's form of z = t³ between 0 and 2 s."""
    keys = [[[0, 0, 0], [0, 0, 0], [0, 0, 0]], [[0, 0, 12], [0, 0, 8], [0, 0, 12]]]
    values = np.array(keys, np.float32).reshape(6, 3)
    (part,) = read_model(animated(tmp_path, (0, "translation", [0.0, 2.0], values, "CUBICSPLINE")).written())
    for time_s in (0.0, 0.5, 1.0, 1.75, 2.0):
        assert where(part, (0.0, -1.0, 0.0), time_s)[2] == pytest.approx(time_s**3, abs=1e-4)


def test_growth_is_reported_and_leaves_the_pose_at_its_start(tmp_path: Path) -> None:
    report, scales = LossReport(), [[1, 1, 1], [2, 2, 2]]
    file = animated(tmp_path, (0, "scale", [0.0, 1.0], scales, "LINEAR"), (0, "pointer", [0.0], [[1, 1, 1]], "LINEAR"))
    (part,) = read_model(file.written(), report)
    assert part.track is None and where(part, (1.0, 0.0, 0.0), 0.0) == pytest.approx((2.0, 1.0, 0.0))
    said = " ".join(map(str, report.losses))
    assert "an animation that scales or shears" in said and "an animation of pointer" in said


def test_channels_that_cannot_be(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"samplers\[0\].output: expected 1 elements for each of 2 times, got 1"):
        read_model(animated(tmp_path, (0, "translation", [0.0, 1.0], [[0, 0, 0]], "LINEAR")).written())
    with pytest.raises(SceneError, match=r"animations\[0\]: expected at most 65536 keys"):
        read_model(animated(tmp_path, (0, "translation", [0, 1e6], [[0, 0, 0], [1, 0, 0]], "LINEAR")).written())
