"""Options of the commands that render stills of a scene: their size, and the part that is rendered."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analysis.command import limits
from analysis.study.view_options import ViewOptions
from tsar.config import closed_choices, require

if TYPE_CHECKING:
    from scenes.catalog import Look


@dataclass(frozen=True, kw_only=True)
@closed_choices()
class FilmOptions(ViewOptions):
    """Size and part of a picture, besides its view and lighting."""

    size: str = ""
    """Width and height, pixels, such as 800x600; by default those of the scene's film."""
    width_px: int = 0
    """Width, pixels; in place of size; the field of view spans the shorter side."""
    height_px: int = 0
    """Height, pixels; in place of size."""
    crop: tuple[int, int, int, int] | None = None
    """Part of the picture to render: left column, upper row, width and height, pixels."""
    time_s: float = 0.0
    """Animation time of the first frame, seconds."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(not self.size or len(self.sides_px) == 2, "size", "such as 800x600", self.size)
        sides = (0, limits.SIDES_PX[1])
        least, most = limits.SIDES_PX
        fits = all(least <= side <= most for side in self.sides_px)
        require(fits, "size", f"sides between {least} and {most}", self.size)
        limits.within(self, width_px=sides, height_px=sides, time_s=limits.TIMES_S)
        two = self.size and (self.width_px or self.height_px)
        require(not two, "size", "none together with width_px and height_px", self.size)

    @property
    def look(self) -> Look:
        """As of every view, and parts that do not move rigidly as at the time of the first frame."""
        return dataclasses.replace(super().look, pose_s=self.time_s)

    @property
    def sides_px(self) -> tuple[int, ...]:
        """Width and height of ``size``; empty if it is not valid."""
        parts = self.size.lower().split("x")
        return tuple(int(part) for part in parts) if all(part.isdecimal() for part in parts) else ()

    def size_px(self, film_px: tuple[int, int]) -> tuple[int, int]:
        """Width and height of the picture, given those of the scene's film.

        Raises:
            ConfigError: the crop does not lie within the picture.
        """
        width, height = self.sides_px or (self.width_px or film_px[0], self.height_px or film_px[1])
        if self.crop is not None:
            left, top, across, down = self.crop
            inside = min(left, top) >= 0 and min(across, down) >= 1 and left + across <= width and top + down <= height
            require(inside, "crop", f"a part of {width} x {height} pixels", self.crop)
        return width, height
