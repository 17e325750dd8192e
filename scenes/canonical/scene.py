"""The canonical scene, and how it is rendered; conventions as in :mod:`scenes.canonical`.

Source: Hagemann 2018, sec. 4.2 and table 4.1 (which constructs a common scene must hold).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from scenes.canonical.cameras import Camera
from scenes.canonical.lights import EnvironmentLight, Light
from scenes.canonical.materials import Material
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
    """How pixels are sampled by the renderer the file was written for."""

    kind: Literal["independent", "stratified", "sobol", "halton", "hammersley"] = "independent"
    samples_per_pixel: int = 1


@dataclass(frozen=True)
class Integrator:
    """Light transport asked for.

    Attributes:
        depth: greatest number of bounces, -1 for no limit.
        shadow_rays: towards each light that has an extent, ``one`` per shaded point, samples sharing the light out
            among them, or ``all``: one to a random point of each of its cells.
        light_cells: cells along each of the two axes of such a light, for ``all``.
        reflection_rays, refraction_rays: spread about the perfect direction at the first glossy surface a camera ray
            meets; deeper ones send one.

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
        ambient: constant ambient radiance that Phong materials weigh by their ``ambient``.
        materials: named materials, kept for round trips; instances hold theirs directly.
        duration_s: length of the animation; 0 for a still.
        background: what primary and mirror rays that hit nothing see; None means the environment light.
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
