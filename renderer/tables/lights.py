"""Lights of a scene as rows of the table that kernels read, and the distributions for sampling the environment."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import warp as wp
from jaxtyping import Float
from numpy.typing import NDArray

from renderer.layout.kinds import LightKind
from renderer.layout.structs import SceneData
from renderer.tables.checks import check_affine, check_finite, check_light
from renderer.tables.materials import MaterialTable
from scenes.arithmetic import cos, inverse, norm, product
from scenes.canonical import (
    DirectionalLight,
    EnvironmentLight,
    Instance,
    Light,
    PointLight,
    Rectangle,
    SceneError,
    Sphere,
    SpotLight,
)
from tsar.types import LUMINANCE


@dataclass
class LightTable:
    """Rows of lights, including the environment."""

    rows: list[dict] = field(default_factory=list)
    environment: EnvironmentLight | None = None

    def add(self, light: Light) -> None:
        """Adds a light of the scene.

        Raises:
            SceneError: for an unsupported light, or values that cannot be used.
        """
        if isinstance(light, PointLight):
            check_finite(light.position, "PointLight.position")
            check_light(light.intensity, "PointLight.intensity")
            self.rows.append({"kind": LightKind.POINT, "place": light.position, "color": light.intensity})
        elif isinstance(light, DirectionalLight):
            self.rows.append(_directional_row(light))
        elif isinstance(light, SpotLight):
            self.rows.append(_spot_row(light))
        elif isinstance(light, EnvironmentLight):
            if self.environment is not None:
                raise SceneError("expected at most one EnvironmentLight among the lights, got 2")
            check_environment(light)
            self.environment = light
            # a black one has no texel to sample
            if light.scale > 0.0 and np.max(light.image) > 0.0:
                self.rows.append({"kind": LightKind.ENVIRONMENT})
        else:
            raise SceneError(f"light {type(light).__name__} is not supported yet")

    def add_emitter(self, instance: Instance, track: int) -> None:
        """Adds a light-emitting shape; ``track`` is the number of its motion."""
        name, matrix = f"Instance {instance.name!r}", np.asarray(instance.to_world, np.float64)
        check_light(instance.emission, f"{name}: emission")
        check_affine(matrix, f"{name}: to_world")
        assert instance.emission is not None
        if not isinstance(instance.shape, Rectangle | Sphere):
            kind = type(instance.shape).__name__
            raise SceneError(f"{name}: emission: expected a Rectangle or Sphere, got {kind}")
        if max(instance.emission) == 0.0:
            return
        row = {"color": instance.emission, "place": matrix[:3, 3], "track": track}
        linear = matrix[:3, :3]
        if isinstance(instance.shape, Rectangle):
            # the cross product of the edges must point outside; mirroring reverses it
            along = linear[:, 1] * np.sign(np.linalg.det(linear))
            self.rows.append({**row, "kind": LightKind.QUAD, "across": linear[:, 0], "along": along})
            return
        stretch = np.linalg.svd(linear, compute_uv=False)
        if stretch[0] > stretch[2] * (1.0 + 1e-6):
            raise SceneError(f"{name}: emission: expected a uniformly scaled Sphere, got {stretch.tolist()}")
        self.rows.append({**row, "kind": LightKind.SPHERE, "radius": instance.shape.radius * norm(linear[:, 0])})

    def place_environment(self, data: SceneData, materials: MaterialTable, seen: EnvironmentLight | None) -> None:
        """Fills the kernels' data of the environment.

        Args:
            data: record that is changed.
            materials: table that stores the images.
            seen: background that rays leaving the scene see instead, if any.
        """
        data.environment_level = data.lighting_level = -1
        shown = seen or self.environment
        if shown is not None:
            check_environment(shown)
            data.environment_level, data.environment_to_map, data.environment_scale = _map(shown, materials)
        rows, columns = np.array([0.0, 1.0]), np.array([[0.0, 1.0]])
        if self.environment is not None:
            turn = np.asarray(self.environment.to_world, np.float64)[:3, :3]
            if not np.allclose(product(turn, turn.T), np.eye(3), atol=1e-5):
                raise SceneError("EnvironmentLight.to_world: expected a rotation, got a matrix that scales")
            data.lighting_level, data.lighting_to_map, data.lighting_scale = _map(self.environment, materials)
            if data.lighting_scale > 0.0 and self.environment.image.max() > 0.0:
                rows, columns = summed_chances(self.environment.image)
        device = materials.device
        data.lighting_rows = wp.array(rows.astype(np.float32), dtype=wp.float32, device=device)
        data.lighting_columns = wp.array(columns.astype(np.float32), dtype=wp.float32, device=device)


def check_environment(light: EnvironmentLight) -> None:
    """Raises SceneError unless the image of the environment can be used."""
    name, shape = f"EnvironmentLight {light.source!r}", light.image.shape
    if len(shape) != 3 or shape[2] != 3 or min(shape) < 1:
        raise SceneError(f"{name}: expected an image (h, w, 3), got {shape}")
    check_light(light.image, name)
    check_light(light.scale, f"{name}: scale")
    check_affine(light.to_world, f"{name}: to_world")


def _map(light: EnvironmentLight, materials: MaterialTable) -> tuple[int, wp.mat33, float]:
    turn = inverse(np.asarray(light.to_world, np.float64)[:3, :3])
    level = materials.add_image(light.image, mipmap=False)[0]
    return level, wp.mat33(*turn.astype(np.float32).reshape(-1).tolist()), float(light.scale)


def summed_chances(
    image: Float[NDArray[np.float32], "h w 3"],
) -> tuple[Float[NDArray[np.float64], " h1"], Float[NDArray[np.float64], "h w1"]]:
    """Cumulative probabilities of an environment's rows, and of the texels within each row, from 0 to 1.

    The probability of a texel is proportional to its luminance, integrated over the texel with interpolation, times its
    solid angle.

    Source: Pharr, Jakob and Humphreys 2016, "Physically Based Rendering", sec. 14.2.4.
    """
    bright = product(image.astype(np.float64), LUMINANCE)
    # integral of a linear interpolation over a cell: each neighbour contributes an eighth
    bright = 0.75 * bright + 0.125 * (np.roll(bright, 1, axis=1) + np.roll(bright, -1, axis=1))
    above, below = np.vstack([bright[:1], bright[:-1]]), np.vstack([bright[1:], bright[-1:]])
    bright = 0.75 * bright + 0.125 * (above + below)
    edges = cos(np.linspace(0.0, np.pi, len(image) + 1))
    weight = bright * (edges[:-1] - edges[1:])[:, None]
    per_row = weight.sum(axis=1)
    even = np.linspace(0.0, 1.0, image.shape[1] + 1)[None]
    columns = np.concatenate([np.zeros((len(image), 1)), np.cumsum(weight, axis=1)], axis=1)
    columns = np.where(per_row[:, None] > 0.0, columns / np.maximum(columns[:, -1:], 1e-300), even)
    rows = np.concatenate([[0.0], np.cumsum(per_row)])
    return rows / rows[-1], columns


def _directional_row(light: DirectionalLight) -> dict:
    length = norm(light.direction)
    if not 0.0 < length < np.inf:
        raise SceneError(f"DirectionalLight.direction: expected a direction, got {light.direction}")
    if not 0.0 <= light.angle_deg < 180.0:
        raise SceneError(f"DirectionalLight.angle_deg: expected an angle in [0, 180), got {light.angle_deg}")
    check_light(light.irradiance, "DirectionalLight.irradiance")
    row = {"kind": LightKind.DIRECTIONAL, "place": -np.asarray(light.direction) / length, "color": light.irradiance}
    if light.angle_deg == 0.0:
        return row
    cosine = cos(np.radians(light.angle_deg) / 2.0)
    # the mean cosine over the disc is (1 + cosine) / 2: a surface that faces its centre receives the whole irradiance
    color = np.asarray(light.irradiance) * 2.0 / (1.0 + cosine)
    return row | {"kind": LightKind.SUN_DISC, "cos_inner": cosine, "color": color}


def _spot_row(light: SpotLight) -> dict:
    check_finite((*light.position, *light.target), "SpotLight.position, target")
    check_light(light.intensity, "SpotLight.intensity")
    axis = np.subtract(light.target, light.position)
    length = norm(axis)
    if length == 0.0:
        raise SceneError(f"SpotLight.target: expected a point other than its position, got {light.target}")
    if not 0.0 <= light.inner_deg <= light.outer_deg < 180.0:
        raise SceneError(
            f"SpotLight: expected 0 <= inner_deg <= outer_deg < 180, got {light.inner_deg}, {light.outer_deg}"
        )
    if light.profile != "hermite":
        raise SceneError(f"SpotLight.profile: expected hermite (all that the renderer supports), got {light.profile}")
    cosines = cos(np.radians([light.inner_deg, light.outer_deg]))
    row = {"kind": LightKind.SPOT, "place": light.position, "color": light.intensity, "across": axis / length}
    return row | {"cos_inner": cosines[0], "cos_outer": cosines[1]}
