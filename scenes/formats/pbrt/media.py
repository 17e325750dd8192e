"""Media of PBRT v3 and v4, converted to the canonical scene.

Source: PBRT v3 and v4 file formats (https://www.pbrt.org/fileformat-v3, https://www.pbrt.org/fileformat-v4), sections
on media; ``MakeMedium`` and ``HomogeneousMedium::Create`` of their sources.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from scenes.canonical import Medium
from scenes.formats.appearance.media import made_medium
from scenes.formats.appearance.media_presets import pbrt_medium
from scenes.formats.appearance.spectra import grey
from scenes.formats.directives.reader import Attributes, typed, word
from scenes.formats.directives.surfaces import SurfaceFactory
from scenes.formats.directives.syntax import Directive, Parameters
from scenes.formats.losses import LossReport

_MILK = Medium((0.0011, 0.0024, 0.014), (2.55, 3.21, 3.77))  # the default


@dataclass(frozen=True)
class _Named(Medium):
    """A medium by its name, which may be made later: before a shape that has it, or anywhere if it is the camera's."""

    name: str = ""
    where: str = ""


@dataclass
class PbrtMedia:
    """The media of a file by name, which belong to the whole scene; None for those that are left out.

    Attributes:
        surfaces: reader of colours.
        report: receives the losses.
        preset_first: whether the coefficients of a preset replace those that are given, as in version 4.
    """

    surfaces: SurfaceFactory
    report: LossReport
    preset_first: bool = False
    named: dict[str, Medium | None] = field(default_factory=dict)

    def make(self, directive: Directive) -> Parameters:
        """Reads a medium, and returns its parameters."""
        name, parameters = typed(directive)
        where, kind = str(directive.place), parameters.text("type", "")
        if kind == "homogeneous":
            self.named[name] = self._homogeneous(parameters, where)
            return parameters
        parameters.asked.update(parameters.given)
        self.named[name] = None
        self.report.add(where, f"the medium {name!r} of the type {kind!r} (participating medium)")
        return parameters

    def _homogeneous(self, parameters: Parameters, where: str) -> Medium:
        preset = parameters.text("preset", "")
        known = pbrt_medium(preset) if preset else None
        if preset and known is None:
            self.report.add(where, f"the medium {preset!r}, which is not known", "the coefficients of milk")
        base = known or _MILK
        absorption = self.surfaces.color(parameters, "sigma_a", base.absorption)
        scattering = self.surfaces.color(parameters, "sigma_s", base.scattering)
        if known is not None and self.preset_first:
            if {"sigma_a", "sigma_s"} & set(parameters.given):
                self.report.hint(where, "coefficients beside a preset", "those of the preset")
            absorption, scattering = known.absorption, known.scattering
        if self.preset_first and max(self.surfaces.color(parameters, "Le", grey(0.0))) > 0.0:
            parameters.number("Lescale", 1.0)
            self.report.add(where, "a medium that shines (Le)", "dark")
        factor, g = parameters.number("scale", 1.0), parameters.number("g", 0.0)
        return made_medium(absorption, scattering, g, where, factor)

    def interface(self, directive: Directive, attributes: Attributes) -> None:
        """Sets the media of both sides of the following shapes; one name stands for both."""
        names = [word(directive, at) for at in range(max(1, min(2, len(directive.values))))]
        sides = [_Named(name=name, where=str(directive.place)) if name else None for name in names]
        attributes.interior, attributes.exterior = sides[0], sides[-1]

    def found(self, medium: Medium | None) -> Medium | None:
        """The medium that has the name of a side."""
        if not isinstance(medium, _Named):
            return None
        if medium.name not in self.named:
            self.report.add(medium.where, f"the medium {medium.name!r}, which is not defined", "vacuum")
        return self.named.get(medium.name)
