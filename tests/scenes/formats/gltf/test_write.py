"""glTF files that are written, read by others (trimesh, Pillow) and by hand."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenes.animation import pose_at
from scenes.canonical import (
    ConstantTexture,
    Cube,
    DirectionalLight,
    Emissive,
    EnvironmentLight,
    Film,
    Instance,
    Matte,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    RigidTrack,
    Scene,
    SceneError,
    SpotLight,
    SunSky,
)
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.gltf import document
from scenes.models import read_model
from tests.scenes.formats.gltf.files import GREY, shown, written

Z_UP = np.array([[1.0, 0, 0, 1], [0, 0, -1.0, -9], [0, 1.0, 0, 2], [0, 0, 0, 1]])
"""A camera that looks along +y, with z upwards."""


def world(tree: dict[str, Any]) -> dict[int, np.ndarray]:
    """The transforms of nodes to the world, from their matrices."""
    found: dict[int, np.ndarray] = {}

    def visit(number: int, above: np.ndarray) -> None:
        node = tree["nodes"][number]
        found[number] = above @ np.array(node.get("matrix", np.eye(4).ravel())).reshape(4, 4).T
        for child in node.get("children", ()):
            visit(child, found[number])

    for root in tree["scenes"][0]["nodes"]:
        visit(root, np.eye(4))
    return found


def pixel(camera: np.ndarray, yfov: float, aspect: float, point: np.ndarray) -> np.ndarray:
    """Where a point is in the picture of a camera that looks along -z, in half heights."""
    x, y, z = (np.linalg.inv(camera) @ [*point, 1.0])[:3]
    assert z < 0.0 and aspect > 0.0
    return np.array([x, y]) / -z / np.tan(yfov / 2.0)


@pytest.mark.parametrize("mirrored", [False, True])
def test_turned_and_mirrored_scenes_keep_their_picture(mirrored: bool, tmp_path: Path) -> None:
    view = Z_UP @ np.diag([-1.0 if mirrored else 1.0, 1.0, 1.0, 1.0])
    place = np.eye(4)
    place[:3, 3] = (2.0, 3.0, 4.0)
    scene = Scene(PerspectiveCamera(view, 40.0), (Instance(Cube(), GREY, place),), film=Film(200, 100))
    tree, losses = written(tmp_path, scene)
    assert losses == []
    nodes = world(tree)
    camera = next(nodes[n] for n, node in enumerate(tree["nodes"]) if "camera" in node)
    cube = next(nodes[n] for n, node in enumerate(tree["nodes"]) if "mesh" in node)
    assert np.linalg.det(camera[:3, :3]) == pytest.approx(1.0) and camera[1, 1] == pytest.approx(1.0)
    lens = tree["cameras"][0]["perspective"]
    assert lens["aspectRatio"] == 2.0 and lens["yfov"] == pytest.approx(np.radians(40.0))
    at = pixel(camera, lens["yfov"], 2.0, cube[:3, 3])
    np.testing.assert_allclose(at, pixel(view, np.radians(40.0), 2.0, place[:3, 3]), atol=1e-12)


def test_the_field_of_view_is_upright_in_portraits(tmp_path: Path) -> None:
    tree, _ = written(tmp_path, Scene(PerspectiveCamera(fov_deg=40.0), (), film=Film(100, 200)))
    expected = 2.0 * np.arctan(2.0 * np.tan(np.radians(20.0)))
    assert tree["cameras"][0]["perspective"]["yfov"] == pytest.approx(expected)
    tree, _ = written(tmp_path, Scene(OrthographicCamera(half_width=3.0), (), film=Film(100, 200)))
    assert tree["cameras"][0]["orthographic"]["xmag"] == 3.0 and tree["cameras"][0]["orthographic"]["ymag"] == 6.0


@pytest.mark.parametrize("name", ["a.gltf", "a.glb"])
def test_others_read_the_same_triangles(name: str, tmp_path: Path) -> None:
    import trimesh

    shear = np.array([[1.0, 0.5, 0, 5], [0, -2.0, 0, 0], [0, 0, 3.0, -1], [0, 0, 0, 1]])
    far = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float64) + 1e6 + 0.001
    mesh = Mesh(far, np.array([[0, 1, 2]], np.int32))
    scene = Scene(PerspectiveCamera(), (Instance(Cube(), GREY, shear), Instance(mesh, GREY)))
    save_scene_file(scene, tmp_path / name)
    read = trimesh.load(tmp_path / name)
    assert isinstance(read, trimesh.Scene)
    found = [part for part in read.dump() if isinstance(part, trimesh.Trimesh)]
    cube = next(part for part in found if len(part.faces) == 12)
    np.testing.assert_allclose(cube.bounds, [[3.5, -2.0, -4.0], [6.5, 2.0, 2.0]], atol=1e-6)
    single = next(part for part in found if len(part.faces) == 1)
    np.testing.assert_allclose(single.vertices, far, atol=1e-7)


def test_glb_has_whole_chunks(tmp_path: Path) -> None:
    save_scene_file(shown(GREY), tmp_path / "a.glb")
    content = (tmp_path / "a.glb").read_bytes()
    size, kind = struct.unpack_from("<II", content, 12)
    assert struct.unpack_from("<III", content) == (0x46546C67, 2, len(content)) and size % 4 == 0
    assert kind == 0x4E4F534A and json.loads(content[20 : 20 + size])["buffers"][0]["byteLength"] + 28 + size == len(
        content
    )
    assert [path.name for path in tmp_path.iterdir()] == ["a.glb"]


def test_too_large_files_are_refused_and_nothing_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(document, "_SIZE_MOST", 1000)
    with pytest.raises(SceneError, match=r"a\.glb: expected less than 4 GiB, got .* bytes; use \.gltf"):
        save_scene_file(shown(GREY), tmp_path / "a.glb")
    assert list(tmp_path.iterdir()) == []


def test_numbers_that_are_not_finite_are_named_and_nothing_is_left(tmp_path: Path) -> None:
    light = PointLight((0.0, 0.0, 0.0), (float("inf"), 1.0, 1.0))
    with pytest.raises(SceneError, match=r"a.gltf: expected finite numbers, got nan in extensions.KHR_lights_punctual"):
        save_scene_file(Scene(PerspectiveCamera(np.eye(4)), (), (light,)), tmp_path / "a.gltf")
    assert not list(tmp_path.iterdir())


def test_what_is_shared_is_written_once(tmp_path: Path) -> None:
    mesh = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    other = Matte(ConstantTexture((0.1, 0.1, 0.1)))
    parts = (Instance(mesh, GREY), Instance(mesh, GREY, np.diag([2.0, 2, 2, 1])), Instance(mesh, other))
    tree, _ = written(tmp_path, Scene(PerspectiveCamera(), parts))
    assert len(tree["meshes"]) == len(tree["materials"]) == 2 and len(tree["accessors"]) == 2
    assert [node.get("mesh") for node in tree["nodes"]] == [None, 0, 0, 1]


# --- lights and motion ---------------------------------------------------------------------------------------------


def test_lights_have_their_units_and_places(tmp_path: Path) -> None:
    lights = (
        PointLight((1.0, 2.0, 3.0), (4.0, 2.0, 1.0)),
        SpotLight((1.0, 0.0, 0.0), (1.0, 0.0, 5.0), (2.0, 2.0, 2.0), 20.0, 30.0, "quadratic"),
        DirectionalLight((0.0, -2.0, 0.0), (0.0, 3.0, 6.0)),
        DirectionalLight((0.0, -2.0, 0.0), (1.0, 1.0, 1.0), 5.0),
        EnvironmentLight(np.ones((1, 1, 3), np.float32)),
        SunSky((0.0, 0.6, 0.8)),
    )
    tree, losses = written(tmp_path, shown(GREY, lights=lights, ambient=(0.1, 0.1, 0.1)))
    point, spot, sun, *_ = tree["extensions"]["KHR_lights_punctual"]["lights"]
    assert point == {"type": "point", "color": [1.0, 0.5, 0.25], "intensity": 4.0}
    cone = {"innerConeAngle": np.radians(20.0), "outerConeAngle": np.radians(30.0)}
    assert spot == {"type": "spot", "color": [1.0, 1.0, 1.0], "intensity": 2.0, "spot": pytest.approx(cone)}
    assert sun == {"type": "directional", "color": [0.0, 0.5, 1.0], "intensity": 6.0}
    places = [matrix for n, matrix in world(tree).items() if "extensions" in tree["nodes"][n]]
    np.testing.assert_allclose(places[0][:3, 3], (1.0, 2.0, 3.0))
    np.testing.assert_allclose(-places[1][:3, 2], (0.0, 0.0, 1.0), atol=1e-12)
    np.testing.assert_allclose(-places[2][:3, 2], (0.0, -1.0, 0.0), atol=1e-12)
    assert "KHR_lights_punctual" in tree["extensionsUsed"]
    for what in ("a sun of 5 degrees", "light all around: left out", "the sky: left out", "constant ambient light"):
        assert any(what in loss for loss in losses), losses


def test_lamps_shine_to_their_front(tmp_path: Path) -> None:
    lamp = Instance(Rectangle(), GREY, emission=(30.0, 20.0, 10.0))
    tree, losses = written(
        tmp_path, Scene(PerspectiveCamera(), (lamp, Instance(Rectangle(), Emissive((0.5, 1.0, 0.25)))))
    )
    front, both = tree["materials"]
    assert front["emissiveFactor"] == pytest.approx([1.0, 2 / 3, 1 / 3]) and not front["doubleSided"]
    assert front["extensions"]["KHR_materials_emissive_strength"] == {"emissiveStrength": 30.0}
    assert both["emissiveFactor"] == [0.5, 1.0, 0.25] and both["doubleSided"]
    assert losses == ["Rectangle0: the back of a lamp: not drawn from behind"]
    found = load_scene_file(tmp_path / "a.gltf").instances
    assert found[0].emission == pytest.approx((30.0, 20.0, 10.0)) and found[0].material == GREY
    assert isinstance(found[0].shape, Rectangle) and found[1].material == Emissive((0.5, 1.0, 0.25))


def test_motion_is_an_animation(tmp_path: Path) -> None:
    turn = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, np.sin(0.5), np.cos(0.5)], [0.0, 0.0, np.sin(1.0), np.cos(1.0)]])
    track = RigidTrack(-0.5, 0.5, np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]), turn)
    place = np.diag([2.0, 2.0, 2.0, 1.0])
    parts = (Instance(Cube(), GREY, place, track), Instance(Cube(), GREY, track=track))
    tree, losses = written(tmp_path, Scene(PerspectiveCamera(), parts))
    assert losses == ["motion: motion before the time zero: left out"]
    (animation,) = tree["animations"]
    assert [channel["target"]["path"] for channel in animation["channels"]] == ["translation", "rotation"]
    moving = tree["nodes"][animation["channels"][0]["target"]["node"]]
    assert len(moving["children"]) == 2
    found = read_model(tmp_path / "a.gltf")[0]
    assert found.track is not None and found.track.start_s == 0.0
    for time_s in (0.0, 0.25, 0.5, 9.0):
        expected = pose_at(track, time_s) @ place
        np.testing.assert_allclose(pose_at(found.track, time_s) @ found.to_world, expected, atol=1e-6)
