"""Figures 3, 6, 8, 10, 15, 17 and 18 of the motion-blur thesis: what sampling in time and space looks like.

Figures 4, 5, 7 and 9 are those of ``scripts/pointsets.py``, and 19 to 25 those of ``scripts/perception.py analyse``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.command.progress import Task
from analysis.perception.options import FiguresOptions
from renderer.sampling.plan import SamplePlan, box_warp

if TYPE_CHECKING:
    from torch import Tensor

    from renderer.trace import Renderer

RATE_HZ = 30.0
"""Frames a second of both scenes."""

SHUTTER_SHARE = 0.5
"""Share of the shutter time that the truncated box spans."""

_SPHERES_FRAME, _PLANE_FRAME = 33, 80
_SHOWN = {"planescene": (30, 80, 130, 180), "spheresscene": (20, 33, 60, 120)}
_FEW = 8  # samples a pixel of figure 15
_BALL, _TAIL = (0.43, 0.40, 0.28), (0.66, 0.50, 0.28)  # left, top and side of a detail, shares of the frame

Detail = tuple[float, float, float]
Pictures = Mapping[str, Mapping[str, NDArray[np.uint8]]]


class _Shots:
    """Renders single frames of one scene."""

    def __init__(self, scene: str, options: FiguresOptions, task: Task) -> None:
        from renderer.trace import Renderer
        from scenes import catalog

        self.renderer: Renderer = Renderer(catalog.load(scene), threads=options.threads or None, seed=options.seed)
        self.options, self.task = options, task

    def plan(self, **changes: Any) -> SamplePlan:
        """Samples as in the study; ``changes`` replace fields of the plan."""
        usual = {"space_filter": "gaussian", "box_share": SHUTTER_SHARE, "samples_per_pixel": self.options.samples}
        return SamplePlan(seed=self.options.seed, **(usual | changes))  # type: ignore[arg-type]

    def frame(
        self, number: int, plan: SamplePlan, detail: Detail | None = None, shutter_s: tuple[float, float] | None = None
    ) -> Tensor:
        """A frame, or a detail of it; by default over the time for which the shutter of the scene is open."""
        from renderer.frames import render_image

        side, opened = self.options.width_px, self.renderer.shutter_s if shutter_s is None else shutter_s
        left, top, across = (round(side * share) for share in detail or (0.0, 0.0, 1.0))
        crop = left, top, across, across
        found = render_image(self.renderer, plan, side, side, number / RATE_HZ, opened, number, crop=crop)
        self.task.advance()
        return found

    def at_times(self, number: int, count: int, detail: Detail) -> Tensor:
        """A detail of a frame whose samples are at a few even times, the same for all pixels."""
        import torch

        opening, closing = self.renderer.shutter_s
        share = box_warp((np.arange(count) + 0.5) / count, SHUTTER_SHARE)
        plan = self.plan(samples_per_pixel=max(1, self.options.samples // count))
        times_s = (opening + (closing - opening) * share).tolist()
        return torch.stack([self.frame(number, plan, detail, (time_s, time_s)) for time_s in times_s]).mean(dim=0)


def pictures(options: FiguresOptions, task: Task) -> Pictures:
    """The encoded pictures of each figure, by their titles."""
    from renderer.film.files import encode_srgb

    spheres, plane = (_Shots(name, options, task) for name in ("spheresscene", "planescene"))
    ball, land = _SPHERES_FRAME, _PLANE_FRAME
    found = {
        "strobing": {
            "4 even times": spheres.at_times(ball, 4, _BALL),
            "8 even times": spheres.at_times(ball, 8, _BALL),
            "times of each pixel's own": spheres.frame(ball, spheres.plan(), _BALL),
        },
        "pixel_filters": {
            "the pixel's square": plane.frame(land, plane.plan(space_filter="box"), _TAIL),
            "Gaussian": plane.frame(land, plane.plan(), _TAIL),
        },
        "time_filters_shown": {
            "truncated box": spheres.frame(ball, spheres.plan(), _BALL),
            "triangle": spheres.frame(ball, spheres.plan(time_filter="triangle"), _BALL),
        },
        "shifts": {
            "one pattern": spheres.frame(ball, spheres.plan(samples_per_pixel=_FEW, shift="none"), _BALL),
            "shifted by pixel": spheres.frame(ball, spheres.plan(samples_per_pixel=_FEW), _BALL),
        },
        **{
            name: {f"frame {number}": shots.frame(number, shots.plan()) for number in _SHOWN[name]}
            for name, shots in (("planescene", plane), ("spheresscene", spheres))
        },
    }
    for shots in (spheres, plane):
        shots.renderer.close()
    return {name: {title: encode_srgb(one) for title, one in row.items()} for name, row in found.items()}


FRAMES = 4 + 8 + 1 + 2 + 2 + 2 + 8
"""Number of frames of :func:`pictures`."""


def densities() -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Times in shares of the shutter's, and the densities of both time filters there (figure 8)."""
    t = np.linspace(0.0, 1.0, 401)
    inside = np.abs(t - 0.5) <= 0.5 * SHUTTER_SHARE
    return {
        "truncated box": (t, np.where(inside, 1.0 / SHUTTER_SHARE, 0.0)),
        "triangle": (t, 4.0 * np.minimum(t, 1.0 - t)),
    }
