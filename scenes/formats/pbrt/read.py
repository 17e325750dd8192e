"""PBRT v3 scenes into the canonical scene.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes import loading
from scenes.arithmetic import arctan, norm, product, products, tan
from scenes.canonical import (
    Camera,
    ConstantTexture,
    DirectionalLight,
    EnvironmentCamera,
    EnvironmentLight,
    Film,
    Instance,
    Integrator,
    Light,
    Masked,
    Material,
    Matte,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    RealisticCamera,
    Rgb,
    RigidTrack,
    Sampler,
    Scene,
    SceneError,
    SpotLight,
)
from scenes.canonical.values import Matrix
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.geometry.recognition import shape_of
from scenes.formats.geometry.transform_stack import inverse, motion, moved_by, track_times
from scenes.formats.losses import LossReport
from scenes.formats.pbrt.read_materials import Surfaces
from scenes.formats.pbrt.read_shapes import ShapeReader
from scenes.formats.text.directive_reader import DirectiveReader, typed, word
from scenes.formats.text.directives import Directive, Parameters, parameters_of
from scenes.formats.text.scene_files import SceneFiles

FORWARD = np.diag([1.0, 1.0, -1.0, 1.0])
"""From a camera that looks along +z with x to the right to the canonical one, which looks along -z."""

MAP_AXES = np.array([[0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""From the canonical axes of environment maps to PBRT's: ``p = (-z, x, y)``."""

FILTERS = {"box": "box", "triangle": "tent", "gaussian": "gaussian", "mitchell": "mitchell", "sinc": "sinc"}
_RADII = {"box": 0.5, "tent": 2.0, "gaussian": 2.0, "mitchell": 2.0, "sinc": 4.0}
SAMPLERS = {"halton": "halton", "sobol": "sobol", "02sequence": "sobol", "lowdiscrepancy": "sobol",
            "maxmindist": "sobol", "random": "independent", "stratified": "stratified"}  # fmt: skip
INTEGRATORS = {"path": "path", "volpath": "path", "bdpt": "bidirectional", "directlighting": "direct",
               "whitted": "whitted", "mlt": "metropolis", "sppm": "photonmap",
               "ambientocclusion": "direct"}  # fmt: skip
_DEPTH = 5
FAR = 1e6
"""Focal distance of a camera that says none."""

_DEFAULT = Matte(ConstantTexture((0.5, 0.5, 0.5)))
_SHAPE_MAX = 1 << 20
"""Instances of a scene at most: nested object instances multiply."""


@dataclass
class PbrtReader(DirectiveReader):
    """State of a PBRT file while it is read."""

    camera: Camera | None = None
    film: Film = field(default_factory=Film)
    sampler: Sampler = field(default_factory=lambda: Sampler("halton", 16))
    integrator: Integrator = field(default_factory=lambda: Integrator("path", 5))
    instances: list[Instance] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    objects: dict[str, list[Instance]] = field(default_factory=dict)
    _object: list[Instance] | None = None
    _filter: tuple[str, float] = ("box", 0.5)

    def __post_init__(self) -> None:
        self.shapes = ShapeReader(self.files, self.report)
        self.surfaces = Surfaces(self.files, self.report, self.textures, self.materials)

    # --- directives ----------------------------------------------------------------------------------------------

    def dialect(self) -> dict[str, Callable[[Directive], None]]:
        return {
            "Camera": self._read_camera, "Film": self._read_film, "PixelFilter": self._read_filter,
            "Sampler": self._read_sampler, "Integrator": self._read_integrator,
            "SurfaceIntegrator": self._read_integrator, "Accelerator": lambda d: None,
            "WorldBegin": self._begin_world, "WorldEnd": lambda d: None,
            "Texture": self._read_texture, "Material": self._read_material,
            "MakeNamedMaterial": self._name_material, "NamedMaterial": self._take_material,
            "Shape": self._read_shape, "LightSource": self._read_light, "AreaLightSource": self._read_area_light,
            "ObjectBegin": self._begin_object, "ObjectEnd": self._end_object, "ObjectInstance": self._place_object,
            "MakeNamedMedium": self._lose_medium, "MediumInterface": self._lose_medium,
        }  # fmt: skip

    def _begin_world(self, directive: Directive) -> None:
        self.transforms.replace(np.eye(4))

    def _lose_medium(self, directive: Directive) -> None:
        named = f" {word(directive)!r}" if directive.values and isinstance(directive.values[0], tuple) else ""
        self.report.add(str(directive.place), f"{directive.name}{named} (participating medium)")

    def _read_texture(self, directive: Directive) -> None:
        name, kind = word(directive), word(directive, 2)
        parameters = parameters_of(directive, 3)
        self.textures[name] = self.surfaces.made_texture(kind, parameters)
        self.left_over(parameters, f"texture {name!r}")

    def _read_material(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        self.attributes.material = self.surfaces.material(kind, parameters)
        self.left_over(parameters, f"material {kind!r}")

    def _name_material(self, directive: Directive) -> None:
        name, parameters = typed(directive)
        self.materials[name] = self.surfaces.material(parameters.text("type", ""), parameters)
        self.left_over(parameters, f"material {name!r}")

    def _take_material(self, directive: Directive) -> None:
        name = word(directive)
        if name not in self.materials:
            raise SceneError(f"{directive.place}: NamedMaterial: expected a material made before, got {name!r}")
        self.attributes.material = self.materials[name]

    # --- camera, film, sampling ----------------------------------------------------------------------------------

    def _read_camera(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        keys = [inverse(matrix) for matrix in self.transforms.current]
        self.transforms.named["camera"] = keys
        track = self._motion(keys, str(directive.place))
        shutter = parameters.number("shutteropen", 0.0), parameters.number("shutterclose", 1.0)
        if not {"shutteropen", "shutterclose"} & set(parameters.given) and track is None:
            shutter = 0.0, 0.0  # the default of a still
        half, mirror = self._window(parameters, directive)
        start = products(keys[0], FORWARD, mirror)
        if parameters.number("frameaspectratio", 0.0):
            self.report.add(str(directive.place), "frameaspectratio of the camera", "that of the film")
        if kind == "perspective":
            fov = parameters.number("fov", 2.0 * parameters.number("halffov", 45.0))
            if not 0.0 < fov < 180.0:
                raise SceneError(f"{directive.place}: fov: expected an angle in (0, 180), got {fov:g}")
            fov = math.degrees(2.0 * arctan(tan(math.radians(fov) / 2.0) * half)) if half != 1.0 else fov
            lens, focus = parameters.number("lensradius", 0.0), parameters.number("focaldistance", FAR)
            self.camera = PerspectiveCamera(start, fov, lens, focus, track, shutter)
        elif kind == "orthographic":
            self.camera = OrthographicCamera(start, half, track)
        elif kind == "environment":
            self.camera = EnvironmentCamera(start)
        elif kind == "realistic":
            numbers = parameters.number("aperturediameter", 1.0), parameters.number("focusdistance", 10.0)
            self.camera = RealisticCamera(start, parameters.text("lensfile", ""), *numbers)
        else:
            raise SceneError(f"{directive.place}: expected a kind of camera, got {kind!r}")
        self.left_over(parameters, f"camera {kind!r}")

    def _window(self, parameters: Parameters, directive: Directive) -> tuple[float, Matrix]:
        """Half the window's shorter side, and the mirror that one from right to left is; one off the middle is
        reported."""
        window = parameters.numbers("screenwindow", 4)
        if window is None:
            return 1.0, np.eye(4)
        left, right, bottom, top = window
        signs = np.sign([right - left, top - bottom])
        if abs(left + right) > 1e-6 * abs(right) or abs(bottom + top) > 1e-6 * abs(top):
            self.report.add(str(directive.place), "a screen window off the middle", "one about the middle")
        if not signs.all():
            raise SceneError(f"{directive.place}: screenwindow: expected left and right, bottom and top apart")
        return 0.5 * float(min(abs(right - left), abs(top - bottom))), np.diag([*signs, 1.0, 1.0])

    def _read_film(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        size = parameters.whole("xresolution", 640, 1, 32768), parameters.whole("yresolution", 480, 1, 32768)
        self.film = Film(*size, *self._filter, filename=parameters.text("filename", ""))  # type: ignore[arg-type]
        self.left_over(parameters, f"film {kind!r}")

    def _read_filter(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        name = self.report.kind(FILTERS, kind, "filter", directive.place)
        radius = parameters.number("xwidth", _RADII[name])
        if parameters.number("ywidth", radius) != radius:
            self.report.add(str(directive.place), "ywidth of the filter", "as wide as across")
        self._filter = name, radius
        self.film = dataclasses.replace(self.film, filter=name, filter_radius_px=radius)
        self.left_over(parameters, f"filter {kind!r}")

    def _read_sampler(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        name = self.report.kind(SAMPLERS, kind, "sampler", directive.place)
        count = parameters.whole("pixelsamples", 16, 1, 1 << 24)
        if kind == "stratified":
            count = parameters.whole("xsamples", 4, 1, 4096) * parameters.whole("ysamples", 4, 1, 4096)
        self.sampler = Sampler(name, count)  # type: ignore[arg-type]
        self.left_over(parameters, f"sampler {kind!r}")

    def _read_integrator(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        name = self.report.kind(INTEGRATORS, kind, "integrator", directive.place)
        self.integrator = Integrator(name, parameters.whole("maxdepth", _DEPTH, 0, 1 << 20))  # type: ignore[arg-type]
        self.left_over(parameters, f"integrator {kind!r}")

    # --- lights --------------------------------------------------------------------------------------------------

    def _placed(self, point: Any, default: tuple[float, float, float]) -> Rgb:
        at = np.asarray(default if point is None else point, np.float64)
        return rgb(product(self.transforms.current[0], np.append(at, 1.0))[:3])

    def _read_light(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        where = str(directive.place)
        scale = np.array(self.surfaces.color(parameters, "scale", (1.0, 1.0, 1.0)))
        name = "I" if kind in ("point", "spot", "projection", "goniometric") else "L"
        strength = rgb(scale * self.surfaces.color(parameters, name, (1.0, 1.0, 1.0)))
        if self.transforms.moves:
            self.report.add(where, "the motion of a light", "its place at the start")
        start = self._placed(parameters.numbers("from", 3), (0.0, 0.0, 0.0))
        if kind in ("point", "projection", "goniometric"):
            if kind != "point":
                parameters.asked.update(parameters.given)
                self.report.add(where, f"light {kind!r}", "a point light as bright in all directions")
            self.lights.append(PointLight(start, strength))
        elif kind == "spot":
            outer = parameters.number("coneangle", 30.0)
            inner = outer - parameters.number("conedeltaangle", 5.0)
            target = self._placed(parameters.numbers("to", 3), (0.0, 0.0, 1.0))
            self.lights.append(SpotLight(start, target, strength, max(inner, 0.0), outer, "quartic"))
        elif kind == "distant":
            target = self._placed(parameters.numbers("to", 3), (0.0, 0.0, 1.0))
            direction = np.subtract(target, start)
            if not norm(direction) > 0.0:
                raise SceneError(f"{where}: distant: expected from and to apart")
            self.lights.append(DirectionalLight(rgb(direction / norm(direction)), strength))
        elif kind in ("infinite", "exinfinite"):
            self.lights.append(self._environment(parameters, strength, where))
        else:
            parameters.asked.update(parameters.given)
            self.report.unknown(where, "light", kind)
        self._lose_hints(parameters)
        self.left_over(parameters, f"light {kind!r}")

    def _lose_hints(self, parameters: Parameters) -> None:
        """Reports what says how to sample a light, not how it shines."""
        for hint in ("samples", "nsamples", "importance"):
            if hint in parameters:
                parameters.number(hint, 1.0)
                self.report.add(str(parameters.place), f"{hint} of a light", "the renderer's own choice")

    def _environment(self, parameters: Parameters, strength: Rgb, where: str) -> EnvironmentLight:
        file = parameters.text("mapname", "")
        if not file:
            return EnvironmentLight(np.array([[list(strength)]], np.float32))
        path = self.files.path(file, where)
        return self._map(loading.read_image(path), strength, path)

    def _map(self, image: NDArray[np.float32], strength: Rgb, path: Path) -> EnvironmentLight:
        """An environment map under the current transform."""
        to_world = self.transforms.current[0].copy()
        to_world[:3, 3] = 0.0
        if strength[0] == strength[1] == strength[2]:
            return EnvironmentLight(image, product(to_world, MAP_AXES), strength[0], str(path))
        return EnvironmentLight(
            (image * np.array(strength)).astype(np.float32), product(to_world, MAP_AXES), 1.0, str(path)
        )

    def _read_area_light(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        if kind not in ("diffuse", "area"):
            self.report.unknown(directive.place, "area light", kind, "diffuse")
        scale = np.array(self.surfaces.color(parameters, "scale", (1.0, 1.0, 1.0)))
        self.attributes.emission = rgb(scale * self.surfaces.color(parameters, "L", (1.0, 1.0, 1.0)))
        if parameters.truth("twosided", False):
            self.report.add(str(directive.place), "an area light of two sides", "its front")
        self._lose_hints(parameters)
        self.left_over(parameters, "area light")

    # --- shapes --------------------------------------------------------------------------------------------------

    def _begin_object(self, directive: Directive) -> None:
        if self._object is not None:
            raise SceneError(f"{directive.place}: ObjectBegin: expected ObjectEnd first")
        self._begin("Object", directive)
        self._object = self.objects[word(directive)] = []

    def _end_object(self, directive: Directive) -> None:
        self._end("Object", directive)
        self._object = None

    def _place_object(self, directive: Directive) -> None:
        name = word(directive)
        if name not in self.objects or self._object is not None:
            raise SceneError(f"{directive.place}: ObjectInstance: expected an object made before, got {name!r}")
        start, track = self.transforms.current[0], self._motion(self.transforms.current, str(directive.place))
        for part in self.objects[name]:
            moved = track
            if part.track is not None and track is None:
                moved = moved_by(start, part.track)
            elif part.track is not None:
                self.report.add(str(directive.place), "a motion within a motion", "that of the instance")
            self._keep(dataclasses.replace(part, to_world=product(start, part.to_world), track=moved), directive)

    def _keep(self, instance: Instance, directive: Directive) -> None:
        if len(self.instances) >= _SHAPE_MAX:
            raise SceneError(f"{directive.place}: expected at most {_SHAPE_MAX:,} shapes")
        (self.instances if self._object is None else self._object).append(instance)

    def _motion(self, keys: Sequence[Matrix], where: str) -> RigidTrack | None:
        return motion(keys, self.transforms.times_s, where, self.report)

    def _read_shape(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        made = self.shapes.made(kind, parameters, self.attributes.reversed, self.beside)
        if made is None:
            return
        shape, local = made
        material: Material = self.attributes.material or _DEFAULT
        if parameters.types.get("alpha") == "texture":
            material = Masked(material, self.surfaces.texture(parameters, "alpha", grey(1.0)))
        elif parameters.number("alpha", 1.0) != 1.0:
            material = Masked(material, ConstantTexture(grey(parameters.number("alpha", 1.0))))
        if "shadowalpha" in parameters:
            parameters.asked.add("shadowalpha")
            self.report.add(str(directive.place), "shadowalpha of a shape", "its alpha")
        if isinstance(shape, Mesh):
            shape, local = shape_of(shape, material, str(directive.place), self.report)
        start, track = self.transforms.current[0], self._motion(self.transforms.current, str(directive.place))
        self._keep(
            Instance(shape, material, product(start, local), track, emission=self.attributes.emission),
            directive,
        )
        self.left_over(parameters, f"shape {kind!r}")


def load_pbrt(path: Path, root: Path | None = None, report: LossReport | None = None) -> Scene:
    """Reads a scene.

    Args:
        path: the file.
        root: folder that nothing is read outside of; by default the file's own.
        report: receives what could not be kept.

    Raises:
        SceneError: something cannot be read; file, line, column.
    """
    return scene_of(PbrtReader(SceneFiles(path, root), report or LossReport()), path)


def scene_of(reader: PbrtReader, path: Path) -> Scene:
    """Reads a file and makes a scene of it."""
    main = reader.files.folder / Path(path).name
    if not main.is_file():
        raise SceneError(f"{path}: expected a scene file, found none")
    reader.read(main)
    reader.finish()
    camera = reader.camera
    if camera is None:
        raise SceneError(f"{path}: expected a camera, found none")
    return Scene(
        camera,
        tuple(reader.instances),
        tuple(reader.lights),
        reader.film,
        reader.sampler,
        reader.integrator,
        materials=dict(reader.materials),
        name=Path(path).stem,
        duration_s=duration_s(camera, reader.instances),
    )


def duration_s(camera: Camera, instances: Sequence[Instance]) -> float:
    """When the last motion ends, seconds; 0 where nothing moves."""
    tracks = [getattr(camera, "track", None), *(instance.track for instance in instances)]
    return max((track_times(track)[-1] for track in tracks if track is not None), default=0.0)
