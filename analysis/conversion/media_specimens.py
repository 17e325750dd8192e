"""Small scenes with homogeneous media, for the comparison of formats by pictures.

Absorbing media lie under an even sky, so that a picture shows what they let through. Scattering ones lie in a
directional light, so that it shows what they scatter to one side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.conversion.specimens import AWAY, DIRECTION, Specimens, even_sky, place_of_cell, scene_of_cells
from scenes.arithmetic import product
from scenes.canonical import (
    ConstantTexture,
    Cube,
    DirectionalLight,
    Emissive,
    EnvironmentLight,
    Glass,
    Instance,
    Light,
    Matte,
    Medium,
    Mesh,
    Rectangle,
    Shape,
    Sphere,
)
from scenes.formats.appearance.mixtures import NOTHING

_THIN, _TURBID = Medium((0.15, 0.1, 0.05)), Medium((0.1, 0.05, 0.02), (0.3, 0.2, 0.1))
_FLAT = np.diag([1.8, 1.8, 1.0, 1.0])


def _block(medium: Medium, mirrored: bool = False, shape: Shape | None = None) -> Instance:
    """A medium in a block with an invisible border."""
    place = _FLAT * (np.diag([1.0, 1.0, -1.0, 1.0]) if mirrored else 1.0)
    return Instance(shape or Cube(), NOTHING, place, interior=medium)


def _pyramid() -> Mesh:
    corners = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [0, 0, 2]], np.float32)
    faces = [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    return Mesh(corners, np.array(faces, np.int32))


MEDIA: dict[str, Instance] = {
    "medium, absorbing": _block(_THIN),
    "medium, in a mirrored block": _block(_THIN, True),
    "medium, in a mesh": _block(_THIN, shape=_pyramid()),
    "medium, in a mirrored mesh": _block(_THIN, True, _pyramid()),
    "medium, in a sphere": Instance(Sphere(1.7), NOTHING, interior=_THIN),
    "medium, in glass": Instance(Cube(), Glass(), _FLAT, interior=_THIN),
    "medium, absorbing and scattering": _block(_TURBID),
}
"""Media under an even sky."""

SCATTERING: dict[str, Instance] = {
    f"medium, scattering{name}": _block(Medium((0.05, 0.05, 0.05), (0.3, 0.2, 0.1), g))
    for name, g in (("", 0.0), (" forwards", 0.5), (" backwards", -0.5))
}
"""Media in the sun."""

FOG = "medium, around the camera"


def _placed(found: dict[str, Instance]) -> dict[str, Instance]:
    places = (place_of_cell(number, len(found)) for number in range(len(found)))
    return {
        name: replace(one, to_world=product(place, one.to_world))
        for (name, one), place in zip(found.items(), places, strict=True)
    }


def media(found: dict[str, Instance], light: Light) -> Specimens:
    """Shapes with media under a light."""
    placed = _placed(found)
    behind = np.eye(4)
    behind[2, 3] = 1.2 * AWAY
    # behind the camera, because files of glTF without surfaces are refused
    more = Instance(Rectangle(), Matte(ConstantTexture((0.5, 0.5, 0.5))), behind)
    scene, size_px = scene_of_cells([*placed.values(), more], [light], len(placed), 16)
    single = {name: scene_of_cells([one, more], [light], 1, 16)[0] for name, one in placed.items()}
    sky = isinstance(light, EnvironmentLight)
    return Specimens(scene, size_px, tuple(placed), single, sky, reach=0.55, effort=4)


def media_under_sky() -> Specimens:
    """Media under an even sky of radiance one."""
    return media(MEDIA, even_sky())


def media_in_sun() -> Specimens:
    """Media in a directional light, on black ground."""
    return media(SCATTERING, DirectionalLight(DIRECTION, (3.0, 3.0, 3.0)))


def fog() -> Specimens:
    """A glowing square in the medium around the camera."""
    square = Instance(Rectangle(), Emissive((2.0, 2.0, 2.0)), _FLAT)
    scene, size_px = scene_of_cells([square], [], 1, 16)
    scene = replace(scene, medium=Medium((0.02, 0.01, 0.005)))
    return Specimens(scene, size_px, (FOG,), {FOG: scene}, reach=0.55, effort=4)
