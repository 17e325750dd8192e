"""The screen window of a camera in directive files, which is stretched over the picture.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3), section on cameras; ``camera.cpp`` of PBRT v3, whose
transform from the picture to the window scales each axis separately.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from scenes.arithmetic import arctan, product, tan
from scenes.canonical import Camera, Film, OrthographicCamera, PerspectiveCamera, SceneError
from scenes.canonical.values import Matrix
from scenes.formats.directives.syntax import Parameters
from scenes.formats.directives.textures import Pair
from scenes.formats.losses import LossReport

_ROUNDED = 3e-3  # relative tolerance of the aspect: 1.33 deviates from 4 / 3 by 0.0025


@dataclass(frozen=True)
class ScreenWindow:
    """A window in the plane at distance one.

    Attributes:
        where: place of the camera in its file, for messages.
        sides: width and height, positive; None for those of the picture, with a shorter side of 2.
        mirror: ``(4, 4)``, reflects axes that run from right to left or from top to bottom.
        middle: centre in units of the window, along its own directions.
    """

    where: str
    sides: Pair | None
    mirror: Matrix
    middle: Pair

    @property
    def half(self) -> float:
        """Half of the shorter side."""
        return 1.0 if self.sides is None else 0.5 * min(self.sides)

    @property
    def shift(self) -> Pair:
        """The centre in widths and heights of the picture."""
        sides = self.sides or (1.0, 1.0)
        return self.middle[0] / sides[0], self.middle[1] / sides[1]


def window_of(parameters: Parameters, where: str) -> ScreenWindow:
    """The window of a camera.

    Raises:
        SceneError: its width or height is zero.
    """
    window = parameters.numbers("screenwindow", 4)
    if window is None:
        return ScreenWindow(where, None, np.eye(4), (0.0, 0.0))
    left, right, bottom, top = window.tolist()
    sides, signs = (abs(right - left), abs(top - bottom)), np.sign([right - left, top - bottom])
    if not signs.all():
        raise SceneError(f"{where}: screenwindow: expected left and right, bottom and top apart")
    ends = zip((left + right, bottom + top), sides, signs.tolist(), strict=True)
    across, up = (0.5 * sign * end if abs(end) > 1e-6 * side else 0.0 for end, side, sign in ends)
    return ScreenWindow(where, sides, np.diag([*signs, 1.0, 1.0]), (across, up))


def fitted(camera: Camera, window: ScreenWindow, film: Film, report: LossReport) -> Camera:
    """The camera of a window whose aspect may differ from the picture's, over which PBRT stretches it.

    A parallel projection is stretched by the transform of its camera. A perspective one keeps the window's side along
    the shorter side of the picture and takes the other from the picture's aspect, which is reported.

    Args:
        camera: camera for a window with the aspect of the picture and the same shorter side.
        window: window of the camera.
        film: film of the picture.
        report: receives the losses.
    """
    if window.sides is None or not isinstance(camera, PerspectiveCamera | OrthographicCamera):
        return camera
    size_px, sides = (film.width_px, film.height_px), window.sides
    aspect, wanted = sides[0] / sides[1], size_px[0] / size_px[1]
    if abs(aspect / wanted - 1.0) <= _ROUNDED:
        return camera
    short = int(np.argmin(size_px if size_px[0] != size_px[1] else sides))
    half = 0.5 * sides[short]
    if isinstance(camera, OrthographicCamera):
        stretch = np.ones(4)
        stretch[1 - short] = sides[1 - short] / sides[short] / (max(size_px) / min(size_px))
        return dataclasses.replace(camera, to_world=product(camera.to_world, np.diag(stretch)), half_width=half)
    report.add(window.where, f"a window of aspect {aspect:.4g}, stretched over the picture", f"one of {wanted:.4g}")
    slope = tan(math.radians(camera.fov_deg) / 2.0) * (half / window.half)
    return dataclasses.replace(camera, fov_deg=math.degrees(2.0 * arctan(slope)))
