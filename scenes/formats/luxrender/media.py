"""Media of LuxRender 1.x, converted to the canonical scene.

A shape without an interior is no border. ``glass2`` has the index of the volume inside over that of the volume outside.

Source: LuxRender scene file format 1.0 (wiki of LuxRender), section on volumes; ``ClearVolume`` and
``HomogeneousVolume`` of its sources; ``PathVolumeInfo`` of LuxCore.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from scenes.canonical import ConstantTexture, Glass, Material, Medium, Rgb, SceneError
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.media import made_medium
from scenes.formats.appearance.spectra import grey
from scenes.formats.directives.reader import word
from scenes.formats.directives.scene_reader import SceneReader
from scenes.formats.directives.syntax import Directive, Parameters, parameters_of
from scenes.formats.luxrender.cameras import lose_longer_side
from scenes.formats.luxrender.read_materials import LuxSurfaces

_COEFFICIENTS = {"clear": ("absorption", ""), "homogeneous": ("sigma_a", "sigma_s"),
                 "homogenous": ("sigma_a", "sigma_s")}  # fmt: skip
"""Kinds of volumes, with the parameters of absorption and scattering; the last is LuxCore's spelling."""

SCHLICK = "as much by Schlick's phase function"
"""How LuxRender and LuxCore scatter; at a g of 0.5 by up to 20 % less light sideways, and 7 % more backwards."""

_INDEX = 1.5


@dataclass(frozen=True)
class _Volume(Medium):
    """A medium with its refractive index."""

    index: float = _INDEX


@dataclass
class LuxMediaReader(SceneReader):
    """State of reading the volumes of a file."""

    surfaces: LuxSurfaces = field(init=False)
    volumes: dict[str, _Volume] = field(default_factory=dict)
    _glasses: dict[tuple[int, float], tuple[Material, Material]] = field(default_factory=dict)
    _integrator: str = "emission"
    _scatters: bool = False

    def dialect(self) -> dict[str, Callable[[Directive], None]]:
        return {
            **super().dialect(),
            "MakeNamedVolume": self._make, "VolumeIntegrator": self._drawn_by,
            "Interior": lambda d: setattr(self.attributes, "interior", self._named(d)),
            "Exterior": lambda d: setattr(self.attributes, "exterior", self._named(d)),
            "Volume": lambda d: self.report.add(str(d.place), f"Volume {word(d)!r} (participating medium)"),
        }  # fmt: skip

    def _drawn_by(self, directive: Directive) -> None:
        self._integrator = word(directive)

    def finish(self) -> None:
        super().finish()
        lose_longer_side(self.camera, self.window, self.film, self.report)
        if self._scatters and self._integrator != "multi":
            what = f"the volume integrator {self._integrator!r}, which does not draw all of the scattered light"
            self.report.add(self.files.main.name, what, "all of it")

    def _make(self, directive: Directive) -> None:
        name, kind, parameters = word(directive), word(directive, 1), parameters_of(directive, 2)
        where = str(directive.place)
        if kind not in _COEFFICIENTS:
            parameters.asked.update(parameters.given)
            self.report.add(where, f"the volume {name!r} of the type {kind!r} (participating medium)")
            self.names.define(self.volumes, name, _Volume())
            return
        absorption, scattering = (self._color(parameters, part) for part in _COEFFICIENTS[kind])
        toward = self._color(parameters, "" if kind == "clear" else "g")
        if len(set(toward)) > 1:
            self.report.add(where, "a g of a medium for each colour", "their mean")
        made = made_medium(absorption, scattering, float(np.mean(toward)), where)
        if made.g and made.scatters:
            self.report.add(
                where, f"scattering by Schlick's phase function with a g of {made.g:g}", "by Henyey and Greenstein"
            )
        self._scatters |= made.scatters
        index = self._index(parameters)
        if not index > 0.0:
            raise SceneError(f"{where}: fresnel: expected a positive index, got {index:g}")
        volume = _Volume(made.absorption, made.scattering, made.g, index)
        self.names.define(self.volumes, name, volume)
        self.left_over(parameters, f"volume {name!r}")

    def _color(self, parameters: Parameters, name: str) -> Rgb:
        """A coefficient, the mean of its texture; 0 without a name."""
        found = self.surfaces.texture(parameters, name, grey(0.0)) if name else ConstantTexture(grey(0.0))
        if not isinstance(found, ConstantTexture):
            self.report.add(str(parameters.place), f"a texture of a medium ({name})", "its mean")
        return mean_of(found)

    def _index(self, parameters: Parameters) -> float:
        """The refractive index, given as a number or by a fresnel texture."""
        if parameters.types.get("fresnel") not in ("texture", "string"):
            return parameters.number("fresnel", _INDEX)
        name = parameters.text("fresnel", "")
        if name not in self.names.indices:
            what = f"fresnel texture {name!r}, which is not defined"
            self.report.add(str(parameters.place), what, f"the index {_INDEX}")
            return _INDEX
        return float(np.mean(self.names.indices[name][0]))

    def _named(self, directive: Directive) -> _Volume | None:
        """The medium of a name, None for no name."""
        name = word(directive)
        if name and name not in self.volumes:
            self.report.add(str(directive.place), f"the volume {name!r}, which is not defined", "none")
        return self.volumes.get(name)

    def sides(self) -> tuple[Medium | None, Medium | None]:
        """Behind the volume of a shape without an exterior is that of the camera, as in LuxCore."""
        inside, outside = super().sides()
        if inside is None:
            return None, None
        around = self.drawn(self.medium)
        return inside, outside or (around if around != inside else None)

    def read_shape(self, directive: Directive) -> None:
        given = self.attributes.material
        if isinstance(given, Glass) and id(given) in self.surfaces.of_volumes:
            self.attributes.material = self._refracting(given)
        super().read_shape(directive)
        self.attributes.material = given

    def _refracting(self, glass: Glass) -> Material:
        """The glass between the volumes of both sides."""
        inside, outside = self.attributes.interior, self.attributes.exterior
        if not isinstance(inside, _Volume):
            return glass
        ratio = inside.index / (outside.index if isinstance(outside, _Volume) else 1.0)
        key = id(glass), ratio
        if key not in self._glasses:
            self._glasses[key] = glass, dataclasses.replace(glass, ior=ratio)
        return self._glasses[key][1]
