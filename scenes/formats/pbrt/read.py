"""Reader of PBRT v3 scenes.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenes import loading
from scenes.canonical import EnvironmentLight, Instance, Integrator, Medium, Rgb, Sampler, Scene
from scenes.formats.appearance.media import as_drawn_by
from scenes.formats.appearance.spectra import rgb
from scenes.formats.directives import lights
from scenes.formats.directives.reader import typed, word
from scenes.formats.directives.scene_reader import SceneReader
from scenes.formats.directives.syntax import Directive, Parameters
from scenes.formats.losses import SAME_PICTURE
from scenes.formats.pbrt.curves import read_curve
from scenes.formats.pbrt.media import PbrtMedia
from scenes.formats.pbrt.read_materials import PbrtSurfaces

_DEPTH = 5


@dataclass
class PbrtReader(SceneReader):
    """State of reading a PBRT file.

    Attributes:
        samplers, integrators: canonical names by the names of the dialect.
        same_picture: integrators that compute the same picture.
        sampler_hints, integrator_hints: parameters that are hints to the renderer.
        of_media: integrators that draw media.
    """

    samplers: ClassVar[Mapping[str, str]] = {
        "halton": "halton", "sobol": "sobol", "02sequence": "sobol", "lowdiscrepancy": "sobol", "maxmindist": "sobol",
        "random": "independent", "stratified": "stratified",
    }  # fmt: skip
    integrators: ClassVar[Mapping[str, str]] = {
        "path": "path", "volpath": "path", "bdpt": "bidirectional", "directlighting": "direct", "whitted": "whitted",
        "mlt": "metropolis", "sppm": "photonmap", "ambientocclusion": "direct",
    }  # fmt: skip
    same_picture: ClassVar[frozenset[str] | set[str]] = SAME_PICTURE
    sampler_hints: ClassVar[tuple[str, ...]] = ()
    integrator_hints: ClassVar[tuple[str, ...]] = ()
    of_media: ClassVar[tuple[str, ...]] = ("volpath", "bdpt", "mlt")
    _drawn_by: str = "path"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.media = PbrtMedia(self.surfaces, self.report)
        self.shapes.more = {"curve": read_curve}

    def make_surfaces(self) -> PbrtSurfaces:
        return PbrtSurfaces(self.files, self.report, self.names)

    def dialect(self) -> dict[str, Callable[[Directive], None]]:
        return {
            **super().dialect(),
            "Film": self._read_film, "Sampler": self._read_sampler, "Integrator": self._read_integrator,
            "SurfaceIntegrator": self._read_integrator, "LightSource": self._read_light,
            "AreaLightSource": self._read_area_light, "MakeNamedMedium": self._read_medium,
            "MediumInterface": lambda d: self.media.interface(d, self.attributes),
        }  # fmt: skip

    def _read_medium(self, directive: Directive) -> None:
        self.left_over(self.media.make(directive), f"medium {word(directive)!r}")

    def drawn(self, medium: Medium | None) -> Medium | None:
        return self.media.found(medium)

    def as_drawn(self, scene: Scene) -> Scene:
        drawn = self._drawn_by in self.of_media
        return scene if drawn else as_drawn_by(scene, self._drawn_by, self.files.main.name, self.report)

    def _read_film(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        self.read_size(parameters, 640, 480)
        self.left_over(parameters, f"film {kind!r}")

    def _read_sampler(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        name = self.report.kind(self.samplers, kind, "sampler", directive.place, picture=False)
        if kind == "stratified":
            count = parameters.whole("xsamples", 4, 1, 4096) * parameters.whole("ysamples", 4, 1, 4096)
        else:
            count = parameters.whole("pixelsamples", 16, 1, 1 << 24)
        self.sampler = Sampler(name, count)  # type: ignore[arg-type]
        self._hints(directive, parameters, self.sampler_hints, "sampler")
        self.left_over(parameters, f"sampler {kind!r}")

    def _read_integrator(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        self._drawn_by = kind
        name = self.report.kind(self.integrators, kind, "integrator", directive.place, kind not in self.same_picture)
        self.integrator = Integrator(name, parameters.whole("maxdepth", _DEPTH, 0, 1 << 20))  # type: ignore[arg-type]
        self._hints(directive, parameters, self.integrator_hints, "integrator")
        self.left_over(parameters, f"integrator {kind!r}")

    def _hints(self, directive: Directive, parameters: Parameters, names: tuple[str, ...], of: str) -> None:
        for name in names:
            if name in parameters:
                parameters.asked.add(name)
                self.report.hint(str(directive.place), f"{name} of the {of}")

    def _read_light(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        where = str(directive.place)
        scale = np.array(self.surfaces.color(parameters, "scale", (1.0, 1.0, 1.0)))
        name = "I" if kind in ("point", "spot", "projection", "goniometric") else "L"
        strength = rgb(scale * self.surfaces.color(parameters, name, (1.0, 1.0, 1.0)))
        if self.transforms.moves:
            self.report.add(where, "the motion of a light", "its place at the start")
        start = self.placed(parameters.numbers("from", 3), (0.0, 0.0, 0.0))
        target = self.placed(parameters.numbers("to", 3), (0.0, 0.0, 1.0)) if kind in ("spot", "distant") else start
        if kind in ("point", "projection", "goniometric"):
            place = lights.beside_origin(parameters, self.transforms)
            self.lights.append(lights.lamp(kind, parameters, place, strength, self.report))
        elif kind == "spot":
            self.lights.append(lights.spot(parameters, start, target, strength, "quartic"))
        elif kind == "distant":
            self.lights.append(lights.distant(start, target, strength, where))
        elif kind in ("infinite", "exinfinite"):
            self.lights.append(self._environment(parameters, strength, where))
        else:
            parameters.asked.update(parameters.given)
            self.report.unknown(where, "light", kind)
        lights.lose_hints(parameters, self.report)
        self.left_over(parameters, f"light {kind!r}")

    def _environment(self, parameters: Parameters, strength: Rgb, where: str) -> EnvironmentLight:
        file = parameters.text("mapname", "")
        if not file:
            return lights.even_environment(strength)
        path = self.files.known(file, where, self.report, f"the picture {file!r}", "even light")
        if path is None:
            return lights.even_environment(strength)
        return lights.environment_map(loading.read_image(path), self.transforms.current[0], strength, path)

    def _keep(self, instance: Instance, directive: Directive) -> None:
        if self._object is not None and instance.emission is not None:
            self.report.add(
                str(directive.place), "an area light inside an object, which PBRT does not sample", "a lamp"
            )
        super()._keep(instance, directive)

    def _read_area_light(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        if kind not in ("diffuse", "area"):
            self.report.unknown(directive.place, "area light", kind, "diffuse")
        scale = np.array(self.surfaces.color(parameters, "scale", (1.0, 1.0, 1.0)))
        self.attributes.emission = rgb(scale * self.surfaces.color(parameters, "L", (1.0, 1.0, 1.0)))
        self.attributes.emission_twosided = parameters.truth("twosided", False)
        lights.lose_hints(parameters, self.report)
        self.left_over(parameters, "area light")
