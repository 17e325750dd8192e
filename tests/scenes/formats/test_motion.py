"""Motions and instances, from each format into the others and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.animation import pose_at
from scenes.canonical import Mesh, Scene, SceneError
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.geometry.transform_stack import moved_by, rigid_motion, rotation, translation
from scenes.formats.losses import LossReport

TRIANGLES = '"integer indices" [0 1 2 0 2 3 0 3 1] "point P" [0 0 0 1 0 0 0 1 0 0 0 1]'
ENDINGS = (".pbrt", ".lxs", ".xml")

PBRT = f"""
TransformTimes 1 3
ActiveTransform StartTime Translate 0 0 -5
ActiveTransform EndTime Translate 0 1 -5
ActiveTransform All
Camera "perspective"
WorldBegin
ObjectBegin "thing"
  Shape "trianglemesh" {TRIANGLES}
ObjectEnd
AttributeBegin Translate 2 0 0 ObjectInstance "thing" AttributeEnd
AttributeBegin
  Scale 2 2 2
  ActiveTransform EndTime Rotate 90 0 0 1 ActiveTransform All
  ObjectInstance "thing"
AttributeEnd
AttributeBegin
  Translate 1 0 0
  ActiveTransform EndTime Translate 0 3 0 ActiveTransform All
  Shape "sphere"
AttributeEnd
Shape "disk"
"""

MITSUBA = """<scene version="0.5.0"><sensor type="perspective"/>
<shape type="shapegroup" id="g"><shape type="cube"/></shape>
<shape type="instance"><ref id="g"/><animation name="toWorld">
  <transform time="0"><translate x="1"/></transform>
  <transform time="0.5"><translate x="2"/></transform>
  <transform time="1"><rotate z="1" angle="90"/><translate x="2"/></transform></animation></shape>
</scene>"""


def read(path: Path, text: str) -> tuple[Scene, list[str]]:
    path.write_text(text)
    report = LossReport()
    return load_scene_file(path, None, report), [str(loss) for loss in report.losses]


def through(scene: Scene, path: Path) -> tuple[Scene, list[str]]:
    """The scene written and read again, and what the writing lost."""
    report = LossReport()
    save_scene_file(scene, path, None, report)
    return load_scene_file(path), [str(loss) for loss in report.losses]


def test_what_a_file_says(tmp_path: Path) -> None:
    scene, lost = read(tmp_path / "a.pbrt", PBRT)
    assert not lost and scene.duration_s == 3.0
    still, turning, rising, flat = scene.instances
    assert still.track is None and flat.track is None and still.shape is turning.shape
    np.testing.assert_allclose(pose_at(rising.track, 2.0) @ rising.to_world, translation(1.0, 1.5, 0.0), atol=1e-12)
    turned = pose_at(turning.track, 3.0) @ turning.to_world
    np.testing.assert_allclose(turned[:3, :3], 2.0 * rotation(90.0, 0, 0, 1)[:3, :3], atol=1e-12)
    view = pose_at(scene.camera.track, 3.0) @ scene.camera.to_world  # type: ignore[union-attr]
    np.testing.assert_allclose(view[:3, 3], [0.0, -1.0, 5.0], atol=1e-12)


@pytest.mark.parametrize("ending", ENDINGS)
def test_motions_and_instances_come_back(ending: str, tmp_path: Path) -> None:
    scene, _ = read(tmp_path / "a.pbrt", PBRT)
    again, lost = through(scene, tmp_path / f"b{ending}")
    assert not [loss for loss in lost if "motion" in loss]
    for first, second in zip(scene.instances, again.instances, strict=True):
        assert difference(first.track, second.track) is None and difference(first.to_world, second.to_world) is None
    assert difference(scene.camera.track, again.camera.track) is None  # type: ignore[union-attr]
    assert again.instances[0].shape is again.instances[1].shape and again.duration_s == 3.0
    assert difference(again, through(again, tmp_path / f"c{ending}")[0]) is None


def test_a_mesh_of_several_instances_is_written_once(tmp_path: Path) -> None:
    scene, _ = read(tmp_path / "a.pbrt", PBRT)
    save_scene_file(scene, tmp_path / "b.pbrt")
    text = (tmp_path / "b.pbrt").read_text()
    assert text.count('"trianglemesh"') == 1 and text.count("ObjectInstance") == 2
    save_scene_file(scene, tmp_path / "b.xml")
    assert (tmp_path / "b.xml").read_text().count('type="ply"') == 1


@pytest.mark.parametrize("ending", ENDINGS)
def test_three_keys(ending: str, tmp_path: Path) -> None:
    """All of them where the format has more than two, else the first and the last, reported."""
    scene, lost = read(tmp_path / "a.xml", MITSUBA)
    (cube,) = scene.instances
    assert not lost and cube.track is not None and len(cube.track.translation) == 3
    np.testing.assert_allclose(pose_at(cube.track, 0.25) @ cube.to_world, translation(1.5, 0.0, 0.0), atol=1e-12)
    again, lost = through(scene, tmp_path / f"b{ending}")
    found = again.instances[0]
    if ending == ".pbrt":
        assert any("a motion of 3 keys" in loss for loss in lost)
    else:
        assert difference(cube.track, found.track) is None and not any("motion" in loss for loss in lost)
    for time_s in (0.0, 1.0):
        poses = (pose_at(one.track, time_s) @ one.to_world for one in (cube, found))
        np.testing.assert_allclose(*poses, atol=1e-9)


def test_mitsuba_3_has_no_motion_and_says_so(tmp_path: Path) -> None:
    scene, _ = read(tmp_path / "a.pbrt", PBRT)
    report = LossReport()
    save_scene_file(scene, tmp_path / "b.xml", "mitsuba3", report)
    lost = [str(loss) for loss in report.losses]
    assert sum("the motion of a shape" in loss for loss in lost) == 1 and any("of the camera" in loss for loss in lost)
    assert "animation" not in (tmp_path / "b.xml").read_text()


def test_a_moving_part_of_an_object(tmp_path: Path) -> None:
    """Where the object is placed, it moves along the placed axes."""
    body = f"""Camera "perspective" WorldBegin
    ObjectBegin "o" ActiveTransform EndTime Translate 1 0 0 ActiveTransform All
    Shape "trianglemesh" {TRIANGLES} ObjectEnd
    Rotate 90 0 0 1 ObjectInstance "o" """
    scene, lost = read(tmp_path / "a.pbrt", body)
    (part,) = scene.instances
    assert not lost and isinstance(part.shape, Mesh)
    np.testing.assert_allclose((pose_at(part.track, 1.0) @ part.to_world)[:3, 3], [0.0, 1.0, 0.0], atol=1e-12)


def test_uneven_keys_are_met() -> None:
    keys = [translation(x, 0.0, 0.0) for x in (0.0, 1.0, 4.0)]
    track = rigid_motion(keys, (0.0, 1.0, 3.0))
    assert track is not None
    for time_s, x in ((0.0, 0.0), (1.0, 1.0), (2.0, 2.5), (3.0, 4.0)):
        assert pose_at(track, time_s)[0, 3] == pytest.approx(x, abs=1e-9)
    assert rigid_motion([np.eye(4), np.diag([2.0, 1.0, 1.0, 1.0])], (0.0, 1.0)) is None
    assert rigid_motion(keys[:2], (1.0, 1.0)) is None
    assert moved_by(np.diag([1.0, 3.0, 1.0, 1.0]), rigid_motion([np.eye(4), rotation(30, 0, 0, 1)], (0.0, 1.0))) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("MotionBegin [0] Identity MotionEnd", "a.lxs:1:1: MotionBegin: expected 2 to"),
        ("MotionBegin [1 0] Identity Identity MotionEnd", "each after the last"),
        ("MotionBegin [0 1] Identity MotionEnd", "expected 2 transforms before it"),
        ("MotionBegin [0 1] Identity Identity Identity MotionEnd", "expected 2 transforms, got more"),
        ('MotionBegin [0 1] Camera "perspective"', "expected transforms and MotionEnd, got Camera"),
        ("MotionEnd", "MotionEnd: expected"),
    ],
)
def test_motions_that_are_none(text: str, part: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError) as error:
        read(tmp_path / "a.lxs", text)
    assert part in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("steps", ["", '<transform time="1"/><transform time="1"/>', '<transform time="1e308"/>'])
def test_animations_that_are_none(steps: str, tmp_path: Path) -> None:
    sensor = f'<sensor type="perspective"><animation name="toWorld">{steps}</animation></sensor>'
    text = f'<scene version="0.5.0">{sensor}</scene>'
    with pytest.raises(SceneError) as error:
        read(tmp_path / "a.xml", text)
    assert "a.xml:1:" in str(error.value)
