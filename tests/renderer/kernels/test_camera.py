"""Where known points land in the picture."""

import numpy as np
import pytest

from renderer.trace import Renderer
from scenes.canonical import Emissive, EnvironmentLight, Instance, PerspectiveCamera, Scene, Sphere
from tests.oracles.brute_force_tracer import track_matrix
from tests.renderer.builders import colors, look_at, place, turning_camera


def _predicted(camera: PerspectiveCamera, point: np.ndarray, width: int, height: int) -> tuple[float, float]:
    """Pixel coordinates of a world point."""
    x, y, z, _ = np.linalg.inv(camera.to_world) @ [*point, 1.0]
    pixels = min(width, height) / 2 / np.tan(np.radians(camera.fov_deg) / 2)
    return width / 2 + x / -z * pixels, height / 2 - y / -z * pixels


@pytest.mark.parametrize(("width", "height"), [(48, 48), (80, 40), (40, 90)], ids=["square", "wide", "tall"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_marker_lands_on_the_predicted_pixel(width: int, height: int, mirrored: bool) -> None:
    matrix = look_at((1.0, 2.0, 5.0), (0.2, 0.0, -0.5)) @ np.diag([-1.0 if mirrored else 1.0, 1, 1, 1])
    camera = PerspectiveCamera(matrix, 40.0)
    for point in ((0.3, 0.4, 0.2), (-0.9, 0.3, 0.1), (0.8, -0.6, -0.4)):
        scene = Scene(camera, (Instance(Sphere(0.12), Emissive((1, 1, 1)), place(point)),))
        picture = Renderer(scene).render_frame(0.0, width, height).numpy()[:, :, 0]
        rows, columns = np.nonzero(picture)
        x, y = _predicted(camera, np.array(point), width, height)
        assert len(rows) > 3
        assert abs(columns.mean() + 0.5 - x) < 0.6 and abs(rows.mean() + 0.5 - y) < 0.6


def test_environment_dots_lie_where_the_convention_says() -> None:
    """One coloured texel per axis, seen by a camera that looks along it."""
    equator = {(0, 0, -1): 0, (1, 0, 0): 16, (0, 0, 1): 32, (-1, 0, 0): 48}
    for number, (direction, column) in enumerate(equator.items()):
        picture = np.zeros((33, 64, 3), np.float32)
        picture[16, [column - 1, column], :] = number + 1.0  # the direction lies on the border of two texels
        got = _along(direction, picture)
        np.testing.assert_allclose(got[0], number + 1.0, rtol=1e-3)
        assert (got[1] == 0).all()
    for direction, row in (((0, 1, 0), 0), ((0, -1, 0), 32)):
        picture = np.zeros((33, 64, 3), np.float32)
        picture[row] = 7.0
        np.testing.assert_allclose(_along(direction, picture), [[7.0] * 3, [0.0] * 3], rtol=1e-3)


def _along(direction: tuple[int, int, int], picture: np.ndarray) -> np.ndarray:
    """Colours of an environment at the middle and near a corner of a view along a direction."""
    camera = PerspectiveCamera(look_at((0, 0, 0), direction, up=(0.1, 0.3, 0.2)), 30.0)
    return colors(Scene(camera, (), (EnvironmentLight(picture),)), np.array([[0.5, 0.5], [0.02, 0.02]]))


def test_camera_scale_does_not_matter_and_its_track_is_the_outer_motion() -> None:
    marker = (Instance(Sphere(0.3), Emissive((1, 1, 1)), place((0.2, 0.1, 0))),)
    matrix = look_at((1.0, 0.5, 4.0), (0, 0, 0))
    plain = Renderer(Scene(PerspectiveCamera(matrix, 30.0), marker)).render_frame(0.0, 40, 40)
    scaled = Renderer(Scene(PerspectiveCamera(matrix @ np.diag([7, 7, 7, 1.0]), 30.0), marker)).render_frame(
        0.0, 40, 40
    )
    assert (plain != scaled).sum() <= 6
    track = turning_camera()
    moving = Renderer(Scene(PerspectiveCamera(matrix, 30.0, track=track), marker)).render_frame(0.6, 40, 40)
    still = Renderer(Scene(PerspectiveCamera(track_matrix(track, 0.6) @ matrix, 30.0), marker)).render_frame(
        0.0, 40, 40
    )
    assert (moving != still).sum() <= 6
    assert (moving != plain).sum() > 50
