"""Reader of PBRT v4 scenes.

Source: PBRT v4 file format (https://www.pbrt.org/fileformat-v4); Pharr, Jakob and Humphreys 2023, ch. 12 and
appendix C.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from scenes.arithmetic import product
from scenes.canonical import Film, Instance, Sampler, SceneError
from scenes.formats.directives.reader import typed, word
from scenes.formats.directives.syntax import Directive, Parameters, parameters_of, parse_directives
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.geometry.orientation import area_normals
from scenes.formats.losses import SAME_PICTURE
from scenes.formats.pbrt.read import PbrtReader
from scenes.formats.pbrt.v4_lights import V4Lights
from scenes.formats.pbrt.v4_materials import PbrtV4Surfaces

_TARGETS = {"Shape": "shape", "LightSource": "light", "AreaLightSource": "light", "Material": "material",
            "MakeNamedMaterial": "material", "Texture": "texture", "MakeNamedMedium": "medium"}  # fmt: skip
_PICTURE_OPTIONS = ("forcediffuse", "disablepixeljitter", "disabletexturefiltering", "rendercoordsys")
_ASSUMED_MAX = 32
_DEVIATION = 0.5  # standard deviation of the Gaussian filter, pixels


@dataclass
class PbrtV4Reader(PbrtReader):
    """State of reading a PBRT v4 file."""

    samplers: ClassVar = {
        "zsobol": "sobol", "sobol": "sobol", "paddedsobol": "sobol", "pmj02bn": "sobol", "halton": "halton",
        "independent": "independent", "stratified": "stratified",
    }  # fmt: skip
    integrators: ClassVar = {
        "volpath": "path", "path": "path", "simplevolpath": "path", "simplepath": "path", "lightpath": "path",
        "bdpt": "bidirectional", "mlt": "metropolis", "sppm": "photonmap", "randomwalk": "path",
        "ambientocclusion": "direct", "function": "path",
    }  # fmt: skip
    same_picture: ClassVar = SAME_PICTURE | {"simplepath", "simplevolpath", "lightpath", "randomwalk"}
    sampler_hints: ClassVar = ("seed", "randomization", "jitter")
    of_media: ClassVar = ("volpath", "simplevolpath", "bdpt", "mlt")
    integrator_hints: ClassVar = ("lightsampler", "regularize", "samplelights", "samplebsdf")

    film: Film = field(default_factory=lambda: Film(1280, 720, "gaussian", 1.5))
    sampler: Sampler = field(default_factory=lambda: Sampler("sobol", 16))
    _imported: tuple[Path, ...] = ()
    _shutter: float = 1.0
    _iso: float = 100.0
    _drawn_by: str = "volpath"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.names.lasting, self.media.preset_first = True, True
        assert isinstance(self.surfaces, PbrtV4Surfaces)
        self._lights = V4Lights(self.surfaces, self.files, self.report)

    def make_surfaces(self) -> PbrtV4Surfaces:
        return PbrtV4Surfaces(self.files, self.report, self.names)

    def dialect(self) -> dict[str, Callable[[Directive], None]]:
        return {
            **super().dialect(),
            "Attribute": self._assume, "Option": self._option, "ColorSpace": self._color_space,
            "Import": self._import, "Camera": self._camera_and_shutter,
        }  # fmt: skip

    def _do(self, directive: Directive) -> None:
        target = _TARGETS.get(directive.name)
        if target and self.attributes.assumed:
            own = parameters_of(directive, 3 if directive.name == "Texture" else 1).given
            pairs = (pair for (to, name), pair in self.attributes.assumed.items() if to == target and name not in own)
            found = (value for pair in pairs for value in pair)
            directive = directive._replace(values=(*directive.values, *found))
        super()._do(directive)

    def left_over(self, parameters: Parameters, what: str) -> None:
        """Reports unused parameters; those that ``Attribute`` set for all shapes or lights are hints, as they need not
        apply to each."""
        assumed = {name for _, name in self.attributes.assumed}
        for name in parameters.unasked():
            if name in assumed:
                self.report.hint("Attribute", f"parameter {name!r}, which does not apply to all")
                parameters.asked.add(name)
        super().left_over(parameters, what)

    # --- directives of version 4 ---------------------------------------------------------------------------------

    def _assume(self, directive: Directive) -> None:
        target = word(directive)
        if target not in _TARGETS.values():
            self.report.unknown(directive.place, "Attribute", target)
            return
        made = dict(self.attributes.assumed)
        found = parameters_of(directive, 1)
        for name, value in found.given.items():
            made[target, name] = (f"{found.types[name]} {name}",), value
        if len(made) > _ASSUMED_MAX:
            raise SceneError(f"{directive.place}: Attribute: expected at most {_ASSUMED_MAX} parameters")
        self.attributes.assumed = made

    def _option(self, directive: Directive) -> None:
        name = word(directive).split()[-1]
        self.report.add(str(directive.place), f"option {name!r}", picture=name in _PICTURE_OPTIONS)

    def _color_space(self, directive: Directive) -> None:
        if word(directive) != "srgb":
            self.report.add(str(directive.place), f"colours in {word(directive)!r}", "in sRGB")

    def _import(self, directive: Directive) -> None:
        """Reads a file; its attributes and transforms end with it."""
        place = str(directive.place)
        path = self.files.path(word(directive), place, self.beside)
        if path in self._imported or len(self._imported) >= 16:
            raise SceneError(f"{place}: expected files that do not import themselves, 16 inside each other at most")
        saved, depth, beside = copy.copy(self.attributes), len(self._saved), self._file
        self.transforms.push()
        self._imported = (*self._imported, path)
        for inner in parse_directives(self.files.text(path, place), path, self._open):
            self._file = inner.file
            self._do(inner)
        if len(self._saved) != depth:
            raise SceneError(f"{path.name}: expected every block to end where it begins, in one file")
        self._imported, self._file = self._imported[:-1], beside
        self.transforms.pop()
        self.attributes = saved

    # --- film, sampling ------------------------------------------------------------------------------------------

    def _camera_and_shutter(self, directive: Directive) -> None:
        _, parameters = typed(directive)
        times = parameters.number("shutteropen", 0.0), parameters.number("shutterclose", 1.0)
        self._shutter = times[1] - times[0]
        super().dialect()["Camera"](directive)

    def _read_film(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        self.read_size(parameters, 1280, 720)
        self._iso = parameters.number("iso", 100.0)
        if parameters.text("sensor", "cie1931") != "cie1931":
            self.report.add(str(directive.place), "the sensor of a film", "the colours of the eye")
        for name in ("maxcomponentvalue", "whitebalance"):
            if parameters.number(name, 0.0):
                self.report.add(str(directive.place), f"{name} of the film")
        parameters.number("diagonal", 35.0)
        if parameters.truth("savefp16", True) is False:
            self.report.hint(str(directive.place), "32-bit numbers in the picture's file")
        self.left_over(parameters, f"film {kind!r}")

    def finish(self) -> None:
        super().finish()
        exposure = self._shutter * self._iso / 100.0
        if abs(exposure - 1.0) > 1e-6:
            self.report.add("film", f"an exposure of {exposure:g} (shutter and iso)", "1")

    def read_filter(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        names = {"box": ("box", 0.5), "triangle": ("tent", 2.0), "gaussian": ("gaussian", 1.5),
                 "mitchell": ("mitchell", 2.0), "sinc": ("sinc", 4.0)}  # fmt: skip
        if kind not in names:
            self.report.unknown(directive.place, "filter", kind, "gaussian")
        name, default = names.get(kind, names["gaussian"])
        radius = parameters.number("xradius", default)
        if parameters.number("yradius", radius) != radius:
            self.report.add(str(directive.place), "yradius of the filter", "as wide as across")
        if name == "gaussian" and parameters.number("sigma", _DEVIATION) != _DEVIATION:
            self.report.add(str(directive.place), "sigma of the filter", f"{_DEVIATION}")
        self.film = dataclasses.replace(self.film, filter=name, filter_radius_px=radius)  # type: ignore[arg-type]
        self.left_over(parameters, f"filter {kind!r}")

    # --- lights --------------------------------------------------------------------------------------------------

    def _read_light(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        if self.transforms.moves:
            self.report.add(str(directive.place), "the motion of a light", "its place at the start")
        self.lights += self._lights.read(kind, parameters, self.transforms.current[0], self.placed)
        self.left_over(parameters, f"light {kind!r}")

    def _read_area_light(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        if kind != "diffuse":
            self.report.unknown(directive.place, "area light", kind, "diffuse")
        self.attributes.emission, self.attributes.power = self._lights.area(parameters)
        self.attributes.emission_twosided = parameters.truth("twosided", False)
        self.left_over(parameters, "area light")

    def _keep(self, instance: Instance, directive: Directive) -> None:
        """Keeps a shape; a lamp of a given power gets the radiance ``L power / (π area)``."""
        power, emission = self.attributes.power, instance.emission
        if emission is not None and power > 0.0:
            corners = as_mesh(instance.shape).vertices[as_mesh(instance.shape).faces].astype(np.float64)
            placed = product(corners, instance.to_world[:3, :3].T)
            size = 0.5 * float(np.sqrt((area_normals(placed.reshape(-1, 3, 3)) ** 2).sum(axis=1)).sum())
            if size > 0.0:
                shine = [part * power / (math.pi * size) for part in emission]
                instance = dataclasses.replace(instance, emission=(shine[0], shine[1], shine[2]))
        super()._keep(instance, directive)
