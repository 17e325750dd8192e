"""A scene far from the origin gives the picture that it gives near it."""

import dataclasses
import warnings

import numpy as np
import pytest

from renderer.tables.origin import near_origin
from renderer.trace import Renderer
from scenes import catalog
from scenes.canonical import (
    Cube,
    DirectionalLight,
    EnvironmentLight,
    HeightField,
    ImageTexture,
    Instance,
    Light,
    Matte,
    Mesh,
    Mirror,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    RigidTrack,
    Scene,
    Sphere,
    SpotLight,
)
from scenes.models import read_model
from tests.renderer.builders import WHITE, look_at, place, sphere_mesh
from tests.renderer.test_scale import BOX

SKY = EnvironmentLight(np.ones((1, 1, 3), np.float32))
DIRECTION = np.array([1.0, -1.0, 0.3])


def _frame(scene: Scene, time_s: float = 0.0, side: int = 96, **more) -> np.ndarray:
    return Renderer(scene, **more).render_frame(time_s, side, side).numpy()


@pytest.mark.parametrize("shape", [BOX, Cube(), Sphere(), sphere_mesh(16)], ids="box cube ball mesh".split())
@pytest.mark.parametrize("far", [300.0, 1e4, 1e5, 1e7])
def test_closed_room_stays_dark_however_far_it_is(shape, far: float) -> None:
    at = far * DIRECTION
    room = Instance(shape, Matte(WHITE), place(at, (0.3, 0.5, 0.1)))
    lights = (
        DirectionalLight((-1, -2, -0.7), (100, 100, 100)),
        PointLight(tuple(np.add(at, [3, 2, 1]).tolist()), (1e3, 1e3, 1e3)),
    )
    scene = Scene(PerspectiveCamera(place(at, (0.2, 0.7, 0.0)), 120.0), (room,), lights, background=SKY)
    for packets in (True, False):
        assert (_frame(scene, side=128, packets=packets) == 0).all()


def _track(at: np.ndarray, along: tuple[float, float, float]) -> RigidTrack:
    half = 0.1
    turn = [[0.0, 0.0, 0.0, 1.0], [0.0, np.sin(half), 0.0, np.cos(half)]]
    return RigidTrack(-1.0, 2.0, np.array([at, np.add(at, along)], np.float64), np.array(turn))


def _still_life(at: np.ndarray) -> Scene:
    """Everything with a position: shapes, a relief, moving objects, a moving camera, lamps."""
    relief = HeightField(Matte(ImageTexture(np.ones((1, 1, 3), np.float32))), np.tile([0.2, 0.9], (8, 4)), 0.2, 32)
    glow = (4.0, 4.0, 3.0)
    sideways = (-np.pi / 2, 0, 0)
    return Scene(
        PerspectiveCamera(look_at((1, 2.5, 4), (0, 0.6, 0)), 40.0, track=_track(at, (0.3, 0.0, 0.1))),
        (
            Instance(Rectangle(), Matte(WHITE), place(at, sideways, (6, 6, 6))),
            Instance(sphere_mesh(24), Matte(WHITE), place(np.add(at, (0, 1, 0)), (0.3, 0.2, 0.1), (0.7, 0.9, 0.8))),
            Instance(Sphere(0.5), Mirror(), place((1.2, 0.5, 0.6)), _track(at, (0.0, 0.2, 0.0))),
            Instance(Cube(), Matte(WHITE), place(np.add(at, (-1.3, 0.4, 0.5)), (0, 0.5, 0), (0.4, 0.4, 0.4))),
            Instance(Rectangle(), relief, place(np.add(at, (0.2, 0.3, 1.6)), sideways, (0.5, 0.5, 0.5))),
            Instance(Rectangle(), Matte(WHITE), place(np.add(at, (0, 4, 0)), (np.pi / 2, 0, 0)), emission=glow),
            Instance(Sphere(0.2), Matte(WHITE), place((-1.0, 1.6, 1.0)), _track(at, (0.1, 0.0, 0.0)), emission=glow),
        ),
        (
            DirectionalLight((-1, -2, -0.5), (1, 1, 1)),
            PointLight(tuple(np.add(at, (-2, 4, 3)).tolist()), (20, 20, 20)),
            SpotLight(tuple(np.add(at, (2, 4, 1)).tolist()), tuple(at.tolist()), (30, 20, 20), 10.0, 30.0),
        ),
        background=SKY,
    )


@pytest.mark.parametrize("far", [1e4, 1e5, 1e7])
@pytest.mark.parametrize("packets", [True, False])
def test_still_life_is_the_same_far_away(far: float, packets: bool) -> None:
    near = _frame(_still_life(np.zeros(3)), 0.25, packets=packets)
    got = _frame(_still_life(far * np.array([1.0, -0.7, 0.123])), 0.25, packets=packets)
    difference = np.abs(got - near).max(-1)
    assert (difference > 1e-3).mean() < 2e-3  # shadow edges; a seventh of it, before the scene was moved
    assert (difference > 1e-3).sum() < 20


def test_a_shift_by_a_multiple_of_the_step_changes_no_bit() -> None:
    near, far = (_frame(_still_life(np.array(at)), 0.25) for at in ((0.0, 0.0, 0.0), (2.0**20, -(2.0**16), 2.0**12)))
    assert np.array_equal(near, far)


@pytest.mark.parametrize("name", catalog.SCENES.names())
def test_built_in_scenes_stay_where_they_are(name: str) -> None:
    scene = catalog.load(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert near_origin(scene) is scene


def test_motion_that_is_shared_stays_shared() -> None:
    track = _track(np.array([1e6, 0.0, 0.0]), (0.0, 0.0, 1.0))
    ball = Instance(Sphere(), Matte(WHITE), track=track)
    scene = near_origin(Scene(PerspectiveCamera(track=track), (ball, dataclasses.replace(ball))))
    assert scene.camera.track is scene.instances[0].track is scene.instances[1].track
    assert scene.camera.track is not track


def test_a_directional_light_and_the_sky_have_no_place() -> None:
    lights: tuple[Light, ...] = (DirectionalLight((0, -1, 0), (1, 1, 1)), SKY)
    ball = Instance(Sphere(), Matte(WHITE), place((1e6, 0, -5)))
    scene = Scene(PerspectiveCamera(place((1e6, 0, 0))), (ball,), lights)
    moved = near_origin(scene)
    assert moved is not scene and moved.lights == lights


def test_what_is_too_far_from_everything_else_is_named() -> None:
    ball = Instance(Sphere(), Matte(WHITE), place((0, 0, -5)), name="near")
    far = Instance(Sphere(0.5), Matte(WHITE), place((1e6, 0, 0)), name="distant ball")
    with pytest.warns(UserWarning, match=r"'distant ball' of size 1 lies 1e\+06 .* exact to 0\.06 only"):
        Renderer(Scene(PerspectiveCamera(), (ball, ball, far)))


def test_a_mesh_that_has_lost_its_form_is_named() -> None:
    mesh = Mesh((BOX.vertices + 1e5).astype(np.float32), BOX.faces, source="box.ply")
    camera = PerspectiveCamera(place((1e5, 1e5, 1e5 + 5)))
    with pytest.warns(UserWarning, match=r"mesh 'box.ply' of size 2 is stored with a precision of only 0\.0\d+"):
        Renderer(Scene(camera, (Instance(mesh, Matte(WHITE)),)))


def test_vertices_in_double_precision_keep_their_form() -> None:
    def room(at: float, dtype: type) -> Scene:
        mesh = Mesh(BOX.vertices.astype(dtype) * 0.9 + at, BOX.faces, source="box")
        camera = PerspectiveCamera(look_at((at + 2, at + 3, at + 4), (at, at, at)), 40.0)
        return Scene(camera, (Instance(mesh, Matte(WHITE)),), (DirectionalLight((-1, -2, -0.5), (1, 1, 1)),))

    assert np.abs(_frame(room(2.0**20, np.float64)) - _frame(room(0.0, np.float32))).max() < 1e-5


FILES = {
    "far.obj": "".join(f"v {x} {y} {z}\n" for x, y, z in BOX.vertices.astype(float) * 0.9 + 2.0**22 + 0.1)
    + "".join(f"f {a} {b} {c}\n" for a, b, c in BOX.faces[1:] + 1),
    "far.pbrt": 'Camera "perspective"\nWorldBegin\nShape "trianglemesh" "point P" ['
    + " ".join(str(value) for value in (BOX.vertices.astype(float) * 0.9 + 2.0**22 + 0.1).reshape(-1))
    + '] "integer indices" ['
    + " ".join(str(value) for value in BOX.faces[1:].reshape(-1))
    + "]\nWorldEnd\n",
}


@pytest.mark.parametrize("name", FILES)
def test_meshes_of_files_keep_their_form_far_away(name: str, tmp_path) -> None:
    """At 4e6, float32 has steps of a half. A face is missing, so that nobody takes the box for a cube."""
    path = tmp_path / name
    path.write_text(FILES[name])
    mesh = catalog.load_file(str(path))[0].instances[0].shape if name.endswith("pbrt") else read_model(path)[0].shape
    assert isinstance(mesh, Mesh)
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([1.8, 1.8, 1.8], abs=1e-6)
