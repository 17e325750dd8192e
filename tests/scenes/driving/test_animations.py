"""The five inputs show what they are named after."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest

from analysis.storage.reference import content_hash
from scenes import catalog, loading
from scenes.canonical import PerspectiveCamera, Scene, SceneError
from scenes.driving import body, car, sky, wheel, world
from scenes.driving.animations import DURATION_S, LEAD_S
from tests.scenes.builders import Array, moving, placed, pose, project
from tsar.config import ConfigError

NAMES = ("corner-exit", "chase", "fly-by", "approach", "fast-crossing")
SPAN = np.linspace(0.0, 2.0, 21).tolist()


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    return {name: catalog.load(name) for name in NAMES}


def camera(scene: Scene) -> PerspectiveCamera:
    assert isinstance(scene.camera, PerspectiveCamera)
    return scene.camera


def bounding_box() -> Array:
    """Corners ``(8, 3)`` of the body's box, in the car's frame."""
    vertices = np.concatenate([mesh.vertices for mesh in car.body_parts().values()])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0.0, high[2])])


def shown(scene: Scene, time_s: float) -> tuple[Array, Array]:
    """Least and greatest image coordinates of the car's bounding box, all of it ahead of the camera."""
    box = placed(pose(moving(scene, "paint").track, time_s), bounding_box())
    found, ahead = project(camera(scene), time_s, box)
    assert ahead.min() > 0.1
    return found.min(axis=0), found.max(axis=0)


def in_view(scene: Scene, time_s: float) -> bool:
    low, high = shown(scene, time_s)
    return bool((high > 0.0).all() and (low < 1.0).all())


def test_inputs_are_in_order_and_go_by_number(scenes: dict[str, Scene]) -> None:
    assert catalog.NAMES == NAMES
    for number, name in enumerate(NAMES):
        assert catalog.load(str(number)).name == scenes[name].name == name
        assert scenes[name].duration_s == DURATION_S >= 2.0


def test_cuts_show_another_view_every_quarter_of_a_second() -> None:
    """The car is in view in each; beside the cuts the camera moves as smoothly as in the inputs."""
    scene = catalog.load("cuts")
    track = camera(scene).track
    assert track is not None and "cuts" not in catalog.NAMES
    steps = np.abs(np.diff(track.translation, axis=0)).max(axis=1)
    after_s = track.start_s + track.interval_s * (1 + np.arange(len(steps)))
    within = (after_s > -0.01) & (after_s < 2.01)
    assert after_s[within & (steps > 1.0)] == pytest.approx(0.25 * np.arange(9), abs=1e-9)
    assert steps[steps <= 1.0].max() == pytest.approx(13.0 / 240.0, rel=1e-3)
    assert (np.linalg.norm(track.rotation, axis=1) == pytest.approx(1.0)) and scene.name == "cuts"
    for time_s in np.arange(0.05, 2.0, 0.25):
        low, high = shown(scene, float(time_s))
        assert (high > 0.1).all() and (low < 0.9).all(), time_s


def test_nothing_moves_in_still() -> None:
    scene = catalog.load("still")
    moved = [np.ptp(np.concatenate([one.track.translation, one.track.rotation], axis=1), axis=0)
             for one in scene.instances if one.track is not None]  # fmt: skip
    assert moved and not np.any(moved) and camera(scene).track is None
    low, high = shown(scene, 0.0)
    assert (high > 0.1).all() and (low < 0.9).all() and "still" not in catalog.NAMES


@pytest.mark.parametrize("name", ["", "nonsense", "5", "-1", "Chase", "1.0", "²", "../chase"])
def test_unknown_names_are_refused(name: str) -> None:
    with pytest.raises(ConfigError, match=r"^scene: expected one of corner-exit, chase, .*, got ") as caught:
        catalog.load(name)
    assert repr(name) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("phase", [1.0, -0.01, 7.0, float("nan"), float("inf")])
def test_bad_phases_are_refused(phase: float) -> None:
    with pytest.raises(SceneError, match=rf"^phase: expected .*\[0, 1\), got {phase}$"):
        catalog.load("chase", phase)


@pytest.mark.parametrize("name", NAMES)
def test_everything_that_moves_is_animated_before_and_during_the_input(scenes: dict[str, Scene], name: str) -> None:
    scene = scenes[name]
    tracks = [scene.camera.track, *(instance.track for instance in scene.instances)]
    moved = [track for track in tracks if track is not None]
    assert len(moved) >= 20
    for track in moved:
        assert track.start_s <= -LEAD_S
        assert track.start_s + track.interval_s * (len(track.translation) - 1) >= DURATION_S - 1e-9


def test_chase_follows_at_a_constant_distance(scenes: dict[str, Scene]) -> None:
    scene = scenes["chase"]
    apart, moved, boxes = [], [], []
    for time_s in SPAN:
        eye, place = pose(scene.camera.track, time_s)[:3, 3], pose(moving(scene, "paint").track, time_s)[:3, 3]
        apart.append(eye - place)
        moved.append(eye)
        boxes.append(np.concatenate(shown(scene, time_s)))
        assert 0.0 < min(boxes[-1]) and max(boxes[-1]) < 1.0, "the whole car is in the picture"
    assert np.ptp(np.linalg.norm(apart, axis=1)) < 1e-6 and np.ptp(boxes, axis=0).max() < 1e-6
    assert np.linalg.norm(moved[-1] - moved[0]) > 20.0


def test_fly_by_stands_still_and_turns_to_the_car(scenes: dict[str, Scene]) -> None:
    scene = scenes["fly-by"]
    first, last = pose(scene.camera.track, 0.0), pose(scene.camera.track, 2.0)
    columns = []
    for time_s in np.linspace(-1.0, 3.0, 81).tolist():
        now = pose(scene.camera.track, time_s)
        assert now[:3, 3] == pytest.approx(first[:3, 3], abs=1e-12)
        place = pose(moving(scene, "paint").track, time_s)[:3, 3]
        found, ahead = project(camera(scene), time_s, place[None])
        assert ahead[0] > 0.0
        columns.append(found[0, 0])
    assert np.abs(np.array(columns) - 0.5).max() < 1e-4
    assert np.degrees(np.arccos(-first[:3, 2] @ -last[:3, 2])) > 60.0, "it turns far round"


def test_corner_exit_shows_the_car_in_the_upper_left_and_then_not_at_all(scenes: dict[str, Scene]) -> None:
    scene = scenes["corner-exit"]
    assert scene.camera.track is None
    visible = [time_s for time_s in SPAN if in_view(scene, time_s)]
    assert visible == [time_s for time_s in SPAN if time_s <= visible[-1]] and 1.0 <= visible[-1] < 1.7
    for time_s in visible:
        low, high = shown(scene, time_s)
        assert high[0] < 0.52 and high[1] < 0.5 and low[1] > 0.0
    assert not any(in_view(scene, time_s) for time_s in np.linspace(1.7, 3.0, 27).tolist())
    low, high = shown(scene, 0.5)
    assert low[0] > 0.0 and high[0] - low[0] > 0.1, "whole and not a dot"
    ahead = [pose(moving(scene, "paint").track, time_s)[:3, 0] for time_s in (0.0, 2.0)]
    assert ahead[0] @ ahead[1] == pytest.approx(0.0, abs=1e-3), "it turns the corner"


def test_corner_exit_has_paving_in_the_foreground(scenes: dict[str, Scene]) -> None:
    """What the bottom row of the picture sees of the ground lies on the road."""
    view = camera(scenes["corner-exit"])
    for across in (0.05, 0.5, 0.95):
        scale = np.tan(0.5 * np.radians(view.fov_deg))
        ray = view.to_world[:3, :3] @ [scale * (2.0 * across - 1.0), -scale * 0.98, -1.0]
        assert ray[2] < 0.0
        x, y, _ = view.to_world[:3, 3] - ray * view.to_world[2, 3] / ray[2]
        assert min(abs(x), abs(y)) < world.ROAD_HALF_WIDTH_M


def test_approach_fills_more_and_more_of_the_picture(scenes: dict[str, Scene]) -> None:
    scene = scenes["approach"]
    assert scene.camera.track is None
    sizes = [float(np.prod(np.subtract(*shown(scene, time_s)[::-1]))) for time_s in SPAN]
    assert (np.diff(sizes) > 0.0).all() and sizes[-1] > 5.0 * sizes[0] > 0.0
    assert all(in_view(scene, time_s) for time_s in SPAN)


def test_fast_crossing_enters_and_leaves(scenes: dict[str, Scene]) -> None:
    scene = scenes["fast-crossing"]
    assert scene.camera.track is None
    seen = [in_view(scene, time_s) for time_s in np.linspace(0.0, 2.0, 81).tolist()]
    changes = [one != other for one, other in pairwise(seen)]
    assert not seen[0] and not seen[-1] and sum(changes) == 2
    assert 0.1 < 2.0 * np.mean(seen) < 1.0, "seconds in view"


@pytest.mark.parametrize("name", NAMES)
def test_the_car_keeps_to_the_road(scenes: dict[str, Scene], name: str) -> None:
    for time_s in np.linspace(-LEAD_S, DURATION_S, 60).tolist():
        x, y, z = pose(moving(scenes[name], "paint").track, time_s)[:3, 3]
        assert min(abs(x), abs(y)) < world.ROAD_HALF_WIDTH_M - 1.0 and z == pytest.approx(0.0, abs=1e-12)
        assert max(abs(x), abs(y)) < world.ROAD_LENGTH_M


def still(scene: Scene) -> Scene:
    """The scene without its motion."""
    instances = tuple(dataclasses.replace(instance, track=None) for instance in scene.instances)
    return dataclasses.replace(scene, instances=instances, camera=dataclasses.replace(scene.camera, track=None))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("phase", [0.25, 0.9])
def test_phase_moves_the_car_ahead_and_nothing_else(scenes: dict[str, Scene], name: str, phase: float) -> None:
    """By a fraction of a wheel's turn: every motion is the same, that much earlier."""
    before, after = scenes[name], catalog.load(name, phase)
    ahead = phase * 2.0 * np.pi * wheel.RADIUS_M
    places = [pose(moving(scene, "paint").track, 0.0)[:3, 3] for scene in (before, after)]
    assert np.linalg.norm(places[1] - places[0]) == pytest.approx(ahead, rel=1e-3)
    speed = np.linalg.norm(pose(moving(before, "paint").track, -0.1)[:3, 3] - places[0]) / 0.1
    for time_s in (-0.2, 0.0, 0.77, 1.5):
        for part in ("paint", "tyre +1 +1", "brake -1 -1"):
            earlier = pose(moving(before, part).track, time_s + ahead / speed)
            assert pose(moving(after, part).track, time_s) == pytest.approx(earlier, abs=5e-3)
        view = pose(before.camera.track, time_s + ahead / speed)
        assert pose(after.camera.track, time_s) == pytest.approx(view, abs=5e-3)
    turned = (
        pose(moving(before, "rim -1 +1").track, 0.0)[:3, :3].T @ pose(moving(after, "rim -1 +1").track, 0.0)[:3, :3]
    )
    assert turned[0, 0] == pytest.approx(np.cos(2.0 * np.pi * phase), abs=1e-3)
    assert turned[0, 2] == pytest.approx(np.sin(2.0 * np.pi * phase), abs=1e-3)
    assert content_hash(still(before)) == content_hash(still(after)) and content_hash(before) != content_hash(after)
    if before.camera.track is None:
        assert content_hash(before.camera) == content_hash(after.camera)


def forget() -> None:
    """Drops what was built before, so that the next load builds it again."""
    for kept in (
        car.body_parts, wheel.tyre, wheel.rim, wheel.brake, sky._sky, world._instances, world._grass,
        world._facade, loading._image,
    ):  # fmt: skip
        kept.cache_clear()


@pytest.mark.parametrize("name", ["fly-by"])
def test_loading_twice_gives_equal_content(scenes: dict[str, Scene], name: str) -> None:
    first = content_hash(scenes[name])
    forget()
    again = catalog.load(name)
    assert again.instances[1].shape is not scenes[name].instances[1].shape, "it was built anew"
    assert content_hash(again) == first
    assert len({content_hash(scene) for scene in scenes.values()}) == len(NAMES)


def test_axles_and_hubs_match_the_arches() -> None:
    """Nothing of the paint is within the arch over a wheel."""
    paint = car.body_parts()["paint"].vertices
    for axle, _ in car.WHEELS:
        beside = paint[np.abs(paint[:, 1]) > 0.6]
        away = np.hypot(beside[:, 0] - axle, beside[:, 2] - body.AXLE_HEIGHT_M)
        assert away.min() > wheel.RADIUS_M + 0.03
