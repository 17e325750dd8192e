"""Media of Mitsuba 0.5 and 3, converted to the canonical scene.

Source: Mitsuba 0.5 documentation, section on participating media, and ``lookupMaterial`` of its source; Mitsuba 3
documentation, plugin reference.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from scenes.canonical import Medium, Rgb
from scenes.formats.appearance.media import made_medium
from scenes.formats.appearance.media_presets import mitsuba_medium
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.properties import Properties
from scenes.formats.mitsuba.read_textures import MISSING
from scenes.formats.text.xml_tree import XmlNode

_HINTS = ("strategy", "samplingDensity", "mediumSamplingWeight", "channel", "sampleEmitters", "hasSpectralExtinction")
_SKIN = "skin1"  # the default of Mitsuba 0.5
_FORWARDS = 0.8  # the default g of both versions


class MitsubaMedia:
    """Creates media from elements, each once.

    Attributes:
        modern: whether the file is one of Mitsuba 2 or 3.
    """

    def __init__(self, report: LossReport, find: Callable[..., XmlNode]) -> None:
        self.report, self.find = report, find
        self.modern = False
        self._made: dict[int, tuple[XmlNode, Medium | None]] = {}

    def read(self, node: XmlNode) -> Medium | None:
        """The medium of an element; None for one that is left out, which is reported."""
        if id(node) not in self._made:
            self._made[id(node)] = node, self._read(node)
        return self._made[id(node)][1]

    def _read(self, node: XmlNode) -> Medium | None:
        kind, properties = node.get("type"), Properties(node, self.report)
        if kind == MISSING:
            return None
        if kind != "homogeneous":
            named = f" {node.get('id')!r}" if node.get("id") else ""
            self.report.add(properties.where, f"the medium{named} of the type {kind!r} (participating medium)")
            return None
        base = self._preset(properties)
        self._even(properties)
        if {"sigmaS", "sigmaA"} & set(properties.given) and not self.modern:
            scattering = properties.color("sigmaS", base.scattering)
            absorption = properties.color("sigmaA", base.absorption)
        else:
            scattering, absorption = self._by_albedo(properties, base)
        g = self._g(properties, base.g)
        for name in _HINTS:
            if name in properties:
                properties.asked.add(name)
                self.report.hint(properties.where, f"{name} of a medium", "the renderer's own choice")
        made = made_medium(absorption, scattering, g, properties.where, properties.number("scale", 1.0))
        properties.left_over()
        return made

    def _preset(self, properties: Properties) -> Medium:
        """The medium whose coefficients are used where an element gives none."""
        if self.modern:
            return Medium(grey(0.25), grey(0.75))
        name = properties.text("material", _SKIN)
        found = mitsuba_medium(name)
        if found is None:
            self.report.add(properties.where, f"the medium {name!r}, which is not known", _SKIN)
            found = mitsuba_medium(_SKIN)
        assert found is not None
        return found

    def _by_albedo(self, properties: Properties, base: Medium) -> tuple[Rgb, Rgb]:
        """Scattering and absorption from extinction and albedo."""
        whole = np.array(base.extinction)
        share = np.divide(base.scattering, whole, out=np.zeros(3), where=whole > 0.0)
        extinction = np.array(properties.color("sigmaT", base.extinction))
        scattering = extinction * properties.color("albedo", rgb(share))
        return rgb(scattering), rgb(extinction - scattering)

    def _even(self, properties: Properties) -> None:
        """Replaces volumes that are constant by their values; others are reported."""
        for child in [part for part in properties.rest if part.tag == "volume"]:
            properties.rest.remove(child)
            values = [part for part in child.children if part.get("name") == "value"]
            if child.get("type") == "constvolume" and values:
                name = child.get("name")
                values[0].attributes["name"] = name
                properties.given[name] = values[0]
            else:
                what = f"{child.get('name')} of a medium by a volume of the type {child.get('type')!r}"
                self.report.add(str(child.place), what, "its default")

    def _g(self, properties: Properties, default: float) -> float:
        """The mean cosine of the phase function; of colours, the mean."""
        g = float(np.mean(properties.color("g", grey(default)))) if not self.modern else 0.0
        for child in properties.rest:
            node = self.find(child) if child.tag == "ref" else child
            if node.tag != "phase":
                self.report.unknown(node.place, f"{node.tag} inside a medium", node.get("type"))
                continue
            properties.asked.add(child.get("name"))
            inner, kind = Properties(node, self.report), node.get("type")
            if kind == "hg":
                g = float(np.mean(inner.color("g", grey(_FORWARDS))))
            elif kind == "isotropic":
                g = 0.0
            else:
                inner.asked.update(inner.given)
                self.report.add(inner.where, f"phase function {kind!r}", "isotropic")
                g = 0.0
            inner.left_over()
        return g
