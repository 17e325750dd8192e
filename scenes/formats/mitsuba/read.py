"""Mitsuba 0.5 scenes into the canonical scene.

Source: Mitsuba 0.5 documentation; conventions measured with Mitsuba 3; Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from scenes.arithmetic import arctan, hypot, product, tan
from scenes.canonical import (
    Camera,
    EnvironmentCamera,
    Film,
    Instance,
    Integrator,
    Material,
    OrthographicCamera,
    PerspectiveCamera,
    Sampler,
    Scene,
    SceneError,
)
from scenes.formats.geometry.conventions import FAR, duration_s
from scenes.formats.geometry.transform_stack import motion
from scenes.formats.losses import SAME_PICTURE, LossReport
from scenes.formats.mitsuba.properties import Properties
from scenes.formats.mitsuba.read_lights import MitsubaLights
from scenes.formats.mitsuba.read_materials import MitsubaSurfaces
from scenes.formats.mitsuba.read_shapes import MitsubaShapes, seeing_all
from scenes.formats.mitsuba.read_textures import MISSING
from scenes.formats.text.scene_files import DEPTH_MAX, SceneFiles
from scenes.formats.text.xml_tree import Node, parse_xml

_FILE_SETTINGS = ("fileFormat", "pixelFormat", "gamma", "banner", "exposure", "componentFormat", "tonemapMethod",
                  "key", "burn")  # fmt: skip
TEXT_MAX = 1 << 16
"""Most characters of a value with its parameters."""

FORWARD = np.diag([-1.0, 1.0, -1.0, 1.0])
"""From a camera that looks along +z with x to the left to the canonical one."""

FILTERS = {"box": "box", "tent": "tent", "gaussian": "gaussian", "mitchell": "mitchell", "catmullrom": "mitchell",
           "lanczos": "sinc"}  # fmt: skip
_RADII = {"box": 0.5, "tent": 1.0, "gaussian": 2.0, "mitchell": 2.0, "sinc": 3.0}
SAMPLERS = {"independent": "independent", "stratified": "stratified", "sobol": "sobol", "ldsampler": "sobol",
            "halton": "halton", "hammersley": "hammersley"}  # fmt: skip
INTEGRATORS = {"path": "path", "volpath": "path", "volpath_simple": "path", "direct": "direct", "ao": "direct",
               "bdpt": "bidirectional", "mlt": "metropolis", "pssmlt": "metropolis", "erpt": "metropolis",
               "photonmapper": "photonmap", "ppm": "photonmap", "sppm": "photonmap", "ptracer": "path",
               "adaptive": "path", "irrcache": "path", "vpl": "path"}  # fmt: skip


class MitsubaReader:
    """State of a Mitsuba file while it is read."""

    def __init__(self, files: SceneFiles, report: LossReport) -> None:
        self.files, self.report = files, report
        self.names: dict[str, Node] = {}
        self.defaults: dict[str, str] = {}
        self._missing: dict[str, Node] = {}
        self.surfaces = MitsubaSurfaces(files, report, self.find)
        self.shapes = MitsubaShapes(files, report, self.surfaces, self.find)
        self.materials: dict[str, Material] = {}
        self.camera: Camera | None = None
        self.film, self.sampler, self.integrator = Film(768, 576), Sampler("independent", 4), Integrator("path", -1)
        self.instances: list[Instance] = []
        self.lights = MitsubaLights(files, report)

    # --- the tree ------------------------------------------------------------------------------------------------

    def read(self, path: Path) -> None:
        """Reads a file and what it includes."""
        nodes = self._nodes(path, [])
        for node in nodes:
            self._node(node)

    def _nodes(self, path: Path, inside: list[Path]) -> list[Node]:
        """Elements of the scene with those of included files; fills in parameters and notes names."""
        where = str(inside[-1]) if inside else str(path)
        if path in inside:
            raise SceneError(f"{where}: expected files that do not include themselves, {path.name} does")
        if len(inside) >= DEPTH_MAX:
            raise SceneError(f"{where}: expected at most {DEPTH_MAX} files inside each other")
        root = parse_xml(self.files.read(path, where), path.name)
        if root.tag != "scene":
            raise SceneError(f"{root.place}: expected a scene, got {root.tag!r}")
        version = root.get("version", "0.5.0")
        if not re.fullmatch(r"0(\.\d+)*", version):
            raise SceneError(f"{root.place}: expected a scene of Mitsuba 0.5 or before, got one of version {version!r}")
        found = []
        for node in root.children:
            if node.tag == "default":
                self.defaults.setdefault(node.get("name"), node.get("value"))
                continue
            self._filled(node)
            if node.tag == "include":
                found += self._nodes(self.files.path(node.get("filename"), str(node.place), path), [*inside, path])
            elif node.tag == "alias":
                self._named(node, node.get("id"))
                self.names[node.get("as")] = self.names[node.get("id")]
            else:
                found.append(node)
        return found

    def _filled(self, node: Node) -> None:
        """Replaces ``$name`` by the parameter, and notes elements with names."""
        for key, value in node.attributes.items():
            if "$" in value:
                node.attributes[key] = self._with_parameters(value, node)
        if node.tag == "spectrum" and "filename" in node.attributes:
            self._sample(node)
        if node.tag not in ("ref", "alias") and "id" in node.attributes:
            self.names[node.get("id")] = node
        for child in node.children:
            self._filled(child)

    def _with_parameters(self, text: str, node: Node) -> str:
        """A value with its parameters, wherever they stand in it; of two that fit the longer one is meant."""
        for name in sorted(self.defaults, key=len, reverse=True):
            text = text.replace(f"${name}", self.defaults[name])
            if len(text) > TEXT_MAX:
                raise SceneError(f"{node.place}: expected at most {TEXT_MAX:,} characters with parameters")
        if "$" in text:
            raise SceneError(f"{node.place}: expected a parameter with a default, got {text[:40]!r}")
        return text

    def _sample(self, node: Node) -> None:
        """Puts the samples of a spectrum's file in the place of its name; none where it is missing."""
        name, where = node.attributes.pop("filename"), str(node.place)
        path = self.files.known(name, where, self.report, f"the spectrum {name!r}", "the constant 0.5")
        if path is None:
            node.attributes["value"] = "0.5"
            return
        words = " ".join(line.split("#")[0] for line in self.files.text(path, where).splitlines()).split()
        if not words or len(words) % 2:
            raise SceneError(f"{path}: expected pairs of a wavelength and a value")
        node.attributes["value"] = ", ".join(f"{a}:{b}" for a, b in zip(words[::2], words[1::2], strict=True))

    def _named(self, node: Node, name: str) -> Node:
        if name not in self.names:
            raise SceneError(f"{node.place}: expected a name of something before it, got {name!r}")
        return self.names[name]

    def find(self, reference: Node) -> Node:
        """The element that a reference names; where nothing has the name, a grey one, which is reported."""
        name = reference.get("id")
        if name in self.names:
            return self.names[name]
        self.report.add(str(reference.place), f"{name!r}, which nothing is named before it", "grey")
        if name not in self._missing:
            tag = "texture" if reference.get("name") else "bsdf"
            self._missing[name] = Node(tag, {"type": MISSING if tag == "texture" else "diffuse"}, reference.place)
        return self._missing[name]

    def _node(self, node: Node) -> None:
        if node.tag == "integrator":
            self._integrator(node)
        elif node.tag in ("sensor", "camera"):
            self._sensor(node)
        elif node.tag == "bsdf":
            self.materials[node.get("id") or f"bsdf{len(self.materials)}"] = self.surfaces.material(node)
        elif node.tag == "texture":
            self.surfaces.made_texture(node)
        elif node.tag == "shape":
            self.instances += self.shapes.read(node)
        elif node.tag == "emitter":
            self.lights.read(node)
        elif node.tag in ("medium", "phase", "volume", "subsurface"):
            named = f" {node.get('id')!r}" if node.get("id") else ""
            self.report.add(str(node.place), f"{node.tag}{named} (participating medium)")
        elif node.tag in ("sampler", "film"):
            (self._sampler if node.tag == "sampler" else self._film)(node)
        else:
            self.report.unknown(node.place, "element", node.tag)

    # --- camera, film, sampling ----------------------------------------------------------------------------------

    def _integrator(self, node: Node) -> None:
        kind, properties = node.get("type"), Properties(node, self.report)
        name = self.report.kind(INTEGRATORS, kind, "integrator", node.place, kind not in SAME_PICTURE)
        edges = properties.whole("maxDepth", -1, -1, 1 << 20)
        for child in properties.rest:
            self.report.add(str(child.place), f"{child.tag} {child.get('type')!r} inside an integrator")
        # it counts the edges of a path, the canonical scene its bounces
        self.integrator = Integrator(name, -1 if edges < 0 else max(edges - 1, 0))  # type: ignore[arg-type]
        properties.left_over()

    def _film(self, node: Node) -> None:
        properties = Properties(node, self.report)
        size = properties.whole("width", 768, 1, 32768), properties.whole("height", 576, 1, 32768)
        name, radius = "gaussian", None
        for child in properties.rest:
            if child.tag == "rfilter":
                inner = Properties(child, self.report)
                name = self.report.kind(FILTERS, child.get("type"), "filter", child.place)
                radius = inner.number("radius", _RADII[name])
                inner.left_over()
        width = _RADII[name] if radius is None else radius
        self.film = Film(*size, name, width, properties.text("filename", ""))  # type: ignore[arg-type]
        for setting in _FILE_SETTINGS:
            if setting in properties:
                properties.asked.add(setting)
                self.report.hint(properties.where, f"{setting} of the film", "linear radiance")
        properties.left_over()

    def _sampler(self, node: Node) -> None:
        kind, properties = node.get("type"), Properties(node, self.report)
        name = self.report.kind(SAMPLERS, kind, "sampler", node.place, picture=False)
        self.sampler = Sampler(name, properties.whole("sampleCount", 4, 1, 1 << 24))  # type: ignore[arg-type]
        properties.left_over()

    def _sensor(self, node: Node) -> None:
        kind, properties = node.get("type"), Properties(node, self.report)
        for child in properties.rest:
            if child.tag in ("film", "sampler"):
                self._node(child)
        keys, times_s = properties.motion()
        to_world, track = product(keys[0], FORWARD), motion(keys, times_s, properties.where, self.report)
        for plane in ("nearClip", "farClip"):
            if plane in properties:
                properties.asked.add(plane)
                self.report.hint(properties.where, f"{plane} of the sensor", "nothing is cut")
        if self.camera is not None:
            self.report.add(properties.where, "another sensor", "the last one")
        shutter = properties.number("shutterOpen", 0.0), properties.number("shutterClose", 0.0)
        if kind in ("perspective", "thinlens"):
            lens = properties.number("apertureRadius", 0.0) if kind == "thinlens" else 0.0
            focus = properties.number("focusDistance", FAR)
            if not focus > 0.0:
                if lens > 0.0:
                    self.report.add(properties.where, f"a lens in focus at {focus:g}", "a pinhole")
                lens, focus = 0.0, FAR
            self.camera = PerspectiveCamera(to_world, self._field(properties), lens, focus, track, shutter)
        elif kind == "orthographic":
            self.camera = OrthographicCamera(to_world, track=track)
        elif kind == "spherical":
            self.camera = EnvironmentCamera(to_world)
        else:
            self.report.unknown(node.place, "sensor", kind, "perspective")
            self.camera = PerspectiveCamera(to_world, self._field(properties), 0.0, FAR, track, shutter)
        properties.left_over()

    def _field(self, properties: Properties) -> float:
        """Field of view of the shorter side, degrees."""
        width, height = self.film.width_px, self.film.height_px
        axis = properties.text("fovAxis", "x")
        sides = {"x": width, "y": height, "smaller": min(width, height), "larger": max(width, height),
                 "diagonal": hypot(width, height)}  # fmt: skip
        if axis not in sides:
            raise SceneError(f"{properties.where}: fovAxis: expected one of {', '.join(sides)}, got {axis!r}")
        if "fov" in properties or "focalLength" not in properties:
            fov = properties.number("fov", -1.0)
            if fov < 0.0 and "fov" not in properties:  # 50 mm on film of 36 x 24 mm
                fov, axis = 2.0 * math.degrees(arctan(hypot(36.0, 24.0) / 100.0)), "diagonal"
        else:
            text = properties.text("focalLength", "50mm").removesuffix("mm").strip()
            try:
                length = float(text)
            except ValueError:
                length = 0.0
            if not 0.1 <= length <= 1e5:
                raise SceneError(f"{properties.where}: focalLength: expected millimetres, got {text[:20]!r}")
            fov, axis = 2.0 * math.degrees(arctan(hypot(36.0, 24.0) / (2.0 * length))), "diagonal"
        if not 0.0 < fov < 180.0:
            raise SceneError(f"{properties.where}: fov: expected an angle in (0, 180), got {fov:g}")
        if sides[axis] == min(width, height):
            return fov
        return math.degrees(2.0 * arctan(tan(math.radians(fov) / 2.0) * min(width, height) / sides[axis]))


def load_mitsuba(path: Path, root: Path | None, report: LossReport) -> Scene:
    """Reads a scene; see :data:`scenes.formats.text.format.Read`.

    Raises:
        SceneError: something cannot be read; the message has file, line and column.
    """
    reader = MitsubaReader(SceneFiles(path, root), report)
    main = reader.files.folder / Path(path).name
    if not main.is_file():
        raise SceneError(f"{path}: expected a scene file, found none")
    reader.read(main)
    if reader.camera is None:
        report.add(str(path), "no sensor", "one that sees the shapes along z")
        reader.camera = seeing_all(reader.instances)
    parts = tuple(reader.instances), tuple(reader.lights.lights), reader.film, reader.sampler, reader.integrator
    lasts = duration_s(reader.camera, reader.instances)
    return Scene(reader.camera, *parts, materials=dict(reader.materials), name=Path(path).stem, duration_s=lasts)
