"""Writer of curves of Mitsuba 3, which has round ones of cubic B-splines and of straight segments.

Source: Mitsuba 3 documentation, shapes ``bsplinecurve`` and ``linearcurve``.
"""

from __future__ import annotations

import numpy as np

from scenes.canonical import Curves, Instance
from scenes.formats.geometry.curves import as_bspline, bezier_segments
from scenes.formats.geometry.orientation import scales_evenly
from scenes.formats.mitsuba.curves import curve_text, scale_of
from scenes.formats.mitsuba.write_elements import Element
from scenes.formats.mitsuba.write_media import MitsubaMediumWriter

_LOST = 1e-3  # change of the greatest width that counts


class MitsubaCurveWriter(MitsubaMediumWriter):
    """Collects the elements of curves, media, lights, materials and textures."""

    def has_curves(self, instance: Instance) -> bool:
        """Whether the version has curves such as those of an instance."""
        assert isinstance(instance.shape, Curves)
        return self.modern and instance.shape.kind != "ribbon" and scales_evenly(instance.to_world[:3, :3])

    def curves(self, instance: Instance) -> Element:
        """The element of curves, with a file of their points and radii, which the transform does not scale."""
        shape, where = instance.shape, instance.name or "shape"
        assert isinstance(shape, Curves)
        if shape.kind != "tube":
            self.report.add(where, f"curves of the kind {shape.kind!r}, which face the viewer", "round curves")
        linear = shape.basis == "linear"
        made = shape if linear else as_bspline(shape)
        if not linear and self._changed(shape, made):
            self.report.add(where, "widths of curves that taper to nothing", "wider near their ends")
        file = self.output.named("models", "curves", ".txt", curve_text(made, scale_of(instance.to_world)))
        element = self.plugin("shape", "linearcurve" if linear else "bsplinecurve")
        self.put(element, "string", "filename", file)
        return element

    def _changed(self, first: Curves, second: Curves) -> bool:
        """Whether widths at control points of the B-splines would have been negative."""
        pair = [bezier_segments(curves)[0][..., 3] for curves in (first, second)]
        return bool(np.abs(pair[0] - pair[1]).max() > _LOST * first.widths.max())
