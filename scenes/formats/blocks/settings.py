"""Settings with which the sequence of a block file is rendered.

Source: motion-blur perception thesis, chapter 3, figs 12 and 13.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import SceneError
from scenes.formats.blocks.text import Block

POINT_SET_NAMES = {
    "hammersley": "hammersley",
    "stratifiedmc": "stratified",
    "stratified": "stratified",
    "poisson": "poisson",
    "halton": "halton",
    "sobol": "sobol",
    "owen": "owen",
    "cells-even": "cells-even",
    "cells-space": "cells-space",
    "cells-time": "cells-time",
    "random": "random",
}
"""Point sets by their names in files."""

TIME_FILTERS = ("box", "triangle")


@dataclass(frozen=True)
class Settings:
    """Settings of a file's sequence.

    Attributes:
        name: name of the scene.
        start_time, frame_time: time of the first frame and interval between frames, time units of the file.
        frame_count: number of frames of the sequence.
        frame_rate_hz: frames per second of the scene's clock.
        shutter_share: share of the interval between frames for which the shutter is open.
        width_px, height_px: size of a frame.
        point_set, sample_count, time_filter: sampling of every pixel.
    """

    name: str
    start_time: float
    frame_time: float
    frame_count: int
    frame_rate_hz: float
    shutter_share: float
    width_px: int
    height_px: int
    point_set: str
    sample_count: int
    time_filter: str

    @property
    def seconds_per_unit(self) -> float:
        """Seconds of the scene's clock per time unit of the file."""
        return 1.0 / (self.frame_rate_hz * self.frame_time)

    def frame_start_s(self, number: int) -> float:
        """Time at which the shutter of a frame opens, on the scene's clock, seconds."""
        return number / self.frame_rate_hz

    def file_time(self, time_s: float | NDArray[np.floating]) -> NDArray[np.float64]:
        """The file's time at a time of the scene's clock."""
        return self.start_time + np.asarray(time_s, np.float64) / self.seconds_per_unit


def read_settings(block: Block, default_name: str) -> Settings:
    """Settings of a block, with defaults for missing attributes.

    Raises:
        SceneError: a value cannot be used.
    """

    def whole(name: str, default: int) -> int:
        value = block.get(name, default)
        if value != int(value) or value < 1:
            raise SceneError(f"{block.where}: settings.{name}: expected a whole number of at least 1, got {value:g}")
        return int(value)

    def positive(name: str, default: float) -> float:
        if not block.get(name, default) > 0.0:
            raise SceneError(f"{block.where}: settings.{name}: expected a positive number, got {block.get(name):g}")
        return float(block.get(name, default))

    point_set, time_filter = block.get("pointset", "hammersley"), block.get("timefilter", "box")
    if point_set not in POINT_SET_NAMES:
        wanted = ", ".join(POINT_SET_NAMES)
        raise SceneError(f"{block.where}: settings.pointset: expected one of {wanted}, got {point_set!r}")
    if time_filter not in TIME_FILTERS:
        wanted = ", ".join(TIME_FILTERS)
        raise SceneError(f"{block.where}: settings.timefilter: expected one of {wanted}, got {time_filter!r}")
    share = positive("shuttershare", 1.0)
    if share > 1.0:
        raise SceneError(f"{block.where}: settings.shuttershare: expected at most 1, got {share:g}")
    return Settings(
        name=block.get("scenename", default_name),
        start_time=float(block.get("starttime", 0.0)),
        frame_time=positive("frametime", 1.0),
        frame_count=whole("numframes", 1),
        frame_rate_hz=positive("framerate", 30.0),
        shutter_share=share,
        width_px=whole("sizex", 512),
        height_px=whole("sizey", 512),
        point_set=POINT_SET_NAMES[point_set],
        sample_count=whole("numsamples", 1),
        time_filter=time_filter,
    )
