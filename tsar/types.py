"""Frozen records that pass between the stages of the pipeline.

Shapes use the symbols of ``NOTATION.md``: ``n`` framelets or tiles, ``s`` samples along a framelet's side, ``e`` field
elements (``sdf * sdf``), ``c`` cached framelets. Fields over elements and samples within framelets are in Morton order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import torch
from jaxtyping import Float, Float32, Float64, Int32, Int64
from torch import Tensor

from tsar.checks import closed_choices

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear red, green and blue in the luminance of Rec. 709."""


@dataclass(frozen=True)
class Tiling:
    """A non-overlapping cut through the quadtree that covers the image once, in Morton order.

    Attributes:
        level: quad level of each tile; a tile at level ``L`` is ``1 / 2^L`` of the image wide.
        index: Morton index of each tile within its level, in ``[0, 4^L)``.
    """

    level: Int64[Tensor, " n"]
    index: Int64[Tensor, " n"]

    @property
    def tile_count(self) -> int:
        return int(self.level.shape[0])


@dataclass(frozen=True)
class FrameletBatch:
    """A request to the renderer: tiles of ``s * s`` samples.

    Attributes:
        level, index: the tile of each framelet, as in :class:`Tiling`.
        position: sample positions on the image plane, ``(x, y)`` in ``[0, 1)`` from the top left corner, Morton order
            within a framelet. Multiples of ``1 / 65536`` where the image is a square, so exact in float32.
        time_s: animation time of each sample, seconds, float64 (float32 is 4 ms off at 1e5 s); one number where they
            have the same.
        cycle: pipeline cycle that requests it.
        seed: seed of the run. A renderer derives its own random numbers from positions and times.
        hits: whether first hits are requested.
        footprint: factor of the width over which textures are filtered, for each sample; below 1 is sharper. Finite and
            above 0; None for 1 everywhere.
    """

    level: Int64[Tensor, " n"]
    index: Int64[Tensor, " n"]
    position: Float[Tensor, "n samples 2"]
    time_s: Float64[Tensor, "n samples"] | float
    cycle: int = 0
    seed: int = 0
    hits: bool = False
    footprint: Float[Tensor, "n samples"] | None = None

    @property
    def times(self) -> Float64[Tensor, "n samples"]:
        """Animation time of each sample, seconds; stored as one number if it is the same for all."""
        if isinstance(self.time_s, Tensor):
            return self.time_s
        return torch.full((1, 1), self.time_s, dtype=torch.float64).expand(self.position.shape[:2])


@dataclass(frozen=True)
class Hits:
    """First hits of the camera rays of a batch.

    Attributes:
        instance: number of the instance in the renderer, where meshes that move together are one instance; -1 at
            infinity.
        point: hit point in the space of the instance's track, in scene units: the space on which the rigid motion acts,
            or the world for a static instance. At infinity, the unit direction of the ray in the world.
            :func:`tsar.projection.project` projects both back onto the image.
        occluder: instance that hides the first light from the point; -1 where that light is visible; -2 where no shadow
            ray is traced, because the light lies behind the surface, the surface reflects none of it, or nothing was
            hit. Of several instances it is a static one, if there is any. Lamps that are instances precede other
            lights; for a lamp with an extent it is the first hit of the first shadow ray.
    """

    instance: Int32[Tensor, "n samples"]
    point: Float32[Tensor, "n samples 3"]
    occluder: Int32[Tensor, "n samples"]


@dataclass(frozen=True)
@closed_choices()
class Viewpoint:
    """Poses of the camera and all instances at one time, in the world of the renderer.

    Attributes:
        time_s: animation time, seconds.
        track_of_instance: number of the rigid motion of each instance; 0 is static.
        rotation, translation: pose of each rigid motion, from its space to the world.
        to_camera, to_camera_offset: matrix and offset from the world to the camera, which looks along -z with x to the
            right and y up. It includes the scale of the camera's placement, if there is one.
        kind: kind of the projection. A lens is treated as a pinhole at its centre.
        tan_x, tan_y: tangents of the half angles of the image; half of its size where rays are parallel.
    """

    time_s: float
    track_of_instance: Int64[Tensor, " instances"]
    rotation: Float64[Tensor, "tracks 3 3"]
    translation: Float64[Tensor, "tracks 3"]
    to_camera: Float64[Tensor, "3 3"]
    to_camera_offset: Float64[Tensor, " 3"]
    kind: Literal["perspective", "parallel", "panorama"]
    tan_x: float
    tan_y: float

    @cached_property
    def rows(self) -> Float64[Tensor, "rows 12"]:
        """Matrix, row by row, and offset from each instance's track to the camera; the last row is for directions in
        the world (hits at infinity)."""
        # by rows and columns: the bits of a matrix product may depend on the library
        camera, columns = self.to_camera, range(3)
        rotation = sum(camera[:, k, None] * self.rotation[:, k, None, :] for k in columns)
        offset = sum(camera[:, k] * self.translation[:, k, None] for k in columns) + self.to_camera_offset
        tracks = torch.cat([rotation.flatten(1), offset], dim=1)  # type: ignore[union-attr]
        away = torch.cat([camera.flatten(), torch.zeros(3, dtype=torch.float64)])
        return torch.cat([tracks[self.track_of_instance], away[None]])


@dataclass(frozen=True)
class SampleBatch:
    """The renderer's answer to a batch.

    Attributes:
        color: linear RGB radiance, float32, Morton order within a framelet. May hold non-finite values: the next stage
            counts and replaces them.
        counters: work done, by name (``primary_rays``, ``shadow_rays``, ``reflection_rays``, …).
        hits: first hits, where they were requested.
    """

    color: Float[Tensor, "n samples 3"]
    counters: dict[str, int] = field(default_factory=dict)
    hits: Hits | None = None


Trace = Callable[[FrameletBatch], SampleBatch]
"""The renderer as the pipeline calls it."""


@dataclass(frozen=True)
class Densities:
    """Sample densities over the field elements, Morton order, float64.

    Attributes:
        spatial: θ_s, samples per element.
        temporal: θ_t, refreshes per pipeline cycle, in (0, 1].
        surplus: C, combined density that is not allocated, carried over between cycles.
    """

    spatial: Float64[Tensor, " e"]
    temporal: Float64[Tensor, " e"]
    surplus: float = 0.0

    def combined(self) -> Float64[Tensor, " e"]:
        """θ = θ_s θ_t, samples per element per cycle (Stephens 2011, eq. 6.5)."""
        return self.spatial * self.temporal


@dataclass(frozen=True)
class Errors:
    """Signed sample-rate errors over the elements in [-1, 1], float32; positive is undersampled, zero is outside the
    batch."""

    spatial: Float[Tensor, " e"]
    temporal: Float[Tensor, " e"]


@dataclass(frozen=True)
class SampleMap:
    """Time and density of the samples shown in each part of an image, raster order; the parts are equal squares, or the
    image.

    Attributes:
        newest_s: animation time of the newest sample, seconds; ``-inf`` where nothing has been sampled yet.
        level: quad level of its framelet, which determines the sampling density there.
        inverse: reciprocal of the effective number of samples in a pixel; None where pixels show the newest samples
            alone.
    """

    newest_s: Float64[Tensor, "rows columns"]
    level: Int64[Tensor, "rows columns"]
    inverse: Float[Tensor, "h w"] | None = None


@dataclass(frozen=True)
class MapShown:
    """A map of a policy's state over its image, for reports: positive values that are drawn on a logarithmic scale.

    Attributes:
        values: raster order; the parts are equal squares.
        bounds: least and greatest value of the colour scale.
        unit: unit of the values, in words.
    """

    values: Float[Tensor, "rows columns"]
    bounds: tuple[float, float]
    unit: str


@dataclass(frozen=True)
class Spent:
    """The cost of one cycle.

    Attributes:
        cycle: its number, negative during warm-up.
        cost_s: duration on the chosen clock.
        stage_s: measured wall seconds per stage.
        counters: rays and other counts.
    """

    cycle: int
    cost_s: float
    stage_s: Mapping[str, float]
    counters: Mapping[str, int]


@dataclass(frozen=True)
class ShownImage:
    """An image for the display.

    Attributes:
        display_time_s: time at which it appears, seconds.
        sample_time_s: animation time of its newest samples, seconds.
        image: ``(height, width, 3)`` float32 linear RGB.
        sample_map: time and density of its samples.
        maps: further maps of the policy's state, by name.
        spent: cost of the cycle that made it; None where it was not counted.
        carried: applies the same blends of pixels to another picture of the same time, linear RGB; None where pixels
            are shown without blending.
    """

    display_time_s: float
    sample_time_s: float
    image: Float[Tensor, "h w 3"]
    sample_map: SampleMap | None = None
    maps: Mapping[str, MapShown] = field(default_factory=dict)
    spent: Spent | None = None
    carried: Callable[[Float[Tensor, "h w 3"]], Float[Tensor, "h w 3"]] | None = None


@dataclass(frozen=True)
class StepRecord:
    """The record of one cycle, for storage.

    Attributes:
        cycle: its number, negative during warm-up.
        sim_time_s: animation time of the samples, seconds.
        cost_s: duration of the cycle on the chosen clock, seconds.
        tiling: tiling from which tiles were selected.
        selected: indices of the selected tiles into ``tiling``.
        densities: after the response.
        errors: estimated from this cycle's batch.
        surplus: after the response.
        conservation_residual: ``|sum(θ_s θ_t) + C - budget| / budget``.
        stage_s: measured wall seconds per stage.
        counters: rays and other counts.
        nonfinite: number of non-finite samples replaced.
        nonfinite_fields: number of non-finite densities and errors; it should be 0.
        age_spread_s: newest minus oldest sample time shown inside regions of fast refresh, seconds.
        moved, saturated: number of elements whose densities the response changed, and of those that it drove to a
            bound.
    """

    cycle: int
    sim_time_s: float
    cost_s: float
    tiling: Tiling
    selected: Int64[Tensor, " b"]
    densities: Densities
    errors: Errors
    surplus: float
    conservation_residual: float
    stage_s: dict[str, float]
    counters: dict[str, int]
    nonfinite: int
    nonfinite_fields: int = 0
    age_spread_s: float = 0.0
    moved: int = 0
    saturated: int = 0
