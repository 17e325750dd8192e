"""Reader of scenes of directives: camera, lights, objects and shapes as far as PBRT and LuxRender share them.

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

from scenes.arithmetic import arctan, product, products, tan
from scenes.canonical import (
    Camera,
    ConstantTexture,
    EnvironmentCamera,
    Film,
    Instance,
    Integrator,
    Light,
    Masked,
    Matte,
    Medium,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    RealisticCamera,
    Rgb,
    RigidTrack,
    Sampler,
    Scene,
    SceneError,
)
from scenes.canonical.values import Matrix
from scenes.formats.appearance.graphs import check_depth
from scenes.formats.appearance.media import plain, settled
from scenes.formats.appearance.mixtures import is_nothing
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.directives.reader import DirectiveReader, typed, word
from scenes.formats.directives.shapes import UNMOVED, ShapeReader
from scenes.formats.directives.surfaces import SurfaceFactory
from scenes.formats.directives.syntax import Directive, Parameters, parameters_of
from scenes.formats.directives.window import ScreenWindow, fitted, window_of
from scenes.formats.geometry.conventions import FAR, duration_s, with_unit_axes
from scenes.formats.geometry.curves import joined
from scenes.formats.geometry.recognition import shape_of
from scenes.formats.geometry.transform_stack import inverse, motion, moved_by, translation

FORWARD = np.diag([1.0, 1.0, -1.0, 1.0])
"""Transform from a camera that looks along +z with x to the right to the canonical one, which looks along -z."""

FILTERS = {"box": "box", "triangle": "tent", "gaussian": "gaussian", "mitchell": "mitchell", "sinc": "sinc"}
_RADII = {"box": 0.5, "tent": 2.0, "gaussian": 2.0, "mitchell": 2.0, "sinc": 4.0}

_DEFAULT = Matte(ConstantTexture((0.5, 0.5, 0.5)))
_SHAPE_MAX = 1 << 20
"""Maximum number of instances of a scene, as nested object instances multiply."""


@dataclass
class SceneReader(DirectiveReader):
    """State of reading a scene; a dialect adds film, samplers, integrators and lights."""

    camera: Camera | None = None
    window: ScreenWindow | None = None
    film: Film = field(default_factory=Film)
    sampler: Sampler = field(default_factory=lambda: Sampler("halton", 16))
    integrator: Integrator = field(default_factory=lambda: Integrator("path", 5))
    instances: list[Instance] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    objects: dict[str, list[Instance]] = field(default_factory=dict)
    medium: Medium | None = None
    _object: list[Instance] | None = None

    def __post_init__(self) -> None:
        self.shapes = ShapeReader(self.files, self.report)
        self.surfaces = self.make_surfaces()

    def make_surfaces(self) -> SurfaceFactory:
        """The reader of the dialect's textures and materials."""
        raise NotImplementedError

    # --- directives ----------------------------------------------------------------------------------------------

    def dialect(self) -> dict[str, Callable[[Directive], None]]:
        return {
            "Camera": self._read_camera, "PixelFilter": self.read_filter, "Accelerator": lambda d: None,
            "WorldBegin": self._begin_world, "WorldEnd": lambda d: None,
            "Texture": self.read_texture, "Material": self._read_material,
            "MakeNamedMaterial": self._name_material, "NamedMaterial": self._take_material,
            "Shape": self.read_shape,
            "ObjectBegin": self._begin_object, "ObjectEnd": self._end_object, "ObjectInstance": self.place_object,
        }  # fmt: skip

    def as_drawn(self, scene: Scene) -> Scene:
        """The scene without what the integrator of the file does not draw."""
        return scene

    def _begin_world(self, directive: Directive) -> None:
        self.transforms.begin_world()

    def read_texture(self, directive: Directive) -> None:
        name, kind, wanted = word(directive), word(directive, 2), word(directive, 1)
        parameters, of = parameters_of(directive, 3), "float" if wanted == "float" else "color"
        if wanted not in ("float", "color", "spectrum"):
            self.report.unknown(directive.place, f"texture {name!r} of type", wanted, "one of colours")
        made = self.surfaces.made_texture(kind, parameters, of)
        check_depth(made, str(directive.place))
        self.names.define(self.names.textures(of), name, made)
        self.left_over(parameters, f"texture {name!r}")

    def _read_material(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        self.attributes.material = self.surfaces.material(kind, parameters)
        self.left_over(parameters, f"material {kind!r}")

    def _name_material(self, directive: Directive) -> None:
        name, parameters = typed(directive)
        made = self.surfaces.material(parameters.text("type", ""), parameters)
        check_depth(made, str(directive.place))
        self.names.define(self.names.materials, name, made)
        self.left_over(parameters, f"material {name!r}")

    def _take_material(self, directive: Directive) -> None:
        self.attributes.material = self.surfaces.named(word(directive), str(directive.place))

    # --- camera, film --------------------------------------------------------------------------------------------

    def _read_camera(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        self.medium = self.attributes.exterior
        keys = [inverse(matrix) for matrix in self.transforms.current]
        self.transforms.named["camera"] = keys
        track = self._motion(keys, str(directive.place))
        shutter = parameters.number("shutteropen", 0.0), parameters.number("shutterclose", 1.0)
        if not {"shutteropen", "shutterclose"} & set(parameters.given) and track is None:
            shutter = 0.0, 0.0  # the default of a still
        self.window = window = window_of(parameters, str(directive.place))
        placed = products(keys[0], FORWARD, window.mirror)
        if kind != "perspective" and {"shutteropen", "shutterclose"} & set(parameters.given):
            self.report.hint(str(directive.place), f"the shutter of a camera {kind!r}", "open for no time")
        if parameters.number("frameaspectratio", 0.0):
            self.report.add(str(directive.place), "frameaspectratio of the camera", "that of the film")
        if kind == "perspective":
            fov = self._field_of_view(parameters, window.half, directive)
            lens, focus = parameters.number("lensradius", 0.0), parameters.number("focaldistance", FAR)
            if not focus > 0.0:
                if lens > 0.0:
                    self.report.add(str(directive.place), f"a lens in focus at {focus:g}", "a pinhole")
                lens, focus = 0.0, FAR
            self.camera = PerspectiveCamera(placed, fov, lens, focus, track, shutter, window.shift)
        elif kind == "orthographic":
            self.camera = OrthographicCamera(product(placed, translation(*window.middle, 0.0)), window.half, track)
        elif kind == "environment":
            self.camera = EnvironmentCamera(placed)
        elif kind == "realistic":
            numbers = parameters.number("aperturediameter", 1.0), parameters.number("focusdistance", 10.0)
            self.camera = RealisticCamera(placed, parameters.text("lensfile", ""), *numbers)
        else:
            self.report.unknown(directive.place, "camera", kind, "perspective")
            self.camera = PerspectiveCamera(
                placed, self._field_of_view(parameters, window.half, directive), track=track
            )
        self.left_over(parameters, f"camera {kind!r}")

    def _field_of_view(self, parameters: Parameters, half: float, directive: Directive) -> float:
        """Full angle along the shorter side, degrees, of a window whose shorter side is twice ``half``."""
        fov = parameters.number("fov", 2.0 * parameters.number("halffov", 45.0))
        if not 0.0 < fov < 180.0:
            raise SceneError(f"{directive.place}: fov: expected an angle in (0, 180), got {fov:g}")
        return math.degrees(2.0 * arctan(tan(math.radians(fov) / 2.0) * half)) if half != 1.0 else fov

    def read_size(self, parameters: Parameters, width_px: int, height_px: int) -> None:
        """Reads the size of the picture, with the given default, and its file name; the filter is kept."""
        size = [parameters.whole(f"{axis}resolution", px, 1, 32768) for axis, px in (("x", width_px), ("y", height_px))]
        name = parameters.text("filename", "")
        self.film = dataclasses.replace(self.film, width_px=size[0], height_px=size[1], filename=name)

    def read_filter(self, directive: Directive) -> None:
        """Reads a pixel filter."""
        kind, parameters = typed(directive)
        name = self.report.kind(FILTERS, kind, "filter", directive.place)
        radius = parameters.number("xwidth", _RADII[name])
        if parameters.number("ywidth", radius) != radius:
            self.report.add(str(directive.place), "ywidth of the filter", "as wide as across")
        self.film = dataclasses.replace(self.film, filter=name, filter_radius_px=radius)
        self.left_over(parameters, f"filter {kind!r}")

    def placed(self, point: Any, default: tuple[float, float, float]) -> Rgb:
        at = np.asarray(default if point is None else point, np.float64)
        return rgb(product(self.transforms.current[0], np.append(at, 1.0))[:3])

    # --- shapes --------------------------------------------------------------------------------------------------

    def _begin_object(self, directive: Directive) -> None:
        if self._object is not None:
            raise SceneError(f"{directive.place}: ObjectBegin: expected ObjectEnd first")
        self._begin("Object", directive)
        self._object = self.objects[word(directive)] = []

    def _end_object(self, directive: Directive) -> None:
        self._end("Object", directive)
        if self._object:
            self._object[:] = joined(self._object)
        self._object = None

    def place_object(self, directive: Directive) -> None:
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

    def drawn(self, medium: Medium | None) -> Medium | None:
        """The medium of a side as it is drawn, None for none."""
        return None if medium is None else plain(medium)

    def sides(self) -> tuple[Medium | None, Medium | None]:
        """The media inside and outside of the following shapes."""
        return self.drawn(self.attributes.interior), self.drawn(self.attributes.exterior)

    def read_shape(self, directive: Directive) -> None:
        kind, parameters = typed(directive)
        made = self.shapes.made(kind, parameters, self.attributes.reversed, self.beside)
        if made is None:
            return
        shape, local = made
        material = self.attributes.material or _DEFAULT
        if parameters.types.get("alpha") == "texture":
            material = Masked(material, self.surfaces.texture(parameters, "alpha", grey(1.0), "float"))
        elif parameters.number("alpha", 1.0) != 1.0:
            material = Masked(material, ConstantTexture(grey(parameters.number("alpha", 1.0))))
        if "shadowalpha" in parameters:
            parameters.asked.add("shadowalpha")
            self.report.add(str(directive.place), "shadowalpha of a shape", "its alpha")
        interior, exterior = self.sides()
        if is_nothing(material) and self.attributes.emission is None and interior is None and exterior is None:
            self.report.hint(str(directive.place), "the border of a medium, which is invisible")
            self.left_over(parameters, f"shape {kind!r}")
            return
        if isinstance(shape, Mesh):
            shape, found = shape_of(shape, material, str(directive.place), self.report)
            local = found if local is UNMOVED else product(local, found)
        start, track = self.transforms.current[0], self._motion(self.transforms.current, str(directive.place))
        self._keep(
            Instance(
                shape,
                material,
                start if local is UNMOVED else product(start, local),
                track,
                emission=self.attributes.emission,
                emission_twosided=self.attributes.emission is not None and self.attributes.emission_twosided,
                interior=interior,
                exterior=exterior,
            ),
            directive,
        )
        self.left_over(parameters, f"shape {kind!r}")


def scene_of(reader: SceneReader, path: Path) -> Scene:
    """Reads a file and returns its scene."""
    main = reader.files.folder / Path(path).name
    if not main.is_file():
        raise SceneError(f"{path}: expected a scene file, found none")
    reader.read(main)
    reader.finish()
    camera = reader.camera
    if camera is None:
        reader.report.add(str(path), "no camera", "one of 90 degrees along z")
        camera = PerspectiveCamera(FORWARD, 90.0)
    elif reader.window is not None:
        camera = fitted(camera, reader.window, reader.film, reader.report)
        camera = with_unit_axes(camera, reader.window.where, reader.report)
    parts = tuple(joined(reader.instances)), tuple(reader.lights), reader.film, reader.sampler, reader.integrator
    lasts, materials = duration_s(camera, reader.instances), dict(reader.names.materials)
    medium, name = reader.drawn(reader.medium), Path(path).stem
    scene = Scene(camera, *parts, medium=medium, materials=materials, name=name, duration_s=lasts)
    return reader.as_drawn(settled(scene, reader.report))
