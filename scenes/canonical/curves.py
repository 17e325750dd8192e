"""Curves of the canonical scene; conventions as in :mod:`scenes.canonical`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenes.canonical.values import SceneError


@dataclass(frozen=True, eq=False)
class Curves:
    """Curves with a width, such as hair, in object space. The renderer draws them as meshes.

    Attributes:
        points: ``(n, 3)`` float32 control points of all curves, one curve after another.
        widths: ``(n,)`` float32 diameters or widths at the control points, interpolated as the points, non-negative.
        counts: ``(c,)`` int32 numbers of control points of the curves: at least 2 if they are linear; 4, 7, 10 and so
            on for a chain of cubic Bézier curves; at least 4 for uniform cubic B-splines.
        basis: how points and widths are interpolated.
        kind: round tubes, flat ribbons that face the viewer, ribbons that face the viewer and are shaded as tubes, or
            ribbons across ``normals``.
        normals: for ribbons ``(m, 3)`` float32 normals at the ends of all segments, one more a curve than segments.

    Source: Farin 2002, "Curves and Surfaces for CAGD", ch. 4 and 8; PBRT v3 file format, shape ``curve``.
    """

    points: NDArray[np.float32]
    widths: NDArray[np.float32]
    counts: NDArray[np.int32]
    basis: Literal["linear", "bezier", "bspline"] = "bspline"
    kind: Literal["tube", "flat", "cylinder", "ribbon"] = "tube"
    normals: NDArray[np.float32] | None = None
    source: str = ""

    def __post_init__(self) -> None:
        n = len(self.points)
        if self.points.ndim != 2 or self.points.shape[1] != 3 or self.widths.shape != (n,) or self.counts.sum() != n:
            shapes = f"{self.points.shape}, {self.widths.shape}, {self.counts.sum()} points"
            raise SceneError(f"Curves: expected points (n, 3) and widths (n,) of n counted points, got {shapes}")
        if len(self.counts) == 0 or self.segments.min() < 1:
            raise SceneError(f"Curves: expected control points for at least one segment of every {self.basis} curve")
        if self.basis == "bezier" and ((self.counts - 1) % 3).any():
            raise SceneError("Curves: expected 4, 7, 10 or so control points of each Bézier curve")
        if not (np.isfinite(self.points).all() and np.isfinite(self.widths).all() and self.widths.min() >= 0.0):
            raise SceneError("Curves: expected finite points and non-negative widths")
        wanted = (int((self.segments + 1).sum()), 3)
        if (self.normals is not None) != (self.kind == "ribbon"):
            raise SceneError("Curves: expected normals for ribbons, and for these alone")
        if self.normals is not None and self.normals.shape != wanted:
            raise SceneError(f"Curves: expected normals {wanted}, got {self.normals.shape}")

    @property
    def segments(self) -> NDArray[np.int32]:
        """The number of segments of each curve, ``(c,)``."""
        if self.basis == "linear":
            return self.counts - 1
        return (self.counts - 1) // 3 if self.basis == "bezier" else self.counts - 3
