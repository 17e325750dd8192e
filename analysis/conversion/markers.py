"""Places of known lamps in the pictures of scenes that are written by hand in each format and converted to every other.

Source: the projection of a pinhole camera; conventions of the formats as in :mod:`scenes.formats`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.conversion.peers import ENGINES, RenderedImage, rendered

EYE, TARGET, UP = np.array([3.0, 2.0, 4.0]), np.array([0.2, 0.1, -0.3]), np.array([0.0, 1.0, 0.0])
FOV_DEG = 40.0
"""Field of view of the shorter side, degrees."""

SIZES = {"landscape": (120, 80), "portrait": (80, 120)}

MARKERS = (
    ((0.2, 0.1, -0.3), (1.0, 0.0, 0.0)),
    ((1.2, 0.9, -0.6), (0.0, 1.0, 0.0)),
    ((-0.9, 0.7, 0.4), (0.0, 0.0, 1.0)),
    ((0.3, -0.9, 0.5), (1.0, 1.0, 0.0)),
    ((-0.4, -0.7, -1.2), (0.0, 1.0, 1.0)),
)
"""Centre and radiance of each lamp."""

SIDE = 0.16
SEARCH_PX = 12
SAMPLES = 64
SOURCES = ("pbrt", "pbrt, turned", "luxrender", "mitsuba")
"""Formats in which the scene is written by hand; PBRT's ``LookAt`` alone gives a mirrored picture."""

Vector = NDArray[np.float64]


def axes() -> tuple[Vector, Vector, Vector]:
    """Unit vectors to the right, upwards and ahead, as the camera sees them."""
    ahead = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(ahead, UP)
    right /= np.linalg.norm(right)
    return right, np.cross(right, ahead), ahead


def expected_px(center: tuple[float, ...], size: tuple[int, int], mirrored: bool) -> Vector:
    """Place of a point in the picture, pixels from the left and the top."""
    right, above, ahead = axes()
    away = np.array(center) - EYE
    half = 0.5 * min(size) / math.tan(math.radians(FOV_DEG) / 2.0)
    across, up = half * (away @ right) / (away @ ahead), half * (away @ above) / (away @ ahead)
    return np.array([size[0] / 2.0 + (-across if mirrored else across), size[1] / 2.0 - up])


def _corners(center: tuple[float, ...]) -> Vector:
    """Corners of the square about a point that faces the camera, counter-clockwise as seen from the camera."""
    right, above, _ = axes()
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return np.array([np.array(center) + 0.5 * SIDE * (x * right + y * above) for x, y in signs])


def _words(values: Any) -> str:
    return " ".join(f"{float(value):.9g}" for value in np.ravel(values))


def _directives(size: tuple[int, int], head: str, color: str, rest: str) -> str:
    lines = [f"{head}LookAt {_words(EYE)} {_words(TARGET)} {_words(UP)}"]
    window = ""
    if rest:  # LuxRender: the window of the whole film
        sides = np.array(size) / min(size)
        window = f' "float screenwindow" [{_words([-sides[0], sides[0], -sides[1], sides[1]])}]'
    lines.append(f'Camera "perspective" "float fov" [{FOV_DEG}]{window}')
    film = "fleximage" if rest else "image"
    lines.append(f'Film "{film}" "integer xresolution" [{size[0]}] "integer yresolution" [{size[1]}]')
    lines.append('SurfaceIntegrator "path" "integer maxdepth" [2]' if rest else 'Integrator "path"')
    lines.append("WorldBegin")
    for center, radiance in MARKERS:
        lines.append("AttributeBegin")
        lines.append(f'AreaLightSource "{"area" if rest else "diffuse"}" "{color} L" [{_words(radiance)}]{rest}')
        lines.append(f'Material "matte" "{color} Kd" [0 0 0]' + (' "string type" ["matte"]' if rest else ""))
        lines.append(
            f'Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [{_words(_corners(center))}]\nAttributeEnd'
        )
    return "\n".join([*lines, "WorldEnd", ""])


def _mitsuba(size: tuple[int, int]) -> str:
    right, above, ahead = axes()
    fov = math.degrees(2.0 * math.atan(math.tan(math.radians(FOV_DEG) / 2.0) * size[0] / min(size)))
    places = ", ".join
    ends = {name: places(f"{value:.9g}" for value in at) for name, at in (("o", EYE), ("t", TARGET), ("u", UP))}
    lines = [
        '<scene version="0.5.0">',
        '<integrator type="path"/>',
        f'<sensor type="perspective"><float name="fov" value="{fov:.9g}"/>',
        f'<transform name="toWorld"><lookAt origin="{ends["o"]}" target="{ends["t"]}" up="{ends["u"]}"/></transform>',
        f'<film type="hdrfilm"><integer name="width" value="{size[0]}"/><integer name="height" value="{size[1]}"/>',
        '</film><sampler type="independent"/></sensor>',
    ]
    for center, radiance in MARKERS:
        matrix = np.eye(4)
        matrix[:3] = np.stack([0.5 * SIDE * right, 0.5 * SIDE * above, -ahead, np.array(center)], axis=1)
        lines.append(
            f'<shape type="rectangle"><transform name="toWorld"><matrix value="{_words(matrix)}"/></transform>'
            '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>'
            f'<emitter type="area"><rgb name="radiance" value="{_words(radiance)}"/></emitter></shape>'
        )
    return "\n".join([*lines, "</scene>", ""])


def native(source: str, size: tuple[int, int]) -> tuple[str, str]:
    """The scene in a format, written without the exporters, and the ending of its file name."""
    if source == "mitsuba":
        return _mitsuba(size), ".xml"
    if source == "luxrender":
        return _directives(size, "", "color", ' "float power" [0] "float efficacy" [0]'), ".lxs"
    return _directives(size, "Scale -1 1 1\n" if source == "pbrt, turned" else "", "rgb", ""), ".pbrt"


def farthest_px(picture: RenderedImage, size: tuple[int, int], mirrored: bool) -> float:
    """Greatest distance of a marker from its expected place, pixels; infinite if no marker of its colour is near."""
    worst = 0.0
    rows, columns = np.mgrid[: size[1], : size[0]] + 0.5
    for center, radiance in MARKERS:
        wanted = expected_px(center, size, mirrored)
        near = (np.abs(columns - wanted[0]) < SEARCH_PX) & (np.abs(rows - wanted[1]) < SEARCH_PX)
        of_color = picture @ np.array(radiance) - picture @ (1.0 - np.array(radiance))
        weight = np.where(near, np.maximum(of_color, 0.0), 0.0)
        if weight.sum() < 2.0:
            return math.inf
        found = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
        worst = max(worst, float(np.abs(found - wanted).max()))
    return worst


def here(file: Path, size: tuple[int, int]) -> RenderedImage:
    """The picture of a scene file by this project's renderer."""
    from renderer.trace import Renderer
    from scenes.catalog import load_any

    scene, _ = load_any(str(file))
    return Renderer(scene).render_frame(0.0, *size, 8).numpy()


def _pictures(scene: Any, folder: Path, size: tuple[int, int], limit_s: float) -> Iterator[tuple[str, str, Any]]:
    """Target, renderer and picture of a scene in every format."""
    from scenes.formats.conversion import save_scene_file

    targets = {"pbrt": "a.pbrt", "luxrender": "a.lxs", "mitsuba": "a.xml", "mitsuba3": "a-3.xml"}
    for target, name in targets.items():
        save_scene_file(scene, folder / name, target)  # type: ignore[arg-type]
        if target != "mitsuba3":
            yield target, "this project's", here(folder / name, size)
        program = {"luxrender": "luxcore", "mitsuba": "mitsuba", "mitsuba3": "mitsuba"}.get(target)
        if program:
            out = folder / f"{target}.npy"
            yield target, program, rendered(program, folder / name, out, size, SAMPLES, limit_s)


def marker_offsets(
    folder: Path, limit_s: float, sources: tuple[str, ...] = SOURCES, sizes: tuple[str, ...] = tuple(SIZES)
) -> list[dict[str, Any]]:
    """A row for each pair of formats, shape of the film and renderer: greatest offset of a marker, pixels.

    Args:
        folder: folder for the scenes.
        limit_s: most seconds for each picture.
        sources: source formats.
        sizes: shapes of the film.
    """
    from scenes.formats.conversion import load_scene_file

    rows = []
    for source in sources:
        for shape in sizes:
            size, work = SIZES[shape], folder / f"{source.replace(', ', '-')}-{shape}"
            text, ending = native(source, size)
            work.mkdir(parents=True, exist_ok=True)
            file = work / f"native{ending}"
            file.write_bytes(text.encode())
            kept = {"from": source, "film": shape}
            program = ENGINES.get(source)
            if program:
                found = rendered(program, file, work / "native.npy", size, SAMPLES, limit_s)
                rows.append({**kept, "to": "as it is", "renderer": program, **_offset(found, size, source == "pbrt")})
            for target, renderer, found in _pictures(load_scene_file(file), work, size, limit_s):
                rows.append({**kept, "to": target, "renderer": renderer, **_offset(found, size, source == "pbrt")})
    return rows


def _offset(picture: RenderedImage | str, size: tuple[int, int], mirrored: bool) -> dict[str, Any]:
    if isinstance(picture, str):
        return {"offset_px": math.inf, "note": picture}
    return {"offset_px": farthest_px(picture, size, mirrored), "note": ""}
