"""Scenes that are made anew for each of their poses."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from renderer.posed import POSES_HZ, PosedRenderer, Poses, renderer_at, renderers
from renderer.trace import Renderer
from scenes.animation import pose_at
from scenes.arithmetic import product
from scenes.canonical import ConstantTexture, Instance, Mesh, PerspectiveCamera, Phong, RigidTrack, Scene
from tsar.projection import project
from tsar.types import FrameletBatch

TURNING = RigidTrack(0.0, 1.0, np.array([[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]]), np.array([[0.0, 0, 0, 1], [0.0, 0, 0, 1]]))
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def quad(x: float, y: float, z: float, size: float = 0.5) -> Mesh:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float64) * size + (x, y, z)
    return Mesh(corners.astype(np.float32), FACES, source=f"{x} {y} {z}")


def scene_at(time_s: float, far: float = 0.0) -> Scene:
    """A quad that rises, one that moves rigidly, and from half a second on a third in front of both."""
    red, blue, green = (Phong(ConstantTexture((float(n == 0), float(n == 2), float(n == 1)))) for n in range(3))
    place = np.eye(4)
    place[:3, 3] = far, 0.0, 0.0
    above = product(place, np.eye(4))
    parts = [
        Instance(quad(-1.0, time_s - 0.5, 0.0), red, above),
        Instance(quad(1.0, 0.0, 0.0), blue, above, dataclasses.replace(TURNING)),
    ]
    if time_s >= 0.5:
        own = RigidTrack(0.0, 1.0, np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), TURNING.rotation)
        parts.insert(0, Instance(quad(0.0, 0.0, 1.0, 0.2), green, above, own))
    camera = np.eye(4)
    camera[:3, 3] = far, 0.0, 5.0
    return Scene(PerspectiveCamera(camera, fov_deg=40.0), tuple(parts), ambient=(1.0, 1.0, 1.0))


def made(scene: Scene, origin: np.ndarray | None = None) -> Renderer:
    return Renderer(scene, threads=1, footprint_resolution_px=32.0, origin=origin)


def grid(time_s: float | torch.Tensor, side: int = 16) -> FrameletBatch:
    step = (torch.arange(side, dtype=torch.float32) + 0.5) / side
    y, x = torch.meshgrid(step, step, indexing="ij")
    number = torch.zeros(side, dtype=torch.int64)
    return FrameletBatch(number, number, torch.stack([x, y], dim=-1), time_s, hits=True)


@pytest.fixture(scope="module")
def posed() -> PosedRenderer:
    return PosedRenderer(Poses(scene_at, made), 32.0)


def test_a_batch_is_traced_in_the_pose_of_its_time(posed: PosedRenderer) -> None:
    for time_s, pose_s in ((-1.0, 0.0), (0.0, 0.0), (0.2, 0.2), (0.51 / POSES_HZ, 1 / POSES_HZ), (0.7, 0.7)):
        found, expected = posed.trace(grid(time_s)), made(scene_at(pose_s)).trace(grid(time_s))
        assert torch.equal(found.color, expected.color) and found.counters == expected.counters
        frame = posed.render_frame(time_s, 24, 16, 2)
        assert torch.equal(frame, made(scene_at(pose_s)).render_frame(time_s, 24, 16, 2))
    assert not torch.equal(posed.trace(grid(0.0)).color, posed.trace(grid(0.2)).color)


def test_samples_of_many_times_are_each_traced_in_their_own_pose(posed: PosedRenderer) -> None:
    times = (0.2 + 0.01 * torch.arange(16, dtype=torch.float64)[:, None]).repeat(1, 16)
    times[:, 9:] += 0.4
    found = posed.trace(grid(times))
    assert found.counters["primary_rays"] == 256 and found.hits is not None
    for row in range(16):
        for part in (slice(0, 9), slice(9, 16)):
            alone = posed.trace(grid(float(times[row, part][0])))
            assert alone.hits is not None
            assert torch.equal(found.color[row, part], alone.color[row, part])
            assert torch.equal(found.hits.instance[row, part], alone.hits.instance[row, part])
            # what appears later is at the place of its pose's time
            torch.testing.assert_close(found.hits.point[row, part], alone.hits.point[row, part], rtol=0, atol=0.5 / 60)


@pytest.mark.filterwarnings("ignore:instance.*lies")
@pytest.mark.parametrize("far", [0.0, 123456.0])
def test_hits_of_one_pose_are_projected_at_another(far: float) -> None:
    """Rigid parts move, what is posed stands still, and what appears later has a number of its own."""
    posed = PosedRenderer(Poses(lambda time_s: scene_at(time_s, far), made), 32.0)
    early, late = 0.25, 0.75
    for time_s, other_s in ((early, late), (late, early)):
        batch = grid(time_s)
        hits, view = posed.trace(batch).hits, posed.viewpoint(other_s)
        assert hits is not None and int(hits.instance.max()) < len(view.track_of_instance)
        position, _ = project(view, hits.instance, hits.point)
        x = made(scene_at(time_s, far)).trace(batch).color
        rigid = (x[..., 2] > 0.5).reshape(16, 16)
        turned = pose_at(TURNING, other_s)[1, 3] - pose_at(TURNING, time_s)[1, 3]
        rise = -turned / (2.0 * 5.0 * np.tan(np.radians(20.0)))
        moved = position - batch.position
        off = 2e-3 if far else 1e-4  # points of rigid parts are in the space of their motion, which is far away
        assert rigid.any() and moved[rigid][:, 1].sub(rise).abs().max() < off and moved[rigid][:, 0].abs().max() < off
        still = (x[..., 0] > 0.5) | (x[..., 1] > 0.5)
        assert still.any() and moved[still].abs().max() < off
    green = posed.trace(grid(late))
    assert green.hits is not None
    assert set(green.hits.instance[green.color[..., 1] > 0.5].tolist()) == {len(posed.poses.first.scene.instances)}


def test_renderers_of_one_scene_share_its_poses() -> None:
    asked = []

    def counted(time_s: float) -> Scene:
        asked.append(time_s)
        return scene_at(time_s)

    of = renderers(scene_at(0.0), counted, lambda scene, px, origin: made(scene, origin))
    coarse, fine = of(16.0), of(64.0)
    for one in (coarse, fine, coarse):
        one.trace(grid(0.2))
    assert asked == [0.0, 0.2] and renderer_at(fine, 0.2) is renderer_at(coarse, 0.2)
    for number in range(40):
        coarse.trace(grid(number / POSES_HZ))
    assert len(coarse.poses._kept) == 16  # type: ignore[union-attr]
    rigid = renderers(scene_at(0.0), None, lambda scene, px, origin: made(scene, origin))
    assert (
        rigid(16.0) is rigid(16.0)
        and isinstance(rigid(16.0), Renderer)
        and renderer_at(rigid(16.0), 9.0) is rigid(16.0)
    )
