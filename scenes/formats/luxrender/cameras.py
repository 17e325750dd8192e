"""Cameras of LuxRender 1.x, where LuxCore draws them otherwise.

Source: ``PerspectiveCamera::CreateCamera`` of LuxRender 1.x; pictures of LuxCore 2.10.
"""

from __future__ import annotations

from scenes.canonical import Camera, Film, PerspectiveCamera
from scenes.formats.directives.window import ScreenWindow
from scenes.formats.losses import LossReport


def lose_longer_side(camera: Camera | None, window: ScreenWindow | None, film: Film, report: LossReport) -> None:
    """Reports an angle of view without a window: LuxRender has it along the shorter side of the picture, LuxCore along
    the longer one."""
    if not isinstance(camera, PerspectiveCamera) or window is None or window.sides is not None:
        return
    if film.width_px != film.height_px:
        what = "an angle of view without screenwindow, which LuxCore has along the longer side"
        report.add(window.where, what, "along the shorter side, as in LuxRender")
