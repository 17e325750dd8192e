"""The car is whole and symmetric, and its wheels roll and steer."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.animation import Path, pose_at
from scenes.canonical import Instance, Mesh, Phong
from scenes.driving import car, wheel
from scenes.driving.body import FRONT_AXLE_M, HUB_OFFSET_M, REAR_AXLE_M
from tests.scenes.builders import areas, corners, face_normals, open_edges, placed

SPEED = 9.0
STRAIGHT = Path((0.0, 0.0), 0.6, SPEED)
BEND = Path((0.0, 0.0), 0.0, SPEED, ((2.0, 12.0, 0.8),))
WHEEL_NAMES = [f"{axle:+.0f} {side:+.0f}" for axle, side in car.WHEELS]


def parts() -> dict[str, Mesh]:
    return {**car.body_parts(), "tyre": wheel.tyre(), "rim": wheel.rim(), "brake": wheel.brake()}


@pytest.fixture(scope="module")
def straight() -> dict[str, Instance]:
    return {instance.name: instance for instance in car.instances(STRAIGHT, -0.5, 1.5)}


@pytest.fixture(scope="module")
def bend() -> dict[str, Instance]:
    return {instance.name: instance for instance in car.instances(BEND, -0.5, 2.0)}


def pose(instance: Instance, time_s: float) -> np.ndarray:
    assert instance.track is not None
    return pose_at(instance.track, time_s) @ instance.to_world


def in_car(instances: dict[str, Instance], name: str, time_s: float) -> np.ndarray:
    """Pose of a part in the frame of the body."""
    return np.linalg.inv(pose(instances["paint"], time_s)) @ pose(instances[name], time_s)


def test_it_is_a_mesh_of_many_triangles(straight: dict[str, Instance]) -> None:
    counted = sum(len(one.shape.faces) for one in straight.values() if isinstance(one.shape, Mesh))
    assert counted >= 10_000


def test_there_is_a_part_of_every_material(straight: dict[str, Instance]) -> None:
    assert set(parts()) == set(car.MATERIALS)
    assert set(straight) == set(car.body_parts()) | {
        f"{n} {at}" for n in ("tyre", "rim", "brake") for at in WHEEL_NAMES
    }
    for name, instance in straight.items():
        assert instance.material is car.MATERIALS[name if name in car.MATERIALS else name.split()[0]]


def test_materials_reflect_no_more_than_arrives() -> None:
    for name, material in car.MATERIALS.items():
        assert isinstance(material, Phong)
        assert 0.0 <= max(material.diffuse.value) + max(material.specular) <= 1.0, name


@pytest.mark.parametrize("name", sorted(car.MATERIALS))
def test_normals_are_unit_and_agree_with_the_faces(name: str) -> None:
    mesh = parts()[name]
    assert mesh.normals is not None and np.isfinite(mesh.normals).all() and np.isfinite(mesh.vertices).all()
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0, abs=1e-5)
    assert areas(mesh).min() > 0.0
    facing = np.einsum("ij,ikj->ik", face_normals(mesh), mesh.normals[mesh.faces].astype(np.float64))
    assert (facing < 0.0).mean() < 0.005, "all but slivers at creases"


@pytest.mark.parametrize("name", sorted(car.body_parts()))
def test_the_body_is_symmetric(name: str) -> None:
    """Extent to both sides is the same, and the integrals of y, xy and yz over the surface vanish."""
    mesh = car.body_parts()[name]
    y = mesh.vertices[:, 1]
    assert y.max() == pytest.approx(-y.min(), abs=1e-5)
    points, area = np.stack(corners(mesh)), areas(mesh)
    sums = points.sum(axis=0)
    first = (area[:, None] * sums).sum(axis=0) / 3.0
    second = np.einsum("f,kfi,kfj->ij", area, points, points) + np.einsum("f,fi,fj->ij", area, sums, sums)
    assert first[1] / area.sum() == pytest.approx(0.0, abs=5e-4)
    for other in (0, 2):
        assert second[1, other] / 12.0 / area.sum() == pytest.approx(0.0, abs=1e-3)


def test_the_shell_is_closed_and_sits_above_the_ground() -> None:
    whole = car.shell()
    assert open_edges(whole, 1e-6) == set()
    body = np.concatenate([mesh.vertices for mesh in car.body_parts().values()])
    assert 0.1 < body[:, 2].min() < 0.25 and 1.3 < body[:, 2].max() < 1.6
    assert 4.0 < np.ptp(body[:, 0]) < 5.0 and 1.7 < np.ptp(whole.vertices[:, 1]) < 2.0


def test_wheels_touch_the_ground_under_the_axles(straight: dict[str, Instance]) -> None:
    for axle, side in car.WHEELS:
        tyre = straight[f"tyre {axle:+.0f} {side:+.0f}"]
        assert isinstance(tyre.shape, Mesh)
        world = placed(pose(tyre, 0.3), tyre.shape.vertices.astype(np.float64))
        assert world[:, 2].min() == pytest.approx(0.0, abs=2e-3)
        middle = in_car(straight, tyre.name, 0.3)[:3, 3]
        assert middle == pytest.approx([axle, side * HUB_OFFSET_M, wheel.RADIUS_M], abs=1e-9)
    assert FRONT_AXLE_M > 0.0 > REAR_AXLE_M


@pytest.mark.parametrize("at", WHEEL_NAMES)
def test_wheels_roll_without_slipping(straight: dict[str, Instance], at: str) -> None:
    """The point of the tyre that touches the ground stands still; the one on top moves twice as fast as the car."""
    tyre, step = straight[f"tyre {at}"], 1e-5
    for time_s in (0.1016, 0.4719, 1.0023):
        now = pose(tyre, time_s)
        for height, speed in ((-wheel.RADIUS_M, 0.0), (0.0, SPEED), (wheel.RADIUS_M, 2.0 * SPEED)):
            point = np.append(now[:3, :3].T @ [0.0, 0.0, height], 1.0)
            moved = (pose(tyre, time_s + step) @ point - pose(tyre, time_s - step) @ point)[:3] / (2.0 * step)
            ahead = np.array([np.cos(0.6), np.sin(0.6), 0.0])
            assert moved == pytest.approx(speed * ahead, abs=1e-2)


def test_rear_wheels_roll_with_the_ground_in_a_bend(bend: dict[str, Instance]) -> None:
    """Where the path bends, the touching point of either rear wheel stands still along the car."""
    step = 1e-4
    for at in WHEEL_NAMES[2:]:
        tyre = bend[f"tyre {at}"]
        for time_s in np.linspace(0.1, 1.5, 9):
            now, ahead = pose(tyre, time_s), pose(bend["paint"], time_s)[:3, 0]
            point = np.append(now[:3, :3].T @ [0.0, 0.0, -wheel.RADIUS_M], 1.0)
            moved = (pose(tyre, time_s + step) @ point - pose(tyre, time_s - step) @ point)[:3] / (2.0 * step)
            assert float(moved @ ahead) == pytest.approx(0.0, abs=0.02)


def test_every_wheel_has_a_motion_of_its_own(straight: dict[str, Instance]) -> None:
    tracks = [straight[f"tyre {at}"].track for at in WHEEL_NAMES]
    assert len({id(track) for track in (*tracks, straight["paint"].track)}) == 5
    for at, track in zip(WHEEL_NAMES, tracks, strict=True):
        assert straight[f"rim {at}"].track is track and straight[f"brake {at}"].track is track
    places = np.stack([pose(straight[f"tyre {at}"], 0.2)[:3, 3] for at in WHEEL_NAMES])
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    assert apart[~np.eye(4, dtype=bool)].min() > 1.5
    assert len({id(straight[name].track) for name in car.body_parts()}) == 1


def axle_turn(instances: dict[str, Instance], at: str, time_s: float) -> float:
    """Angle about the upright by which a wheel's axle is turned in the car, left positive, radians."""
    outward = in_car(instances, f"tyre {at}", time_s)[:3, 1] * float(at.split()[1])
    assert outward[2] == pytest.approx(0.0, abs=1e-3), "the axle stays level"
    return float(np.arctan2(-outward[0], outward[1]))


def test_front_wheels_steer_and_rear_ones_do_not(bend: dict[str, Instance]) -> None:
    for time_s in (0.1, 0.5, 8.0 / SPEED, 1.2, 1.9):
        curvature = BEND.curvature(BEND.distance(np.array([time_s])))[0]
        wanted = np.arctan(curvature * (FRONT_AXLE_M - REAR_AXLE_M))
        for at in WHEEL_NAMES:
            steer = axle_turn(bend, at, time_s)
            assert steer == pytest.approx(wanted if at.startswith("+1") else 0.0, abs=3e-3)
    assert axle_turn(bend, "+1 +1", 8.0 / SPEED) > 0.2, "to the left in the middle of a left bend"
    assert axle_turn(bend, "+1 +1", 1.9) == pytest.approx(0.0, abs=1e-6), "straight behind it"


def test_the_outer_side_faces_outwards(bend: dict[str, Instance]) -> None:
    """The wheel's +y side, which has the hub cap, is away from the car on both sides."""
    hub = wheel.rim().vertices
    hub = hub[np.hypot(hub[:, 0], hub[:, 2]) < 0.05]
    assert hub[:, 1].max() > 0.07 and hub[:, 1].min() > 0.0
    assert wheel.brake().vertices[:, 1].max() < hub[:, 1].min(), "the disc is behind the hub"
    for at in WHEEL_NAMES:
        for time_s in (0.0, 0.9, 1.5):
            outward = in_car(bend, f"rim {at}", time_s)[:3, 1]
            assert outward[1] * float(at.split()[1]) > 0.8


def test_spokes_leave_gaps() -> None:
    """Seen from outside, some of the ring between hub and rim is open: rays along the axle pass there."""
    a, b, c = (corner[:, [0, 2]] for corner in corners(wheel.rim()))

    def covered(point: np.ndarray) -> bool:
        sides = []
        for start, end in ((a, b), (b, c), (c, a)):
            edge, to = end - start, point - start
            sides.append(edge[:, 0] * to[:, 1] - edge[:, 1] * to[:, 0])
        signs = np.sign(np.stack(sides))
        return bool((np.abs(signs.sum(axis=0)) == 3).any())

    turn = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    hits = [covered(0.15 * np.array([np.sin(angle), np.cos(angle)])) for angle in turn]
    changes = sum(one != other for one, other in zip(hits, hits[1:] + hits[:1], strict=True))
    assert changes == 2 * wheel.SPOKES and 0.2 < np.mean(hits) < 0.8
