"""Camera motion from a table of keys."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from scenes.animation import continuous_quaternions, look_at
from scenes.arithmetic import product
from scenes.canonical import PerspectiveCamera, RigidTrack, Scene, SceneError
from scenes.loading import one_line
from scenes.viewing import FOV_DEG, Up, turned_up

COLUMNS = ("time_s", "eye_x", "eye_y", "eye_z", "target_x", "target_y", "target_z")
"""Columns of a table of keys: seconds, and points in scene units."""

_INTERVAL_S = 1.0 / 120.0
_KEYS_MOST = 1 << 16


def read_keys(path: Path) -> Float64[NDArray, "keys 7"]:
    """The keys of a CSV file with the columns :data:`COLUMNS`, in any order; further columns are ignored.

    Raises:
        SceneError: the file cannot be read, a column is missing, a value is not a finite number, or times do not
            increase.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.DictReader(file)
            missing = [name for name in COLUMNS if name not in (rows.fieldnames or ())]
            if missing:
                raise SceneError(f"expected the columns {', '.join(COLUMNS)}, found no {', '.join(missing)}")
            keys = np.array([[_number(row, name, rows.line_num) for name in COLUMNS] for row in rows], np.float64)
    except (OSError, UnicodeDecodeError, csv.Error, SceneError) as error:
        raise SceneError(f"camera keys {path}: cannot be read: {one_line(error)}") from None
    if not len(keys):
        raise SceneError(f"camera keys {path}: expected at least one row, found none")
    if not (np.diff(keys[:, 0]) > 0.0).all():
        raise SceneError(f"camera keys {path}: expected times that increase from row to row")
    return keys


def _number(row: dict[str, str | None], name: str, line: int) -> float:
    try:
        value = float(row[name] or "")
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise SceneError(f"line {line}: {name}: expected a finite number, got {row[name]!r}")
    return value


def with_keys_of(scene: Scene, path: Path, up: Up, fov_deg: float | None = None) -> Scene:
    """The scene with an upright camera that passes the keys of a file at their times.

    Between keys eye and target follow monotone cubic curves (Fritsch and Butland 1984), sampled 120 times a second or
    as often as the keys; the pose is held before the first key and after the last.

    Args:
        scene: scene, whose lens, shutter and field of view are kept.
        path: see :func:`read_keys`.
        up: upward axis of the world.
        fov_deg: full angle of the shorter image axis, in place of the scene's.

    Raises:
        SceneError: the file cannot be read, a key's eye is its target, or the keys need more than 65,536 samples.
    """
    keys = read_keys(path)
    times_s, points = keys[:, 0], keys[:, 1:]
    span_s = float(times_s[-1] - times_s[0])
    steps = int(np.ceil(span_s / min(_INTERVAL_S, float(np.diff(times_s).min(initial=np.inf)))))
    if steps >= _KEYS_MOST:
        raise SceneError(f"camera keys {path}: expected at most {_KEYS_MOST} samples of the motion, got {steps + 1}")
    if steps:
        points = PchipInterpolator(times_s, points)(np.linspace(times_s[0], times_s[-1], steps + 1))
    turn = turned_up(up)[:3, :3]
    try:
        turned = look_at(product(points[:, :3], turn), product(points[:, 3:], turn)).as_matrix()
    except SceneError:
        raise SceneError(f"camera keys {path}: expected an eye that differs from its target at all times") from None
    before = scene.camera if isinstance(scene.camera, PerspectiveCamera) else PerspectiveCamera(fov_deg=FOV_DEG)
    rotation = continuous_quaternions(_quaternions(product(turn, turned)))
    track = RigidTrack(float(times_s[0]), span_s / steps if steps else 1.0, points[:, :3], rotation)
    camera = dataclasses.replace(
        before, to_world=np.eye(4), track=track, fov_deg=before.fov_deg if fov_deg is None else fov_deg
    )
    return dataclasses.replace(scene, camera=camera, duration_s=float(times_s[-1]))


def _quaternions(matrices: Float64[NDArray, "keys 3 3"]) -> Float64[NDArray, "keys 4"]:
    return Rotation.from_matrix(matrices).as_quat()
