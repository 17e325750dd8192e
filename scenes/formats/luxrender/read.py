"""Reader of LuxRender 1.x scenes.

LuxRender shares its syntax and much of its semantics with PBRT. It differs as follows: ``LookAt`` is right-handed,
images begin at ``v = 0``, lights have a gain and may be given by their power, and materials have other names.

Source: LuxRender scene file format 1.0 (wiki of LuxRender); conventions measured with LuxCore 2.10; Hagemann 2018,
ch. 4.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenes.arithmetic import determinant, norm, product, sin
from scenes.canonical import (
    ConstantTexture,
    EnvironmentLight,
    Instance,
    Integrator,
    Rgb,
    Sampler,
    Scene,
    SceneError,
    SunSky,
)
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.directives import lights
from scenes.formats.directives.reader import typed, word
from scenes.formats.directives.scene_reader import scene_of
from scenes.formats.directives.syntax import Directive, Parameters, parameters_of
from scenes.formats.geometry.meshed import as_mesh, turned_over
from scenes.formats.geometry.placing import has_outside
from scenes.formats.geometry.revolution import area
from scenes.formats.geometry.transform_stack import KEYS_MAX
from scenes.formats.losses import SAME_PICTURE, LossReport
from scenes.formats.luxrender.media import LuxMediaReader
from scenes.formats.luxrender.read_materials import LuxSurfaces, lux_image
from scenes.formats.text.scene_files import SceneFiles

_INTEGRATORS = {"path": "path", "bidirectional": "bidirectional", "directlighting": "direct", "distributedpath": "path",
                "exphotonmap": "photonmap", "sppm": "photonmap", "igi": "direct", "single": "path",
                "emission": "path", "multi": "path", "none": "path"}  # fmt: skip
_SAMPLERS = {"lowdiscrepancy": "sobol", "random": "independent", "metropolis": "independent", "erpt": "independent",
             "sobol": "sobol", "halton": "halton"}  # fmt: skip
_NO_EFFECT = ("Renderer", "Accelerator", "RenderingServer")
SPHERE_SR = 4.0 * math.pi
"""Ratio of ``L`` of LuxCore's point light to its intensity (measured: 10 gives 0.0314 from a floor of albedo 0.5 two
units below)."""

SKY_UNIT, SUN_UNIT = 72_922.0, 66_000.0
"""Ratio of the radiance of LuxCore 2.10's sky2 and sun at a gain of 1 to that of Mitsuba 3 at a scale of 1. The sky
model is the same, in luminous units (683 lm/W); the sun model differs and is dimmer in haze. Checked to 1 % and 15 % at
a turbidity of 3 in ``tests/scripts/test_conversion_check.py``."""
_TRANSFORMS = ("Identity", "Translate", "Scale", "Rotate", "LookAt", "Transform", "ConcatTransform",
               "CoordSysTransform")  # fmt: skip
LUMINANCE = np.array([0.212671, 0.715160, 0.072169])  # of linear RGB


def cone_sr(angle_deg: float) -> float:
    """Irradiance on a facing surface from a cone of radiance 1 and this full angle: ``π sin²(angle / 2)``.

    LuxCore's distant lights with ``theta`` (half the angle, degrees) have a radiance, others an irradiance (measured).
    """
    return math.pi * sin(math.radians(0.5 * angle_deg)) ** 2


@dataclass
class LuxReader(LuxMediaReader):
    """State of reading a LuxRender file."""

    left_handed: bool = False
    _halt_samples: int = 0
    _motion_key: int | None = None

    def make_surfaces(self) -> LuxSurfaces:
        return LuxSurfaces(self.files, self.report, self.names)

    def dialect(self) -> dict[str, Callable[[Directive], None]]:
        return {
            **super().dialect(),
            **dict.fromkeys(_NO_EFFECT, lambda d: None),
            **dict.fromkeys(("Integrator", "SurfaceIntegrator"), self._read_integrator),
            "Film": self._read_film,
            "Sampler": self._read_sampler,
            "LightSource": self._read_light,
            "AreaLightSource": self._read_area_light,
            "LightGroup": lambda d: self.report.add(str(d.place), f"light group {word(d)!r}", "no groups"),
            "PortalShape": lambda d: self.report.add(str(d.place), "a portal"),
            "MotionInstance": self._move_object,
            "MotionBegin": self._begin_motion,
            "MotionEnd": self._end_motion,
        }

    def _do(self, directive: Directive) -> None:
        """Executes a directive; inside a motion each transform belongs to the next key."""
        key = self._motion_key
        if key is None or directive.name == "MotionEnd":
            super()._do(directive)
            return
        if directive.name not in _TRANSFORMS:
            raise SceneError(f"{directive.place}: MotionBegin: expected transforms and MotionEnd, got {directive.name}")
        count = len(self.transforms.current)
        if key >= count:
            raise SceneError(f"{directive.place}: MotionBegin: expected {count} transforms, got more")
        self.transforms.active = tuple(number == key for number in range(count))
        super()._do(directive)
        self._motion_key = key + 1

    def _begin_motion(self, directive: Directive) -> None:
        times_s = [value for part in directive.values if not isinstance(part, tuple) for value in part.tolist()]
        if not 2 <= len(times_s) <= KEYS_MAX or not (np.diff(times_s) > 0.0).all():
            raise SceneError(f"{directive.place}: MotionBegin: expected 2 to {KEYS_MAX} times, each after the last")
        if self.transforms.moves:
            self.report.add(str(directive.place), "a motion within a motion", "the inner one")
        self.transforms.retime(times_s)
        self._motion_key = 0

    def _end_motion(self, directive: Directive) -> None:
        count = len(self.transforms.current)
        if self._motion_key != count:
            raise SceneError(f"{directive.place}: MotionEnd: expected {count} transforms before it")
        self.transforms.active, self._motion_key = (True,) * count, None

    def read_texture(self, directive: Directive) -> None:
        if word(directive, 1) != "fresnel":
            super().read_texture(directive)
            return
        parameters = parameters_of(directive, 3)
        assert isinstance(self.surfaces, LuxSurfaces)
        made = self.surfaces.make_fresnel(word(directive, 2), parameters)
        self.names.define(self.names.indices, word(directive), made)
        self.left_over(parameters, f"texture {word(directive)!r}")

    def _move_object(self, directive: Directive) -> None:
        self.report.add(str(directive.place), "MotionInstance", "its place at the start")
        self.place_object(directive)

    def _read_film(self, directive: Directive) -> None:
        _, parameters = typed(directive)
        self._halt_samples = parameters.whole("haltspp", 0, 0, 1 << 24)
        self.read_size(parameters, 800, 600)
        if "cropwindow" in parameters:
            parameters.asked.add("cropwindow")
            self.report.add(str(directive.place), "cropwindow of the film", "the whole picture")
        if parameters.unasked():
            self.report.hint(
                str(directive.place), f"{len(parameters.unasked())} settings of the film", "linear radiance"
            )
        if self._halt_samples:
            self.sampler = Sampler(self.sampler.kind, self._halt_samples)

    def _read_sampler(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        name = self.report.kind(_SAMPLERS, kind, "sampler", directive.place, picture=False)
        count = parameters.whole("pixelsamples", self._halt_samples or 4, 1, 1 << 24)
        rest = parameters.unasked() if kind in ("metropolis", "erpt") else []
        if rest:
            parameters.asked.update(rest)
            self.report.hint(str(directive.place), f"{len(rest)} settings of the sampler {kind!r}")
        self.sampler = Sampler(name, self._halt_samples or count)  # type: ignore[arg-type]
        self.left_over(parameters, f"sampler {kind!r}")

    def _read_integrator(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        name = self.report.kind(_INTEGRATORS, kind, "integrator", directive.place, kind not in SAME_PICTURE)
        depth = parameters.whole("eyedepth" if kind == "bidirectional" else "maxdepth", 16, 0, 1 << 20)
        light = parameters.whole("lightdepth", depth, 0, 1 << 20) if kind == "bidirectional" else depth
        if light != depth:
            self.report.add(str(directive.place), f"paths of {light} edges from the lights", f"of {depth}")
        # number of edges of a path, as measured with LuxCore
        self.integrator = Integrator(name, max(depth - 1, 0))  # type: ignore[arg-type]
        self.left_over(parameters, f"integrator {kind!r}")

    # --- lights --------------------------------------------------------------------------------------------------

    def _strength(self, parameters: Parameters) -> Rgb:
        """``L`` times the gain; a power that is not supported is reported."""
        gain = parameters.number("gain", 1.0)
        if parameters.types.get("L") == "texture":
            color = self._light_texture(parameters)
        else:
            color = self.surfaces.color(parameters, "L", grey(1.0))
        return rgb(gain * np.array(color))

    def _light_texture(self, parameters: Parameters) -> Rgb:
        name = parameters.text("L", "")
        found = self.names.colors.get(name)
        if found is None:
            self.report.add(str(parameters.place), f"light texture {name!r}, which is not known", "white")
            return grey(1.0)
        if not isinstance(found, ConstantTexture):
            self.report.add(str(parameters.place), "a light with a texture", "its mean")
        return mean_of(found)

    def _read_light(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        where = str(directive.place)
        lights.lose_hints(parameters, self.report)
        if kind in ("sun", "sky", "sky2", "sunsky", "sunsky2"):
            self._daylight(kind, parameters)
        elif kind in ("infinite", "infinitesample"):
            self.lights.append(self._environment(parameters, self._strength(parameters), where))
        elif kind in ("point", "spot", "distant", "projection", "goniometric"):
            self._lamp(kind, parameters, where)
        else:
            parameters.asked.update(parameters.given)
            self.report.unknown(where, "light", kind)
        self.left_over(parameters, f"light {kind!r}")

    def _lamp(self, kind: str, parameters: Parameters, where: str) -> None:
        strength = self._strength(parameters)
        start = self.placed(parameters.numbers("from", 3), (0.0, 0.0, 0.0))
        target = self.placed(parameters.numbers("to", 3), (0.0, 0.0, 1.0))
        parameters.number("efficacy", 17.0)
        if parameters.number("power", 0.0) > 0.0:
            self.report.add(where, f"the power of a {kind} light", "none: its colour and gain count")
        if kind == "distant":
            angle_deg = 2.0 * parameters.number("theta", 0.0)
            if not 0.0 <= angle_deg <= 180.0:
                raise SceneError(f"{where}: theta: expected an angle in [0, 90], got {0.5 * angle_deg:g}")
            facing = rgb(np.array(strength) * cone_sr(angle_deg)) if angle_deg else strength
            self.lights.append(lights.distant(start, target, facing, where, angle_deg))
        elif kind == "spot":
            self.lights.append(lights.spot(parameters, start, target, strength, "secant"))
        else:
            even, start = rgb(np.array(strength) / SPHERE_SR), lights.beside_origin(parameters, self.transforms)
            self.lights.append(lights.lamp(kind, parameters, start, even, self.report))

    def _daylight(self, kind: str, parameters: Parameters) -> None:
        toward = parameters.numbers("sundir", 3)
        direction = np.array((0.0, 0.0, 1.0)) if toward is None else toward
        if not norm(direction) > 0.0:
            raise SceneError(f"{parameters.place}: sundir: expected a direction")
        turned = product(self.transforms.current[0][:3, :3], direction)
        part = {"sun": "sun", "sky": "sky", "sky2": "sky"}.get(kind, "both")
        if "relsize" in parameters:
            parameters.number("relsize", 1.0)
            self.report.add(str(parameters.place), "the size of the sun's disk", "the real one")
        turbidity, gain = parameters.number("turbidity", 2.0), parameters.number("gain", 1.0)
        up = self.transforms.current[0][:3, 2]
        unit, zenith = rgb(turned / norm(turned)), rgb(up / norm(up))
        for one, size in (("sun", SUN_UNIT), ("sky", SKY_UNIT)):
            if part in (one, "both"):
                self.lights.append(SunSky(unit, turbidity, gain * size, one, zenith, 0.0))  # type: ignore[arg-type]

    def _environment(self, parameters: Parameters, strength: Rgb, where: str) -> EnvironmentLight:
        file, gamma = parameters.text("mapname", ""), parameters.number("gamma", 2.2)
        mapping = parameters.text("mapping", "latlong")
        if mapping != "latlong":
            self.report.add(where, f"mapping {mapping!r} of an environment map", "latlong")
        if not file:
            return lights.even_environment(strength)
        path = self.files.known(file, where, self.report, f"the picture {file!r}", "even light")
        if path is None:
            return lights.even_environment(strength)
        return lights.environment_map(lux_image(path, gamma, 1.0, where), self.transforms.current[0], strength, path)

    def _read_area_light(self, directive: Directive) -> None:
        _, parameters = typed(directive)
        self.attributes.emission = self._strength(parameters)
        lumens = parameters.number("power", 100.0) * parameters.number("efficacy", 17.0)
        self.attributes.power = lumens * parameters.number("gain", 1.0)  # which multiplies after the scaling, measured
        lights.lose_hints(parameters, self.report)
        self.left_over(parameters, "area light")

    def _keep(self, instance: Instance, directive: Directive) -> None:
        """Keeps a shape; lamps and media have their outside where the faces of the file are counter-clockwise."""
        if has_outside(instance) and determinant(self.transforms.current[0]) < 0.0:
            instance = turned_over(instance)
        super()._keep(instance, directive)

    def read_shape(self, directive: Directive) -> None:
        count = len(self.instances)
        super().read_shape(directive)
        power, emission = self.attributes.power, self.attributes.emission
        if len(self.instances) == count or emission is None or not power > 0.0:
            return
        luminance = float(product(LUMINANCE, emission))
        lamp = self.instances[-1]
        size = area(as_mesh(lamp.shape), lamp.to_world[:3, :3])
        if luminance > 0.0 and size > 0.0:
            radiance = rgb(np.array(emission) * power / (math.pi * size * luminance))
            self.instances[-1] = dataclasses.replace(lamp, emission=radiance)


def load_luxrender(path: Path, root: Path | None, report: LossReport) -> Scene:
    """Reads a scene; see :data:`scenes.formats.text.format.Read`.

    Raises:
        SceneError: the scene cannot be read; the message gives file, line and column.
    """
    return scene_of(LuxReader(SceneFiles(path, root), report), path)
