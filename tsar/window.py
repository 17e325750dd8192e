"""A picture of any shape as a window of the square plane on which policies work. Imports nothing large."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jaxtyping import Float, Shaped
    from torch import Tensor

    from tsar.types import Viewpoint

GRID = 65536
"""Positions on the plane are multiples of its reciprocal."""


@dataclass(frozen=True)
class Window:
    """The upper left part of a square plane. Its pixels are those of the picture.

    Attributes:
        width_px, height_px: size of the picture.
        side_px: side of the plane, a power of two that neither exceeds.
    """

    width_px: int
    height_px: int
    side_px: int

    @property
    def whole(self) -> bool:
        """Whether the picture is the whole plane."""
        return self.width_px == self.height_px == self.side_px

    @property
    def reach(self) -> float:
        """Side of a square with the picture's area, as a share of the plane's side."""
        return (self.width_px * self.height_px) ** 0.5 / self.side_px

    def on_plane(self, view: Viewpoint) -> Viewpoint:
        """Poses of a camera that shows the whole plane. Its axis need not meet the plane's centre.

        With ``w/S`` the picture's share of the plane's width, ``tan_x`` becomes ``tan_x S/w``. The camera is sheared,
        ``q_x + c u`` in place of ``q_x`` with ``c = tan_x (1 - S/w)``, so that ``x`` on the picture becomes ``x w/S``
        on the plane; ``u`` is ``-q_z``, or 1 where rays are parallel. The same holds for ``y``, with
        ``q_y + tan_y (S/h - 1) u``.

        Args:
            view: poses for the picture. A panorama is returned unchanged.
        """
        if self.whole or view.kind == "panorama":
            return view
        wide, high = self.side_px / self.width_px, self.side_px / self.height_px
        matrix, offset = view.to_camera.clone(), view.to_camera_offset.clone()
        for axis, shear in enumerate((view.tan_x * (1.0 - wide), view.tan_y * (high - 1.0))):
            if view.kind == "parallel":
                offset[axis] += shear
            else:
                matrix[axis] -= shear * matrix[2]
                offset[axis] -= shear * offset[2]
        return replace(
            view, to_camera=matrix, to_camera_offset=offset, tan_x=view.tan_x * wide, tan_y=view.tan_y * high
        )

    def cropped(self, image: Float[Tensor, "h w *c"]) -> Float[Tensor, "h2 w2 *c"]:
        """The picture's part of an image of the plane; an image of the picture is returned unchanged."""
        if tuple(image.shape[:2]) != (self.side_px, self.side_px):
            return image
        return image[: self.height_px, : self.width_px].contiguous()

    def parts(self, field: Shaped[Tensor, "rows columns"]) -> Shaped[Tensor, "rows2 columns2"]:
        """The picture's part of a field of equal squares of the plane: its squares, or its pixels where the picture's
        border cuts squares. A field of the picture, or of one value, is returned unchanged."""
        rows = field.shape[0]
        if rows == 1 or tuple(field.shape) == (self.height_px, self.width_px):
            return field
        width = self.side_px // rows
        if self.width_px % width or self.height_px % width:
            field, width = field.repeat_interleave(width, 0).repeat_interleave(width, 1), 1
        return field[: self.height_px // width, : self.width_px // width].contiguous()

    def of_picture(self, position: Float[Tensor, "*n 2"]) -> Float[Tensor, "*n 2"]:
        """Positions on the plane, as shares of its sides, converted to positions on the picture, as shares of the
        picture's sides."""
        return position * position.new_tensor((self.side_px / self.width_px, self.side_px / self.height_px))

    def of_plane(self, position: Float[Tensor, "*n 2"]) -> Float[Tensor, "*n 2"]:
        """The inverse of :meth:`of_picture`, float32, for positions on the plane that are multiples of 1/65536."""
        share = position.new_tensor((self.width_px / self.side_px, self.height_px / self.side_px)) * GRID
        return (position * share).round() / GRID

    def inside(self, plane: Float[Tensor, "c h w"]) -> Float[Tensor, "c h w"]:
        """The values of a plane within the picture, and 0 beyond it."""
        inside = plane.new_zeros(plane.shape)
        inside[:, : self.height_px, : self.width_px] = plane[:, : self.height_px, : self.width_px]
        return inside

    def enlarged(self, image: Float[Tensor, "h w c"]) -> Float[Tensor, "side side c"]:
        """An image of the picture as one of the plane, black beyond the picture."""
        plane = image.new_zeros(self.side_px, self.side_px, image.shape[2])
        plane[: self.height_px, : self.width_px] = image
        return plane
