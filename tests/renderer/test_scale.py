"""Neither acne nor leaks, whatever the unit of length."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from renderer.trace import Renderer
from scenes.canonical import (
    Cube,
    DirectionalLight,
    Emissive,
    EnvironmentLight,
    Instance,
    Matte,
    Mesh,
    Mirror,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    RigidTrack,
    Scene,
    Sphere,
)
from tests.renderer.builders import WHITE, colors, look_at, place, sphere_mesh

SCALES = (1e-6, 1e-3, 1.0, 1e3, 1e6)

_FACES = "013 032 467 475 045 051 237 276 026 064 157 173"
BOX = Mesh(
    np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32),
    np.array([[int(corner) for corner in face] for face in _FACES.split()], np.int32),
)


def _scaled(matrix: np.ndarray, scale: float) -> np.ndarray:
    return np.diag([scale, scale, scale, 1.0]) @ matrix


def _frame(scene: Scene, side: int = 64) -> np.ndarray:
    return Renderer(scene).render_frame(0.0, side, side).numpy()


def _still_life(scale: float, baked: bool) -> Scene:
    """Objects on a table far from the origin; ``baked`` puts the scale into the vertices instead of the transform."""
    mesh = sphere_mesh(24)
    if baked:
        mesh = Mesh((mesh.vertices * scale).astype(np.float32), mesh.faces, mesh.normals, mesh.uvs)
    turned = place((3.0, 1.0, -2.0), (0.3, 0.2, 0.1), (0.7, 0.9, 0.8))
    to_world = _scaled(turned, scale)
    if baked:
        to_world[:3, :3] /= scale
    base = np.array([3.0, 0.0, -2.0])
    return Scene(
        PerspectiveCamera(look_at(scale * (np.add(base, [1, 2.5, 4])), scale * (np.add(base, [0, 0.6, 0]))), 40.0),
        (
            Instance(Rectangle(), Matte(WHITE), _scaled(place(base, (-np.pi / 2, 0, 0), (6, 6, 6)), scale)),
            Instance(mesh, Matte(WHITE), to_world),
            Instance(Sphere(0.5), Mirror(), _scaled(place(np.add(base, [1.2, 0.5, 0.6])), scale)),
            Instance(
                Cube(), Matte(WHITE), _scaled(place(np.add(base, [-1.3, 0.4, 0.5]), (0, 0.5, 0), (0.4,) * 3), scale)
            ),
        ),
        (
            DirectionalLight((-1, -2, -0.5), (2, 2, 2)),
            PointLight(tuple(scale * (np.add(base, [-2, 4, 3]))), (20 * scale**2,) * 3),
        ),
    )


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("baked", [False, True])
def test_same_picture_at_any_scale(scale: float, baked: bool) -> None:
    reference, got = _frame(_still_life(1.0, False), 96), _frame(_still_life(scale, baked), 96)
    differing = np.abs(got - reference).max(-1) > 1e-3
    assert differing.sum() <= 0.003 * differing.size  # outlines and shadow edges only


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(
    "shape", [Rectangle(), BOX, Cube(), Sphere(), sphere_mesh(32)], ids="flat box cube ball mesh".split()
)
def test_no_acne_on_lit_surfaces(scale: float, shape) -> None:
    """Every point that faces the light of a lone convex object is lit, also under a grazing sun."""
    matrix = place((50.0, -20.0, 30.0), (0.4, 0.9, 0.2))
    at = np.array([50.0, -20.0, 30.0])
    towards = matrix[:3, :3] @ np.array([0.95, 0.2, 0.15])
    scene = Scene(
        PerspectiveCamera(look_at(scale * (at + 4 * matrix[:3, 2]), scale * at, up=(0, 1, 0)), 25.0),
        (Instance(shape, Matte(WHITE), _scaled(matrix, scale)),),
        (DirectionalLight(tuple(-towards), (1, 1, 1)),),
    )
    flat = isinstance(shape, Rectangle | Cube) or shape is BOX
    picture = _frame(scene, 64)[16:48, 16:48, 0]
    if flat:
        normal = 0.15 / np.linalg.norm([0.95, 0.2, 0.15]) / np.pi
        assert np.abs(picture - normal).max() < 1e-4
    else:
        # the lit part is one piece in every row: no dark specks within it
        lit = picture > 0.01
        assert lit.any() and (np.abs(np.diff(lit.astype(int), axis=1)).sum(1) <= 1).all()


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("shape", [BOX, Cube(), Sphere(), sphere_mesh(16)], ids="box cube ball mesh".split())
@pytest.mark.parametrize("far", [0.0, 30.0])
def test_closed_room_stays_dark(scale: float, shape, far: float) -> None:
    at = np.array([far, -far, 0.3 * far])
    room = Instance(shape, Matte(WHITE), _scaled(place(at, (0.3, 0.5, 0.1)), scale))
    lamp = Instance(Rectangle(), Emissive((9, 9, 9)), _scaled(place(np.add(at, [0, 0, -3]), scale=(50, 50, 50)), scale))
    scene = Scene(
        PerspectiveCamera(place(scale * at, (0.2, 0.7, 0.0)), 120.0),
        (room, lamp),
        (
            DirectionalLight((-1, -2, -0.7), (100, 100, 100)),
            PointLight(tuple(scale * (np.add(at, [3, 2, 1]))), (1e3 * scale**2,) * 3),
        ),
    )
    assert (_frame(scene, 128) == 0).all()


@pytest.mark.parametrize("scale", SCALES)
def test_mirrors_do_not_see_themselves(scale: float) -> None:
    """A convex mirror sees only what is around it."""
    room = Instance(Sphere(20.0), Emissive((1, 1, 1)), _scaled(place((7, 7, 7)), scale))
    for shape in (Sphere(), BOX, sphere_mesh(24)):
        ball = Instance(shape, Mirror(), _scaled(place((7, 7, 7), (0.3, 0.2, 0.5)), scale))
        camera = PerspectiveCamera(look_at(scale * np.array([7, 9, 12]), scale * np.array([7, 7, 7])), 30.0)
        renderer = Renderer(Scene(camera, (ball, room)))
        picture = renderer.render_frame(0.0, 64, 64).numpy()
        assert (picture == 1).all()


def _edge_positions(mesh: Mesh, camera: PerspectiveCamera, matrix: np.ndarray) -> np.ndarray:
    """Image positions of corners, middles and other points of edges that the camera sees."""
    rng = np.random.default_rng(0)
    points = mesh.vertices.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    face = mesh.faces[rng.integers(len(mesh.faces), size=20000)]
    share = rng.random((len(face), 1))
    share[::3], share[1::3] = 0.0, 0.5
    on_edges = points[face[:, 0]] * (1.0 - share) + points[face[:, 1]] * share
    local = (on_edges - camera.to_world[:3, 3]) @ camera.to_world[:3, :3]
    local = local[local[:, 2] < 0.0]
    half = -local[:, 2] * np.tan(np.radians(camera.fov_deg) / 2.0)
    position = np.stack([0.5 + 0.5 * local[:, 0] / half, 0.5 - 0.5 * local[:, 1] / half], -1)
    return position[((position > 0.0) & (position < 1.0)).all(axis=1)]


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(
    "matrix", [place(), place((3, -2, 5), (0.3, 0.5, 0.1), (0.7, 1.1, 0.9))], ids=["plain", "turned"]
)
def test_no_ray_slips_through_shared_edges(scale: float, matrix: np.ndarray) -> None:
    """From within closed meshes, rays through their very edges and corners never see the bright sky."""
    sky = EnvironmentLight(np.ones((1, 1, 3), np.float32))
    for rings in (0, 16, 64):
        mesh = BOX
        if rings:
            smooth = sphere_mesh(rings)
            mesh = Mesh(np.round(smooth.vertices, 6) + np.float32(0.0), smooth.faces)  # closes the seam
        placed = _scaled(matrix, scale)
        for turn in ((0.0, 0.0, 0.0), (0.0, 1.5, 0.0), (np.pi / 2, 0.0, 0.0)):
            camera = PerspectiveCamera(place(placed[:3, 3], turn), 100.0)
            scene = Scene(camera, (Instance(mesh, Matte(WHITE), placed),), background=sky)
            position = _edge_positions(mesh, camera, placed)
            assert len(position) > 1500
            assert (colors(scene, position) == 0.0).all()


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("shape", [Rectangle(), Cube(), Sphere(), sphere_mesh(32)], ids="flat cube ball mesh".split())
def test_no_acne_where_a_track_brings_back_what_was_placed_far_away(scale: float, shape) -> None:
    far, turn = scale * np.array([1000.0, -700.0, 300.0]), Rotation.from_rotvec((0.3, 0.8, -0.5))
    back = RigidTrack(0.0, 1.0, -turn.apply(far)[None], turn.as_quat()[None])
    matrix = _scaled(place(axis_angle=(0.2, 0.1, 0.4)), scale)
    matrix[:3, 3] = far
    axis = turn.apply(matrix[:3, 2] / scale)
    scene = Scene(
        PerspectiveCamera(look_at(4 * scale * axis, (0, 0, 0)), 20.0),
        (Instance(shape, Matte(WHITE), matrix, back),),
        (DirectionalLight(tuple(-(axis + 0.3 * turn.apply((1, 0, 0)))), (1, 1, 1)),),
    )
    picture = _frame(scene, 64)[8:56, 8:56, 0]
    assert (picture > 0.01).all()
