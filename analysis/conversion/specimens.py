"""Small scenes with every material and every light of the canonical scene, for the comparison of formats by pictures.

Materials lie under an even sky, so that a picture shows their albedo. A lamp stands above
a matte floor between black walls, and lights at infinity shine on five squares that face different ways.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenes.arithmetic import product
from scenes.canonical import (
    Bumped,
    CheckerboardTexture,
    ConstantTexture,
    Cube,
    DirectionalLight,
    Disk,
    Emissive,
    EnvironmentLight,
    Film,
    Glass,
    Glossy,
    HeightField,
    Instance,
    Integrator,
    Light,
    Masked,
    Material,
    Matte,
    Mesh,
    Metal,
    MetallicRough,
    Mirror,
    MixMaterial,
    NormalMapped,
    PerspectiveCamera,
    Phong,
    Plastic,
    PointLight,
    Rectangle,
    Scene,
    Shape,
    Sphere,
    SpotLight,
    SunSky,
    Translucent,
    Uber,
)
from scenes.canonical.values import Matrix

CELL_PX = 24
"""Side of a specimen's cell in the picture, pixels."""

AWAY = 60.0  # from farther away LuxCore's shadow rays hit the surface that they leave
PITCH = 4.0  # of the cells; their squares have half sides of one
COLUMNS = 6


def _even(*value: float) -> ConstantTexture:
    return ConstantTexture((value[0], value[len(value) // 2], value[-1]))


_RED, _DARK, _CLEAR = _even(0.6, 0.4, 0.2), _even(0.1, 0.2, 0.3), _even(0.0)
_ETA, _K = (0.18, 0.42, 1.37), (3.42, 2.35, 1.77)

MATERIALS: dict[str, tuple[Material, Shape]] = {
    "matte": (Matte(_RED), Rectangle()),
    "matte, rough": (Matte(_RED, 20.0), Rectangle()),
    "matte, checked": (Matte(CheckerboardTexture(_RED, _DARK, (8.0, 8.0))), Rectangle()),
    "matte, bumped": (Bumped(Matte(_RED), _even(0.1)), Rectangle()),
    "mirror": (Mirror(_RED), Rectangle()),
    "metal, smooth": (Metal(_ETA, _K), Rectangle()),
    "metal, GGX": (Metal(_ETA, _K, roughness=(0.2, 0.2)), Rectangle()),
    "metal, GGX, two alphas": (Metal(_ETA, _K, roughness=(0.1, 0.3)), Rectangle()),
    "metal, Beckmann": (Metal(_ETA, _K, roughness=(0.2, 0.2), distribution="beckmann"), Rectangle()),
    "glass": (Glass(), Sphere()),
    "glass, coloured": (Glass(_even(0.8), _RED), Sphere()),
    "glass, rough": (Glass(roughness=(0.2, 0.2)), Sphere()),
    "glass, thin": (Glass(thin=True), Rectangle()),
    "glossy": (Glossy(_RED, _even(0.04), (0.2, 0.2)), Rectangle()),
    "plastic of PBRT": (Plastic(_RED, _even(0.3), 1.5, 0.1, layered=False), Rectangle()),
    "plastic, smooth": (Plastic(_RED, _even(1.0), 1.5, 0.0), Rectangle()),
    "plastic, rough": (Plastic(_RED, _even(1.0), 1.5, 0.2), Rectangle()),
    "metallic-roughness": (MetallicRough(_RED, 0.5, 0.4), Rectangle()),
    "translucent": (Translucent(_DARK, _RED), Rectangle()),
    "uber": (Uber(_RED, _even(0.2), _even(0.1), _CLEAR, _even(1.0), 1.5, (0.1, 0.1)), Rectangle()),
    "uber, clear in part": (Uber(_RED, _CLEAR, _CLEAR, _even(0.2), _even(0.5)), Rectangle()),
    "mixture": (MixMaterial(Matte(_RED), Mirror(_even(0.9)), _even(0.25)), Rectangle()),
    "mask": (Masked(Matte(_RED), _even(0.5)), Rectangle()),
    "normal-mapped": (NormalMapped(Matte(_RED), _even(0.8, 0.5, 0.9)), Rectangle()),
    "height field": (HeightField(Matte(_RED), np.zeros((8, 8), np.float32), 0.1), Rectangle()),
    "Phong": (Phong(_RED, (0.2, 0.2, 0.2)), Rectangle()),
    "glowing": (Emissive((0.6, 0.4, 0.2)), Rectangle()),
}
"""Each material and the shape that shows it."""

_UP, _DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
_POWER = (3.0, 2.0, 1.0)


def _mesh() -> Mesh:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1.2, 1, 0]], np.float32)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def _spot(profile: str) -> SpotLight:
    return SpotLight((0.0, 0.0, 1.0), (0.2, 0.1, 0.0), _POWER, 25.0, 40.0, profile)  # type: ignore[arg-type]


def _lamp(shape: Shape, size: tuple[float, float, float]) -> Instance:
    place = np.diag([*size, 1.0])
    place[2, 3] = 1.0
    return Instance(shape, Matte(_CLEAR), place, emission=(30.0, 20.0, 10.0))


LAMPS: dict[str, Light | Instance] = {
    "point": PointLight((0.0, 0.0, 1.0), _POWER),
    **{f"spot, {profile}": _spot(profile) for profile in ("hermite", "quartic", "linear", "secant")},
    "lamp, sphere": _lamp(Sphere(0.1), (1.0, 1.0, 1.0)),
    "lamp, rectangle": _lamp(Rectangle(), (0.1, -0.1, -0.1)),
    "lamp, rectangle mirrored": _lamp(Rectangle(), (0.1, 0.1, -0.1)),
    "lamp, disk": _lamp(Disk(), (0.1, -0.1, -0.1)),
    "lamp, cube": _lamp(Cube(), (0.1, 0.1, 0.1)),
    "lamp, mesh": _lamp(_mesh(), (0.1, -0.1, -0.1)),
    "lamp, mesh mirrored": _lamp(_mesh(), (0.1, 0.1, -0.1)),
}
"""Lights with a place, each about the middle of its cell."""


def _sky_image() -> np.ndarray:
    rows, columns = np.mgrid[0:32, 0:64] + 0.5
    across, down = 2.0 * math.pi * columns / 64, math.pi * rows / 32
    parts = [1.0 + 0.8 * np.sin(across), 1.0 + 0.8 * np.cos(across) * np.sin(down), 1.0 + 0.8 * np.cos(down)]
    return np.stack(parts, axis=-1).astype(np.float32)


DIRECTION = (-0.36, -0.48, -0.8)
"""Direction of the directional lights."""

_SUN = (0.4, 0.3, 0.866)
DISTANT: dict[str, Light] = {
    "directional": DirectionalLight(DIRECTION, _POWER),
    "directional, 5 degrees": DirectionalLight(DIRECTION, _POWER, 5.0),
    "environment, even": EnvironmentLight(np.array([[[1.0, 0.7, 0.4]]], np.float32)),
    "environment map": EnvironmentLight(_sky_image(), np.eye(4)[[2, 0, 1, 3]], 0.5),
    "sun": SunSky(_SUN, part="sun"),
    "sky": SunSky(_SUN, part="sky"),
    "sun and sky": SunSky(_SUN),
}
"""Lights at infinity."""


@dataclass(frozen=True, eq=False)
class Specimens:
    """A scene with one specimen in each cell, or one in all cells.

    Attributes:
        scene: the scene, whose picture consists of cells of ``CELL_PX`` pixels.
        size_px: width and height of the picture, pixels.
        cells: names of the cells, from left to right and from top to bottom.
        single: for each specimen, the scene that has it alone, whose losses are its own.
        sky: whether the light is none of the specimens.
        reach: half side of the middle of a cell that counts, in half cells.
        hidden: half side of the part of it that does not count, in half cells.
        effort: factor of the number of samples, for noisy specimens.
    """

    scene: Scene
    size_px: tuple[int, int]
    cells: tuple[str, ...]
    single: dict[str, Scene]
    sky: bool = False
    reach: float = 0.3
    hidden: float = 0.0
    effort: int = 1


def place_of_cell(number: int, count: int) -> Matrix:
    """Where a cell is, the first at the top left."""
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    place = np.eye(4)
    place[0, 3] = PITCH * (number % columns - 0.5 * (columns - 1))
    place[1, 3] = -PITCH * (number // columns - 0.5 * (rows - 1))
    return place


def scene_of_cells(
    instances: list[Instance], lights: list[Light], count: int, depth: int
) -> tuple[Scene, tuple[int, int]]:
    """A scene that shows ``count`` cells from above, and the size of its picture, pixels."""
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    view = np.eye(4)
    view[2, 3] = AWAY
    camera = PerspectiveCamera(view, math.degrees(2.0 * math.atan(0.5 * PITCH * min(rows, columns) / AWAY)))
    film = Film(columns * CELL_PX, rows * CELL_PX)
    made = Scene(camera, tuple(instances), tuple(lights), film, integrator=Integrator("path", depth))
    return made, (film.width_px, film.height_px)


def even_sky() -> EnvironmentLight:
    """Light of radiance one all around."""
    return EnvironmentLight(np.ones((1, 1, 3), np.float32))


def materials() -> Specimens:
    """Every material under an even sky of radiance one."""
    count = len(MATERIALS)
    found = {
        name: Instance(shape, material, place_of_cell(number, count))
        for number, (name, (material, shape)) in enumerate(MATERIALS.items())
    }
    scene, size_px = scene_of_cells(list(found.values()), [even_sky()], count, 16)
    single = {name: scene_of_cells([one], [even_sky()], 1, 16)[0] for name, one in found.items()}
    return Specimens(scene, size_px, tuple(found), single, True)


def _cell() -> list[Instance]:
    """A floor and four black walls, higher than the lamp."""
    wall = np.array([[0.0, 0.0, 1.0, 1.6], [1.6, 0.0, 0.0, 0.0], [0.0, 1.6, 0.0, 1.2], [0.0, 0.0, 0.0, 1.0]])
    quarter = np.array([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    made = [Instance(Rectangle(), Matte(_even(0.5)), np.diag([1.6, 1.6, 1.0, 1.0]))]
    for _ in range(4):
        made.append(Instance(Rectangle(), Matte(_CLEAR), wall))
        wall = product(quarter, wall)
    return made


def lamp(name: str) -> Specimens:
    """A light with a place above a floor between black walls."""
    found = LAMPS[name]
    shapes, lights = ([found], []) if isinstance(found, Instance) else ([], [found])
    scene, size_px = scene_of_cells([*shapes, *_cell()], lights, 1, 1)
    return Specimens(scene, size_px, (name,), {name: scene}, reach=0.7, hidden=0.2)


def distant(name: str) -> Specimens:
    """A light at infinity on five squares."""
    squares = []
    for number, (x, y) in enumerate(((0.0, 0.0), (0.6, 0.0), (-0.6, 0.0), (0.0, 0.6), (0.0, -0.6))):
        normal = np.array([x, y, math.sqrt(1.0 - x * x - y * y)])
        place = place_of_cell(number, 5)
        across = np.array([normal[2], 0.0, -normal[0]]) / math.hypot(normal[0], normal[2])
        place[:3, :3] = np.stack([across, np.cross(normal, across), normal], axis=1)
        squares.append(Instance(Rectangle(), Matte(_even(0.5)), place))
    scene, size_px = scene_of_cells(squares, [DISTANT[name]], 5, 1)
    return Specimens(scene, size_px, (name,) * 5, {name: scene})
