"""Cameras that move through the keys of a table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.animation import pose_at
from scenes.canonical import PerspectiveCamera, SceneError
from scenes.catalog import Look, load_seen
from tests.scenes.models.files import CASES

CUBE = str(CASES / "cube-without-normals.gltf")
HEAD = "time_s,eye_x,eye_y,eye_z,target_x,target_y,target_z"
KEYS = np.array([[0.0, 4, 1, 3, 0, 0, 0], [0.5, 0, 2, 5, 0, 0.5, 0], [2.0, -4, 1, 3, 1, 0, 0]])


def table(folder: Path, *rows: str, head: str = HEAD) -> Path:
    path = folder / "keys.csv"
    path.write_text("\n".join((head, *rows)) + "\n")
    return path


def rows_of(keys: np.ndarray) -> list[str]:
    return [",".join(map(str, row)) for row in keys]


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_camera_passes_its_keys_upright_and_between_them(up, tmp_path: Path) -> None:
    look = Look(up=up, camera_keys=table(tmp_path, *rows_of(KEYS)), fov_deg=30.0, lens_radius=0.1, focal_distance=2.0)
    scene, _ = load_seen(CUBE, look)
    camera = scene.camera
    assert isinstance(camera, PerspectiveCamera) and camera.track is not None and scene.duration_s == 2.0
    assert (camera.fov_deg, camera.lens_radius, camera.focal_distance) == (30.0, 0.1, 2.0)
    np.testing.assert_array_equal(camera.to_world, np.eye(4))
    for time_s, *points in KEYS:
        pose, eye, target = pose_at(camera.track, time_s), np.array(points[:3]), np.array(points[3:])
        np.testing.assert_allclose(pose[:3, 3], eye, atol=1e-9)
        back = (eye - target) / np.linalg.norm(eye - target)
        np.testing.assert_allclose(pose[:3, 2], back, atol=1e-9)
        assert pose["xyz".index(up), 0] == pytest.approx(0.0, abs=1e-9) and pose["xyz".index(up), 1] > 0.0
    between = np.array([pose_at(camera.track, time_s)[:3, 3] for time_s in np.linspace(0.0, 0.5, 31)])
    assert (np.diff(between[:, 0]) < 0.0).all() and (np.diff(between[:, 1]) > 0.0).all(), "no overshoot"
    np.testing.assert_array_equal(pose_at(camera.track, -1.0), pose_at(camera.track, 0.0))


def test_one_key_and_further_columns_in_any_order(tmp_path: Path) -> None:
    path = table(tmp_path, "a,0,0,0,3,2,1,5", head="note,target_z,target_y,target_x,eye_z,eye_y,eye_x,time_s")
    camera = load_seen(CUBE, Look(camera_keys=path))[0].camera
    assert isinstance(camera, PerspectiveCamera) and camera.track is not None
    np.testing.assert_allclose(pose_at(camera.track, 0.0)[:3, 3], (1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    ("rows", "head", "message"),
    [
        (["0,1,1,1,0,0,0"], "time_s,eye_x,eye_y,eye_z,target_x,target_y,target", "found no target_z"),
        ([], HEAD, "expected at least one row"),
        (["0,1,1,1,0,0,nan"], HEAD, "line 2: target_z: expected a finite number, got 'nan'"),
        (["0,1,1,1,0,0"], HEAD, "line 2: target_z: expected a finite number, got None"),
        (["1,1,1,1,0,0,0", "1,2,1,1,0,0,0"], HEAD, "times that increase"),
        (["0,1,1,1,1,1,1"], HEAD, "an eye that differs from its target"),
        (["0,1,1,1,0,0,0", "1e9,1,1,2,0,0,0"], HEAD, "at most 65536 samples"),
    ],
)
def test_tables_that_cannot_be(rows: list[str], head: str, message: str, tmp_path: Path) -> None:
    path = table(tmp_path, *rows, head=head)
    with pytest.raises(SceneError, match=message) as error:
        load_seen(CUBE, Look(camera_keys=path))
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_a_missing_table_and_two_cameras(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"gone\.csv: cannot be read"):
        load_seen(CUBE, Look(camera_keys=tmp_path / "gone.csv"))
    path = table(tmp_path, *rows_of(KEYS))
    with pytest.raises(SceneError, match="neither a camera nor a camera_path"):
        load_seen(CUBE, Look(camera_keys=path, camera=(1, 1, 1, 0, 0, 0)))
    with pytest.raises(SceneError, match="neither a camera nor a camera_path"):
        load_seen(CUBE, Look(camera_keys=path), camera_path="turntable")
