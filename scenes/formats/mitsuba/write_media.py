"""Writer of media of Mitsuba files.

Source: Mitsuba 0.5 documentation; Mitsuba 3 documentation, plugin reference.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field

import numpy as np

from scenes.canonical import Instance, Medium, Scene
from scenes.formats.appearance.media import media_of
from scenes.formats.appearance.spectra import rgb
from scenes.formats.mitsuba.write_elements import Element
from scenes.formats.mitsuba.write_lights import MitsubaLightWriter
from scenes.formats.text.numbers import number


@dataclass
class MitsubaMediumWriter(MitsubaLightWriter):
    """Collects the elements of media, lights, materials and textures."""

    _media: dict[Medium, str] = field(default_factory=dict)

    def media(self, scene: Scene) -> None:
        """Writes the media of a scene; Mitsuba 3 has extinctions in [0, 1] alone, which ``scale`` multiplies."""
        for medium in media_of(scene):
            label = self._media[medium] = self.label("medium")
            made = self.plugin("medium", "homogeneous", self.root, id=label)
            extinction = np.array(medium.extinction)
            scale = float(extinction.max())
            albedo = np.divide(medium.scattering, extinction, out=np.zeros(3), where=extinction > 0.0)
            self.color(made, "sigmaT", rgb(extinction / (scale or 1.0)))
            self.color(made, "albedo", rgb(albedo))
            self.put(made, "float", "scale", number(scale))
            if medium.g:
                self.put(self.plugin("phase", "hg", made), "float", "g", number(medium.g))

    def borders(self, made: Element, instance: Instance) -> None:
        """Writes the media of both sides of a shape."""
        for name, medium in (("interior", instance.interior), ("exterior", instance.exterior)):
            self.around(made, medium, name)

    def around(self, made: Element, medium: Medium | None, name: str = "medium") -> None:
        """Writes the medium of a sensor or of a side of a shape, if there is one."""
        if medium is not None:
            ElementTree.SubElement(made, "ref", {"name": name, "id": self._media[medium]})
