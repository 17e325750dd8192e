"""Skins, morph targets and growth at a time."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from renderer import render
from scenes.canonical import ConstantTexture, Mesh, SceneError
from scenes.catalog import Look, load_seen
from scenes.formats.losses import LossReport
from scenes.models import Model, read_whole
from tests.scenes.models.files import QUAD, Gltf
from tests.scenes.models.test_gltf_motion import animated, where
from tests.scenes.models.test_gltf_views import with_skin

TIMES_S = (0.0, 0.3, 0.5, 0.8, 1.0, 5.0)


def channel(file: Gltf, node: int, path: str, times_s: list[float], values: np.ndarray, kind: str = "LINEAR") -> None:
    animation = file.json.setdefault("animations", [{"samplers": [], "channels": []}])[0]
    animation["channels"].append({"sampler": len(animation["samplers"]), "target": {"node": node, "path": path}})
    keys, moved = (file.accessor(np.asarray(one, np.float32)) for one in (times_s, values))
    animation["samplers"].append({"input": keys, "output": moved, "interpolation": kind})


def points(model: Model) -> np.ndarray:
    (part,) = model.parts
    assert isinstance(part.shape, Mesh) and part.track is None
    return part.shape.vertices @ part.to_world[:3, :3].T + part.to_world[:3, 3]


def same_points(model: Model, expected: np.ndarray, atol: float = 1e-6) -> None:
    """In any order: each expected point is there."""
    found = points(model)
    apart = np.abs(found[:, None] - np.asarray(expected)[None]).max(axis=-1)
    assert apart.min(axis=0).max() < atol and apart.min(axis=1).max() < atol


def turned(angle: float, point: tuple[float, ...]) -> np.ndarray:
    """A point turned about y through (1, 0, 0)."""
    x, y, z = point[0] - 1.0, point[1], point[2]
    return np.array([math.cos(angle) * x + math.sin(angle) * z + 1.0, y, -math.sin(angle) * x + math.cos(angle) * z])


def test_a_skin_has_the_pose_of_its_joints_at_a_time(tmp_path: Path) -> None:
    file = with_skin(tmp_path)
    del file.json["nodes"][2]["rotation"]
    ends = [[0, 0, 0, 1], [0, math.sin(math.pi / 4), 0, math.cos(math.pi / 4)]]
    channel(file, 2, "rotation", [0.0, 1.0], np.array(ends))
    path = file.written()
    for time_s in TIMES_S:
        report = LossReport()
        model = read_whole(path, report, time_s=time_s)
        angle = min(time_s, 1.0) * math.pi / 2
        bent = [turned(angle, QUAD[1]), turned(angle, QUAD[2]), np.array(QUAD[3])]
        # the first point hangs on both joints by halves
        bent.append(0.5 * (np.array(QUAD[0]) + turned(angle, QUAD[0])))
        same_points(model, np.array(bent))
        assert model.posed and f"a skin that moves: the pose at {time_s:g} s" in report.text()


def with_morphs(folder: Path) -> Gltf:
    """A quad with two targets: one raises it, the other draws its first point out."""
    file = Gltf(folder)
    raised, drawn = np.tile(np.array([0, 0, 1], np.float32), (4, 1)), np.zeros((4, 3), np.float32)
    drawn[0] = -1.0, -1.0, 0.0
    file.primitive["targets"] = [{"POSITION": file.accessor(one)} for one in (raised, drawn)]
    return file


def morphed(raised: float, drawn: float) -> np.ndarray:
    found = np.array(QUAD)
    found[:, 2] += raised
    found[0, :2] -= drawn
    return found


def test_weights_of_morph_targets_are_those_of_the_node_or_the_mesh(tmp_path: Path) -> None:
    file, report = with_morphs(tmp_path), LossReport()
    same_points(read_whole(file.written(), report), morphed(0.0, 0.0))
    file.json["meshes"][0]["weights"] = [0.25, 1.0]
    same_points(read_whole(file.written(), report), morphed(0.25, 1.0))
    file.json["nodes"] = [{"mesh": 0, "weights": [2.0, 0.0]}]
    model = read_whole(file.written(), report)
    same_points(model, morphed(2.0, 0.0))
    assert not report.losses and not model.posed
    file.json["nodes"] = [{"mesh": 0}, {"mesh": 0, "weights": [2.0, 0.0], "translation": [9, 0, 0]}]
    file.json["scenes"][0]["nodes"] = [0, 1]
    heights = {round(float(part.shape.vertices[:, 2].max()), 6) for part in read_whole(file.written()).parts}
    assert heights == {0.25, 2.0}, "each node has its own weights"


def test_targets_move_normals_and_colours(tmp_path: Path) -> None:
    file = with_morphs(tmp_path)
    file.attribute("NORMAL", np.tile(np.array([0, 0, 1], np.float32), (4, 1)))
    file.primitive["targets"][0]["NORMAL"] = file.accessor(np.tile(np.array([1, 0, 0], np.float32), (4, 1)))
    file.json["meshes"][0]["weights"] = [1.0, 0.0]
    (part,) = read_whole(file.written()).parts
    np.testing.assert_allclose(part.shape.normals, np.tile([math.sqrt(0.5), 0, math.sqrt(0.5)], (4, 1)), atol=1e-6)
    file = with_morphs(tmp_path)
    file.attribute("COLOR_0", np.full((4, 4), 0.25, np.float32))
    file.primitive["targets"][0]["COLOR_0"] = file.accessor(np.tile(np.array([0.5, 0, 9], np.float32), (4, 1)))
    file.json["meshes"][0]["weights"] = [1.0, 0.0]
    (part,) = read_whole(file.written(), facets=True).parts
    assert part.material.base == ConstantTexture((0.75, 0.25, 1.0))


@pytest.mark.parametrize("kind", ["LINEAR", "STEP", "CUBICSPLINE"])
def test_weights_move(kind: str, tmp_path: Path) -> None:
    file = with_morphs(tmp_path)
    values = np.array([[0.0, 1.0], [2.0, 0.0]])
    if kind == "CUBICSPLINE":  # without slopes
        values = np.stack([np.zeros((2, 2)), values, np.zeros((2, 2))], axis=1)
    channel(file, 0, "weights", [0.0, 1.0], values.reshape(-1), kind)
    path = file.written()
    for time_s in TIMES_S:
        report, at = LossReport(), min(time_s, 1.0)
        share = {"LINEAR": at, "STEP": math.floor(at), "CUBICSPLINE": at * at * (3.0 - 2.0 * at)}[kind]
        model = read_whole(path, report, time_s=time_s)
        same_points(model, morphed(2.0 * share, 1.0 - share))
        assert model.posed and f"morph targets that move: the pose at {time_s:g} s" in report.text()


def test_morph_targets_are_applied_before_a_skin(tmp_path: Path) -> None:
    file = with_skin(tmp_path)
    far = np.tile(np.array([1, 0, 0], np.float32), (4, 1))
    file.primitive["targets"] = [{"POSITION": file.accessor(far)}]
    file.json["meshes"][0]["weights"] = [1.0]
    # by -90 degrees about y through (1, 0, 0), the point (2, 1, 0) becomes (1, 1, 1)
    assert np.abs(points(read_whole(file.written())) - (1.0, 1.0, 1.0)).max(axis=1).min() < 1e-6


def test_targets_that_cannot_be(tmp_path: Path) -> None:
    file = with_morphs(tmp_path)
    file.json["meshes"][0]["weights"] = [1.0]
    with pytest.raises(
        SceneError, match=r"meshes\[0\].primitives\[0\].targets: expected 1 targets, one a weight, got 2"
    ):
        read_whole(file.written())
    file.json["meshes"][0]["weights"] = [1.0, 0.0]
    file.primitive["targets"][0]["POSITION"] = file.accessor(np.zeros((3, 3), np.float32))
    with pytest.raises(SceneError, match=r"targets\[0\].POSITION: expected 4 elements, got 3"):
        read_whole(file.written())
    file = with_morphs(tmp_path)
    channel(file, 0, "weights", [0.0, 1.0], np.zeros(3))
    with pytest.raises(SceneError, match=r"samplers\[0\].output: expected 1 elements for each of 2 times, got 3"):
        read_whole(file.written())


def test_growth_is_as_at_the_time(tmp_path: Path) -> None:
    file = animated(tmp_path, (0, "scale", [0.0, 1.0], [[1, 1, 1], [3, 1, 1]], "LINEAR"))
    path = file.written()
    for time_s in (0.0, 0.5, 2.0):
        (part,) = read_whole(path, time_s=time_s).parts
        grown = 1.0 + 2.0 * min(time_s, 1.0)
        assert part.track is None and where(part, (1.0, 0.0, 0.0), 0.0) == pytest.approx((1.0 + grown, 1.0, 0.0))


def test_an_animation_of_one_key_is_a_pose(tmp_path: Path) -> None:
    file, report = animated(tmp_path, (0, "translation", [0.0], [[5, 0, 0]], "LINEAR")), LossReport()
    (part,) = read_whole(file.written(), report).parts
    assert part.track is None and not report.losses
    assert where(part, (0.0, 0.0, 0.0), 0.0) == pytest.approx((5.0, 2.0, 0.0))


def test_the_camera_of_a_model_does_not_follow_its_pose(tmp_path: Path) -> None:
    file = with_morphs(tmp_path)
    channel(file, 0, "weights", [0.0, 1.0], np.array([0.0, 0.0, 9.0, 9.0]))
    path = str(file.written())
    first, later = (load_seen(path, Look(pose_s=time_s))[0] for time_s in (0.0, 1.0))
    np.testing.assert_array_equal(first.camera.to_world, later.camera.to_world)
    one, other = (render(path, 32, time_s) for time_s in (0.0, 1.0))
    assert np.abs(one - other).max() > 0.1
    np.testing.assert_array_equal(one, render(path, 32, 0.0))
