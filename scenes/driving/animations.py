"""The five animations of the driving world: one vehicle, seen in five ways.

Each is a path of the car and a motion of the camera over :data:`DURATION_S` seconds from time zero.

Source: Stephens 2011, sec. 7.1.1.1 and figs 7.1–7.2 (inputs 0 to 4); paths, speeds and fields of view are our own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from scenes.animation import (
    LEAD_S,
    UP,
    Path,
    Pose,
    PoseFunction,
    Times,
    camera_to_world,
    continuous_quaternions,
    look_at,
    sample_track,
)
from scenes.canonical import Integrator, PerspectiveCamera, RigidTrack, Scene
from scenes.driving import car, sky, world
from scenes.driving.wheel import RADIUS_M

DURATION_S = 6.0

_CAMERA_INTERVAL_S = 1.0 / 240.0
_LANE_M = -2.6  # the right-hand lane of the road along x

CameraPath = Callable[[Path], PerspectiveCamera]


@dataclass(frozen=True)
class Animation:
    """One input: motion of the car and of the camera."""

    path: Path
    view: CameraPath


def _fixed(eye: tuple[float, float, float], target: tuple[float, float, float], fov_deg: float) -> CameraPath:
    pose = camera_to_world(np.array(eye), np.array(target))
    return lambda path: PerspectiveCamera(pose, fov_deg)


def _track(pose: PoseFunction) -> RigidTrack:
    return sample_track(pose, -LEAD_S, DURATION_S, _CAMERA_INTERVAL_S)


def _chase(behind: float, aside: float, height: float, aim: float, fov_deg: float) -> CameraPath:
    """A camera at a fixed place in the car's frame that looks at a point ``aim`` metres above the car's origin."""

    def view(path: Path) -> PerspectiveCamera:
        def pose(time_s: Times) -> Pose:
            place, heading = path.pose(time_s)
            eye = place + heading.apply([-behind, aside, height])
            return eye, look_at(eye, place + aim * UP)

        return PerspectiveCamera(fov_deg=fov_deg, track=_track(pose))

    return view


def _pivot(eye: tuple[float, float, float], aim: float, fov_deg: float) -> CameraPath:
    """A camera at a fixed place that turns to follow the car."""

    def view(path: Path) -> PerspectiveCamera:
        def pose(time_s: Times) -> Pose:
            place, _ = path.pose(time_s)
            stand = np.broadcast_to(np.array(eye), place.shape)
            return stand, look_at(stand, place + aim * UP)

        return PerspectiveCamera(fov_deg=fov_deg, track=_track(pose))

    return view


def _cuts(every_s: float, *views: CameraPath) -> CameraPath:
    """A camera that jumps from one moving view to the next, with the field of view of the first. A jump takes one
    interval between keys, 1/240 s."""

    def view(path: Path) -> PerspectiveCamera:
        cameras = [one(path) for one in views]
        tracks = [camera.track for camera in cameras if camera.track is not None]
        time_s = tracks[0].start_s + tracks[0].interval_s * np.arange(len(tracks[0].translation))
        number = (np.floor(time_s / every_s + 1e-9) % len(tracks)).astype(np.int64), np.arange(len(time_s))
        translation = np.stack([track.translation for track in tracks])[number]
        rotation = continuous_quaternions(np.stack([track.rotation for track in tracks])[number])
        return replace(cameras[0], track=replace(tracks[0], translation=translation, rotation=rotation))

    return view


ANIMATIONS: dict[str, Animation] = {
    # enters at the upper left, turns right at the crossing and leaves; paving in the foreground
    "corner-exit": Animation(
        Path((-2.6, 15.0), -0.5 * np.pi, 9.5, bends=((6.5, 9.0, -0.5 * np.pi),)),
        _fixed((5.0, -8.0, 4.6), (2.7, 0.55, -0.1), 50.0),
    ),
    "chase": Animation(Path((-50.0, _LANE_M), 0.0, 15.0), _chase(5.4, 2.9, 1.75, 0.75, 50.0)),
    "fly-by": Animation(Path((-13.0, _LANE_M), 0.0, 13.0), _pivot((0.0, 3.4, 1.35), 0.65, 46.0)),
    "approach": Animation(Path((-28.0, _LANE_M), 0.0, 11.0), _fixed((3.4, 0.4, 1.35), (-10.0, -1.9, 0.75), 42.0)),
    "fast-crossing": Animation(Path((-15.0, _LANE_M), 0.0, 22.0), _fixed((0.6, 7.0, 1.5), (0.0, -2.6, 0.95), 50.0)),
}
"""Animations by name, in the order of the thesis' inputs 0 to 4."""

CUTS, STILL = "cuts", "still"
_CUT_S = 0.25
_FURTHER = {
    # nothing on the picture stays at a cut; between cuts it moves as in chase and fly-by
    CUTS: Animation(
        Path((-13.0, _LANE_M), 0.0, 13.0),
        _cuts(
            _CUT_S,
            _chase(5.4, 2.9, 1.75, 0.75, 50.0),
            _pivot((0.0, 3.4, 1.35), 0.65, 50.0),
            _chase(-6.0, -2.4, 1.2, 0.6, 50.0),
        ),
    ),
    # nothing moves: approach, halfway
    STILL: Animation(
        Path((-28.0, _LANE_M), 0.0, 0.0, advance=16.0), _fixed((3.4, 0.4, 1.35), (-10.0, -1.9, 0.75), 42.0)
    ),
}
"""Animations that are no input of the thesis."""


def load(name: str, phase: float = 0.0) -> Scene:
    """The scene of an animation.

    Args:
        name: a key of :data:`ANIMATIONS`, :data:`CUTS`, or :data:`STILL`.
        phase: fraction of a wheel's turn by which the car is ahead at time zero: a repetition that differs only in the
            positions of edges on pixels and tiles.
    """
    animation = {**ANIMATIONS, **_FURTHER}[name]
    old = animation.path
    advance = old.advance + phase * 2.0 * np.pi * RADIUS_M
    path = Path(old.start, old.heading_rad, old.speed, old.bends, advance)
    return Scene(
        camera=animation.view(path),
        instances=(*world.instances(), *car.instances(path, -LEAD_S, DURATION_S)),
        lights=(sky.sun(),),
        integrator=Integrator("whitted", depth=2),
        ambient=world.AMBIENT,
        name=name,
        duration_s=DURATION_S,
        background=sky.sky(),
    )
