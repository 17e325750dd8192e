"""Cameras of the canonical scene; conventions as in :mod:`scenes.canonical`."""

from __future__ import annotations

from dataclasses import dataclass, field

from scenes.canonical.values import Matrix, RigidTrack, SceneError, identity


@dataclass(frozen=True, eq=False)
class PerspectiveCamera:
    """Pinhole, or thin lens where ``lens_radius`` is positive.

    Attributes:
        to_world: ``(4, 4)`` camera-to-world; a negative determinant (a mirrored picture) is kept, not repaired.
        fov_deg: full angle of the *shorter* image axis, in (0, 180).
        track: rigid animation applied outside ``to_world``.
        lens_radius: radius of the aperture, scene units.
        focal_distance: distance from the lens to the focal plane along the viewing direction, positive.
        shutter_s: ``(open, close)`` times relative to the frame's time, seconds.
        shift: offset of the picture's centre from the viewing direction, to the right and up, in widths and heights of
            the picture. The renderer does not support it; it is kept for conversion.
    """

    to_world: Matrix = field(default_factory=identity)
    fov_deg: float = 45.0
    lens_radius: float = 0.0
    focal_distance: float = 1.0
    track: RigidTrack | None = None
    shutter_s: tuple[float, float] = (0.0, 0.0)
    shift: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not 0.0 < self.fov_deg < 180.0:
            raise SceneError(f"PerspectiveCamera.fov_deg: expected in (0, 180), got {self.fov_deg}")
        if self.lens_radius < 0.0:
            raise SceneError(f"PerspectiveCamera.lens_radius: expected non-negative, got {self.lens_radius}")
        if not 0.0 < self.focal_distance < float("inf"):
            raise SceneError(f"PerspectiveCamera.focal_distance: expected a positive number, got {self.focal_distance}")
        opening, closing = self.shutter_s
        if not -float("inf") < opening <= closing < float("inf"):
            raise SceneError(f"PerspectiveCamera.shutter_s: expected open <= close, got {self.shutter_s}")


@dataclass(frozen=True, eq=False)
class OrthographicCamera:
    """Parallel projection of ``[-1, 1]`` (scaled by ``half_width``) along the shorter axis."""

    to_world: Matrix = field(default_factory=identity)
    half_width: float = 1.0
    track: RigidTrack | None = None


@dataclass(frozen=True, eq=False)
class EnvironmentCamera:
    """Latitude–longitude view of the whole sphere."""

    to_world: Matrix = field(default_factory=identity)


@dataclass(frozen=True, eq=False)
class RealisticCamera:
    """A lens system read from a file. The renderer does not support it; it is kept for conversion."""

    to_world: Matrix = field(default_factory=identity)
    lens_file: str = ""
    aperture_diameter: float = 1.0
    focus_distance: float = 10.0


Camera = PerspectiveCamera | OrthographicCamera | EnvironmentCamera | RealisticCamera
