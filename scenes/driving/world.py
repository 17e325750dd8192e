"""The world of the driving scenes: a paved crossing among lawns, with kerbs, markings, houses, trees and lamp posts.

``+z`` is up, lengths are metres, the crossing is at the origin; one road runs along x, the other along y.

Source: Stephens 2011, sec. 7.1.1.1, which describes such a world; geometry and layout are our own.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import cos, sin
from scenes.canonical import (
    ConstantTexture,
    ImageTexture,
    Instance,
    Phong,
    Rectangle,
    Rgb,
)
from scenes.driving.meshing import SurfaceMesh, box, boxes, ellipsoid, extrude, grid, grids, join, moved, tube
from scenes.driving.sky import blurred
from scenes.loading import FileState, asset, read_image, state_of

ROAD_HALF_WIDTH_M = 6.0
ROAD_LENGTH_M = 240.0
PAVING_M = 1.1
"""Width of one repetition of the paving texture, metres."""

AMBIENT: Rgb = (0.46, 0.53, 0.66)
"""Ambient radiance: a constant that approximates the sky's light on surfaces."""


@lru_cache(maxsize=1)
def _grass() -> NDArray[np.float32]:
    """Blades and patches: tileable noise of three scales."""
    noise = np.random.default_rng(11).standard_normal((3, 256, 256))
    scales = [blurred(layer, width) for layer, width in zip(noise, (0.6, 4.0, 18.0), strict=True)]
    fine, middle, coarse = (layer / layer.std() for layer in scales)
    light = np.clip(1.0 + 0.28 * fine + 0.16 * middle + 0.14 * coarse, 0.3, 2.0)[..., None]
    dry = np.clip(0.5 + 0.2 * coarse + 0.1 * middle, 0.0, 1.0)[..., None]
    return (light * ((1.0 - dry) * [0.055, 0.105, 0.022] + dry * [0.115, 0.130, 0.040])).astype(np.float32)


@lru_cache(maxsize=1)
def _facade() -> NDArray[np.float32]:
    """One storey of a house, 4 m by 3 m: a brick wall with a window, sill and reveal."""
    bricks = np.random.default_rng(5)
    image = np.empty((384, 512, 3))
    row, column = np.arange(384)[:, None] // 12, np.arange(512)[None, :]
    brick = (column + (row % 2) * 16) // 32
    tone = bricks.uniform(0.75, 1.2, (32, 17))[row, brick % 17]
    image[:] = tone[..., None] * [0.33, 0.155, 0.10]
    mortar = (np.arange(384)[:, None] % 12 < 2) | ((column + (row % 2) * 16) % 32 < 2)
    image[mortar] = [0.36, 0.34, 0.31]
    image[96:300, 160:352] = [0.62, 0.60, 0.56]
    image[108:288, 172:340] = [0.055, 0.065, 0.08]
    image[108:288, 250:262] = image[190:200, 172:340] = [0.62, 0.60, 0.56]
    image[300:314, 148:364] = [0.48, 0.46, 0.43]
    return image.astype(np.float32)


Span = tuple[float, float]


def _sheets(spans: Sequence[tuple[Span, Span]], height: float) -> SurfaceMesh:
    """Horizontal rectangles that face up, each given by its spans along x and y; uv is ``(x, y)`` in metres."""
    (west, east), (south, north) = np.moveaxis(np.asarray(spans, np.float64), 0, -1)
    level = np.full_like(west, height)
    corners = [np.stack([x, y, level], -1) for x in (west, east) for y in (south, north)]
    sheets = grids(np.stack(corners, 1).reshape(-1, 2, 2, 3))
    return SurfaceMesh(sheets.vertices, sheets.faces, sheets.normals, sheets.vertices[:, :2])


def _paving() -> SurfaceMesh:
    half, far = ROAD_HALF_WIDTH_M, ROAD_LENGTH_M
    arms = [((-half, half), side) for side in ((-far, -half), (half, far))]
    return _sheets([((-far, far), (-half, half)), *arms], 0.0)


def _markings() -> SurfaceMesh:
    """Dashed centre lines and stop lines."""
    half = ROAD_HALF_WIDTH_M
    dashes = []
    for start in np.arange(half + 3.0, ROAD_LENGTH_M, 6.0):
        for low, high in ((start, start + 3.0), (-start - 3.0, -start)):
            dashes += [((low, high), (-0.08, 0.08)), ((-0.08, 0.08), (low, high))]
    stops = [((half + 0.8, half + 1.2), (0.3, half - 0.3)), ((-half - 1.2, -half - 0.8), (0.3 - half, -0.3))]
    for along, across in stops:
        dashes += [(along, across), ((-across[1], -across[0]), along)]
    return _sheets(dashes, 0.004)


def _kerbs() -> SurfaceMesh:
    """Kerb stones along both roads, in lengths of 2 m with joints."""
    half, stones = ROAD_HALF_WIDTH_M, []
    for start in np.arange(half, 90.0, 2.0):
        for low, high in ((start, start + 1.985), (-start - 1.985, -start)):
            for side in (-1.0, 1.0):
                near, far = sorted((side * half, side * (half + 0.22)))
                stones.append(((low, near, -0.1), (high, far, 0.12)))
                stones.append(((near, low, -0.1), (far, high, 0.12)))
    return boxes(stones)


_HOUSES = (
    # west, east, south, north, storeys
    (14.0, 26.0, 12.0, 22.0, 3), (30.0, 44.0, 13.0, 24.0, 2), (-26.0, -13.0, 13.0, 25.0, 2),
    (-46.0, -34.0, 15.0, 27.0, 3), (-30.0, -15.0, -26.0, -14.0, 3), (13.0, 24.0, -28.0, -15.0, 2),
    (32.0, 46.0, -27.0, -15.0, 3),
)  # fmt: skip


def _walls() -> SurfaceMesh:
    """Walls of the houses; uv in storeys of 4 m by 3 m."""
    blocks = []
    for west, east, south, north, storeys in _HOUSES:
        block = box((west, south, 0.0), (east, north, 3.0 * storeys))
        blocks.append(SurfaceMesh(block.vertices, block.faces, block.normals, block.uvs / np.array([4.0, 3.0])))
    return join(blocks)


def _roofs() -> SurfaceMesh:
    """Hipped roofs with eaves."""
    roofs = []
    for west, east, south, north, storeys in _HOUSES:
        low, high = 3.0 * storeys - 0.05, 3.0 * storeys + 2.6
        a, b, c, d = west - 0.5, east + 0.5, south - 0.5, north + 0.5
        inset = 0.45 * min(b - a, d - c)
        eaves = np.array([(a, c), (b, c), (b, d), (a, d)])
        ridge = np.array(
            [(a + inset, c + inset), (b - inset, c + inset), (b - inset, d - inset), (a + inset, d - inset)]
        )
        for side in range(4):
            after = (side + 1) % 4
            lower = [np.append(eaves[side], low), np.append(eaves[after], low)]
            upper = [np.append(ridge[side], high), np.append(ridge[after], high)]
            roofs.append(grid(np.array([[lower[0], upper[0]], [lower[1], upper[1]]])))
        roofs.append(_sheets([((ridge[0, 0], ridge[1, 0]), (ridge[0, 1], ridge[2, 1]))], high))
    return join(roofs)


_TREES = (
    # x, y, size
    (9.5, 10.0, 1.0), (9.0, 30.0, 1.15), (28.0, 9.5, 0.95), (48.0, 10.0, 1.1), (-9.5, 9.0, 1.05), (-31.0, 9.8, 1.2),
    (-9.5, -10.5, 0.9), (-36.0, -11.0, 1.15), (-52.0, 9.0, 1.0), (10.0, -10.0, 1.1), (28.5, -11.0, 1.0),
    (60.0, -9.5, 1.2), (66.0, 10.5, 1.0), (-66.0, -10.0, 1.1), (-9.0, 40.0, 1.0), (9.5, -40.0, 1.1),
    (-10.0, -34.0, 1.2), (80.0, 9.0, 1.1),
)  # fmt: skip


def _crowns() -> SurfaceMesh:
    """Crowns of the trees, each of several overlapping balls of leaves with an uneven surface."""
    shapes = np.random.default_rng(3)
    crowns = []
    for x, y, size in _TREES:
        for _ in range(6):
            turn, out = shapes.uniform(0.0, 2.0 * np.pi), shapes.uniform(0.2, 1.1) * size
            center = (x + out * cos(turn), y + out * sin(turn), size * shapes.uniform(3.2, 5.0))
            ball = ellipsoid(center, (size * shapes.uniform(0.9, 1.4, 3)).tolist(), 9, 14)
            bumps = 1.0 + 0.09 * sin(
                7.1 * ball.vertices[:, :1] + 5.3 * ball.vertices[:, 1:2] + 6.7 * ball.vertices[:, 2:]
            )
            vertices = np.asarray(center) + (ball.vertices - np.asarray(center)) * bumps
            crowns.append(SurfaceMesh(vertices, ball.faces, ball.normals, ball.uvs * np.array([6.0, 4.0])))
    return join(crowns)


def _trunks() -> SurfaceMesh:
    return join([tube((x, y, -0.1), (x, y, 3.6 * size), 0.20 * size, 0.12 * size, 8) for x, y, size in _TREES])


def _posts() -> SurfaceMesh:
    """Lamp posts along the road and bollards at the crossing."""
    half = ROAD_HALF_WIDTH_M
    parts = []
    for x in (-64.0, -40.0, -16.0, 16.0, 40.0, 64.0):
        side = half + 0.9 if (x // 8) % 2 else -half - 0.9
        reach = side - 1.8 * np.sign(side)
        parts += [
            tube((x, side, 0.0), (x, side, 6.2), 0.085, 0.055, 10),
            tube((x, side, 6.15), (x, reach, 6.35), 0.045, 0.04, 8),
            moved(ellipsoid((0.0, 0.0, 0.0), (0.16, 0.38, 0.09)), (x, reach, 6.30)),
        ]
    turn = np.linspace(0.0, 2.0 * np.pi, 13)[:-1]
    ring = 0.075 * np.stack([cos(turn), sin(turn)], -1)
    for x in (-12.0, -10.2, -8.4, 8.4, 10.2, 12.0):
        for y in (half + 0.7, -half - 0.7):
            parts.append(moved(extrude(ring, 0.0, 0.95), (x, y, 0.0)))
    return join(parts)


def instances() -> tuple[Instance, ...]:
    """All static parts, one mesh per material."""
    return _instances(state_of(asset("pavement_albedo_512.png")))


@lru_cache(maxsize=1)
def _instances(state: FileState | None) -> tuple[Instance, ...]:
    paving = ImageTexture(
        read_image(asset("pavement_albedo_512.png")), (1.0 / PAVING_M, 1.0 / PAVING_M), source="pavement_albedo_512.png"
    )
    lawn = ImageTexture(_grass(), (110.0, 110.0), source="grass")
    far = np.diag([400.0, 400.0, 1.0, 1.0])
    far[2, 3] = -0.03

    def plain(color: Rgb, gloss: float = 0.0) -> Phong:
        return Phong(ConstantTexture(color), (gloss, gloss, gloss), 20.0)

    return (
        Instance(Rectangle(), Phong(lawn), far, name="lawn"),
        Instance(_paving().mesh("paving"), Phong(paving, (0.03, 0.03, 0.03), 12.0), name="paving"),
        Instance(_markings().mesh("markings"), plain((0.62, 0.62, 0.60), 0.05), name="markings"),
        Instance(_kerbs().mesh("kerbs"), plain((0.40, 0.39, 0.37)), name="kerbs"),
        Instance(_walls().mesh("walls"), Phong(ImageTexture(_facade(), source="facade")), name="walls"),
        Instance(_roofs().mesh("roofs"), plain((0.20, 0.085, 0.06)), name="roofs"),
        Instance(_crowns().mesh("crowns"), Phong(ImageTexture(_grass(), (0.5, 0.5), source="leaves")), name="crowns"),
        Instance(_trunks().mesh("trunks"), plain((0.12, 0.085, 0.055)), name="trunks"),
        Instance(_posts().mesh("posts"), plain((0.09, 0.10, 0.11), 0.15), name="posts"),
    )
