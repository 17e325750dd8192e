"""The canonical scene, and how it is rendered; conventions as in :mod:`scenes.canonical`.

Source: Hagemann 2018, sec. 4.2 and table 4.1 (constructs of a common scene).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from scenes.canonical.cameras import Camera
from scenes.canonical.lights import EnvironmentLight, Light
from scenes.canonical.materials import Material
from scenes.canonical.media import Medium
from scenes.canonical.shapes import Instance
from scenes.canonical.values import Rgb, SceneError


@dataclass(frozen=True)
class Film:
    """Output size in pixels and reconstruction filter."""

    width_px: int = 512
    height_px: int = 512
    filter: Literal["box", "tent", "gaussian", "mitchell", "sinc"] = "box"
    filter_radius_px: float = 0.5
    filename: str = ""


@dataclass(frozen=True)
class Sampler:
    """Sampling of pixels by the renderer for which the file was written."""

    kind: Literal["independent", "stratified", "sobol", "halton", "hammersley"] = "independent"
    samples_per_pixel: int = 1


@dataclass(frozen=True)
class Integrator:
    """The requested light transport.

    Attributes:
        depth: greatest number of bounces, -1 for no limit.
        shadow_rays: shadow rays towards each light that has an extent: ``one`` per shaded point, stratified over the
            samples of a group, or ``all``: one to a random point of each of its cells.
        light_cells: number of cells along each of the two axes of such a light, for ``all``.
        reflection_rays, refraction_rays: number of rays about the perfect direction at the first glossy surface that a
            camera ray hits; deeper surfaces send one ray.

    Source: Olszewski, "Distribution Ray Tracing" (sections on soft shadows and on diffuse reflection).
    """

    kind: Literal["whitted", "direct", "path", "bidirectional", "photonmap", "metropolis"] = "whitted"
    depth: int = 4
    shadow_rays: Literal["one", "all"] = "one"
    light_cells: int = 4
    reflection_rays: int = 1
    refraction_rays: int = 1

    def __post_init__(self) -> None:
        for name in ("light_cells", "reflection_rays", "refraction_rays"):
            if not 1 <= getattr(self, name) <= 256:
                raise SceneError(f"Integrator.{name}: expected 1 to 256, got {getattr(self, name)}")


@dataclass(frozen=True, eq=False)
class Scene:
    """A whole scene.

    Attributes:
        ambient: constant ambient radiance, which Phong materials weight by their ``ambient``.
        materials: named materials, kept for round trips; instances refer to their materials directly.
        duration_s: length of the animation, seconds; 0 for a still.
        background: radiance for camera and mirror rays that hit nothing; None for that of the environment light.
        medium: medium around the camera, None for vacuum. The renderer has no media.
    """

    camera: Camera
    instances: tuple[Instance, ...]
    lights: tuple[Light, ...] = ()
    film: Film = Film()
    sampler: Sampler = Sampler()
    integrator: Integrator = Integrator()
    ambient: Rgb = (0.0, 0.0, 0.0)
    materials: Mapping[str, Material] = field(default_factory=dict)
    name: str = ""
    duration_s: float = 0.0
    background: EnvironmentLight | None = None
    medium: Medium | None = None
