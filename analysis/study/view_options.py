"""Options of the commands that show a scene: its view, its lighting and its integrator."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from analysis.command import limits
from analysis.command.cli import bad_input, require_files
from analysis.command.start import first_imports
from tsar.config import closed_choices, require

if TYPE_CHECKING:
    from scenes.catalog import Look


def require_scene(scene: str) -> None:
    """Checks that a scene is known, before libraries load.

    Args:
        scene: name or number of a scene, or a file.

    Raises:
        InputError: it is not.
    """
    with first_imports(), bad_input():
        from scenes import catalog

        catalog.require_known(scene)


@dataclass(frozen=True, kw_only=True)
@closed_choices()
class ViewOptions:
    """Changes of a scene's view and lighting, and its integrator."""

    camera: tuple[float, float, float, float, float, float] | str | None = None
    """A static camera in place of the scene's: its position and its target, in the scene's coordinates; or the name of
    a camera of a glTF or USD file, in place of its first one."""
    camera_keys: Path | None = None
    """A moving camera in place of the scene's: a CSV file with the columns time_s, eye_x, eye_y, eye_z, target_x,
    target_y and target_z."""
    fov_deg: float | None = None
    """Field of view along the shorter side, degrees; by default that of the scene."""
    lens_radius: float | None = None
    """Radius of the aperture, scene units, for depth of field; by default that of the scene."""
    focal_distance: float | None = None
    """Distance to the plane in focus, scene units; by default that of the camera's target, or that of the scene."""
    environment: Path | None = None
    """Environment map (.hdr, .exr, …) that lights the scene, in place of sky, sun and ambient light."""
    up: Literal["y", "z"] | None = None
    """Upward axis of the world, for the camera and the environment; by default that of a USD file, y for OBJ and
    glTF, z for PLY and STL, and that of the camera for a scene."""
    integrator: Literal["whitted", "path"] = "whitted"
    """Transport of light: direct light, mirrors and glass; or paths between all surfaces, which needs many samples and
    supports more materials of files."""
    bounces: int | None = None
    """Greatest number of bounces, -1 for no limit; by default that of the scene."""
    smooth_deg: float = 0.0
    """Greatest angle at which an edge of a mesh without normals is smooth, degrees; 0 keeps faces flat."""

    def __post_init__(self) -> None:
        limits.within(
            self,
            **({} if isinstance(self.camera, str) else {"camera": (-1e12, 1e12)}),
            fov_deg=(1e-3, 179.0),
            lens_radius=(0.0, 1e12),
            focal_distance=(1e-12, 1e12),
            bounces=(-1, 64),
            smooth_deg=(0.0, 180.0),
        )
        one = self.camera is None or self.camera_keys is None
        require(one, "camera_keys", "none beside a camera", str(self.camera_keys))

    def require_found(self, scene: str) -> None:
        """Checks, before libraries load, that a scene is known and that all files are there.

        Args:
            scene: name or number of a scene, or a file.

        Raises:
            InputError: one of them is not.
        """
        require_files(*(file for file in (self.environment, self.camera_keys) if file is not None))
        require_scene(scene)

    @property
    def look(self) -> Look:
        """Camera, lighting and integrator of the scene."""
        from scenes.catalog import Look

        return Look(
            self.up, self.smooth_deg, self.camera, self.fov_deg, self.environment, self.integrator, self.bounces,
            self.lens_radius, self.focal_distance, self.camera_keys,
        )  # fmt: skip
