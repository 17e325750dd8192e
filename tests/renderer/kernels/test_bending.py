"""Normal maps, bump maps and holes along paths; kernels are those that the other tests of paths share."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from scenes.canonical import (
    Bumped,
    ConstantTexture,
    DirectionalLight,
    ImageTexture,
    Instance,
    Masked,
    Matte,
    Mesh,
    NormalMapped,
    OrthographicCamera,
)
from tests.renderer.builders import WHITE, place
from tests.renderer.kernels.test_paths import grey, mean_color, wall

TILT = 0.5
SUN = DirectionalLight((-0.6, -0.3, -1.0), (np.pi, np.pi, np.pi))
TOWARDS = np.array([0.6, 0.3, 1.0]) / np.linalg.norm([0.6, 0.3, 1.0])


def tilted(across: float, along: float) -> NormalMapped:
    """A white surface whose normal leans towards growing u and v."""
    vector = np.array([across, along, np.sqrt(1.0 - across**2 - along**2)])
    return NormalMapped(Matte(WHITE), ConstantTexture(tuple(float(part) for part in 0.5 * vector + 0.5)))


@pytest.mark.parametrize(("across", "along"), [(TILT, 0.0), (0.0, TILT), (-0.3, 0.2)])
def test_a_normal_map_turns_the_normal_towards_u_and_v(across: float, along: float) -> None:
    normal = np.array([across, along, np.sqrt(1.0 - across**2 - along**2)])
    np.testing.assert_allclose(mean_color(wall(tilted(across, along), SUN, depth=0), 16), normal @ TOWARDS, rtol=1e-4)


def test_meshes_turn_by_their_texture_coordinates_and_backs_the_other_way() -> None:
    corners = np.array([[-50, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]], np.float32)
    uvs = np.array([[0, 1], [0, 0], [1, 0], [1, 1]], np.float32)  # u grows along +y, v along -x
    mesh = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), uvs=uvs)
    scene = wall(tilted(TILT, 0.0), SUN, depth=0)
    scene = dataclasses.replace(scene, instances=(Instance(mesh, tilted(TILT, 0.0)),))
    normal = np.array([0.0, TILT, np.sqrt(1.0 - TILT**2)])
    np.testing.assert_allclose(mean_color(scene, 16), normal @ TOWARDS, rtol=1e-4)
    behind = OrthographicCamera(place((0.0, 0.0, -2.0), (0.0, np.pi, 0.0)), 0.5)
    sun = DirectionalLight((-0.6, -0.3, 1.0), (np.pi, np.pi, np.pi))
    back = dataclasses.replace(scene, camera=behind, lights=(sun,))
    np.testing.assert_allclose(mean_color(back, 16), -normal @ (TOWARDS * (1, 1, -1)), rtol=1e-4)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_bump_map_turns_the_normal_against_its_slope(axis: int) -> None:
    ramp = (np.arange(64, dtype=np.float32) + 0.5) / 64
    image = np.tile(ramp, (64, 1)) if axis == 0 else np.tile(ramp[::-1, None], (1, 64))
    height = ImageTexture(np.repeat(image[..., None], 3, axis=2), wrap="clamp", filter="bilinear")
    # the wall is 100 wide and high: a rise of 50 over all of it
    scene = wall(Bumped(Matte(WHITE), height, 50.0), SUN, depth=0)
    normal = np.array([0.0, 0.0, 1.0])
    normal[axis] = -0.5
    np.testing.assert_allclose(mean_color(scene, 16), normal @ TOWARDS / np.linalg.norm(normal), rtol=1e-3)


def test_holes_by_a_cutoff_are_all_or_nothing_and_let_shadow_rays_pass() -> None:
    bare = wall(Matte(grey(0.5)), SUN, depth=0)
    lit = mean_color(bare, 64)
    for opacity, cutoff, share in ((0.4, 0.5, 1.0), (0.6, 0.5, 0.0), (0.4, None, 0.6)):
        sheet = Masked(Matte(WHITE), grey(opacity), cutoff)
        # in the way of the sun, not of the camera
        between = Instance(bare.instances[0].shape, sheet, place((1.2, 0.6, 2.0), scale=(1.0, 1.0, 1.0)))
        scene = dataclasses.replace(
            bare, instances=(*bare.instances, between), camera=OrthographicCamera(place((0.0, 0.0, 1.0)), 0.1)
        )
        np.testing.assert_allclose(mean_color(scene, 64), share * lit, rtol=1e-4, atol=1e-7)
