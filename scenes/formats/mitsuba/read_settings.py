"""Cameras, films, samplers and integrators of Mitsuba 0.5, converted to the canonical scene.

Source: Mitsuba 0.5 documentation, and ``orthographic.cpp`` of its source; conventions measured with Mitsuba 3;
Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import math

import numpy as np

from scenes.arithmetic import arctan, hypot, product, tan
from scenes.canonical import (
    Camera,
    EnvironmentCamera,
    Film,
    Instance,
    Integrator,
    Medium,
    OrthographicCamera,
    PerspectiveCamera,
    Sampler,
    SceneError,
)
from scenes.formats.geometry.conventions import FAR
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.geometry.transform_stack import motion
from scenes.formats.losses import SAME_PICTURE, LossReport
from scenes.formats.mitsuba.media import MitsubaMedia
from scenes.formats.mitsuba.properties import Properties
from scenes.formats.text.xml_tree import XmlNode

_FILE_SETTINGS = ("fileFormat", "pixelFormat", "gamma", "banner", "exposure", "componentFormat", "tonemapMethod",
                  "key", "burn", "sampleBorder", "compensate")  # fmt: skip
FORWARD = np.diag([-1.0, 1.0, -1.0, 1.0])
"""Transform from a camera that looks along +z with x to the left to the canonical one."""

FILTERS = {"box": "box", "tent": "tent", "gaussian": "gaussian", "mitchell": "mitchell", "catmullrom": "mitchell",
           "lanczos": "sinc"}  # fmt: skip
_RADII = {"box": 0.5, "tent": 1.0, "gaussian": 2.0, "mitchell": 2.0, "sinc": 3.0}
SAMPLERS = {"independent": "independent", "stratified": "stratified", "sobol": "sobol", "ldsampler": "sobol",
            "halton": "halton", "hammersley": "hammersley"}  # fmt: skip
INTEGRATORS = {"path": "path", "volpath_simple": "path", "direct": "direct", "ao": "direct",
               "bdpt": "bidirectional", "mlt": "metropolis", "pssmlt": "metropolis", "erpt": "metropolis",
               "photonmapper": "photonmap", "ppm": "photonmap", "sppm": "photonmap", "ptracer": "path",
               "adaptive": "path", "irrcache": "path", "vpl": "path"}  # fmt: skip


class MitsubaSettings:
    """Reader of cameras, films, samplers and integrators."""

    def __init__(self, report: LossReport) -> None:
        self.report = report
        self.media: MitsubaMedia
        self.camera: Camera | None = None
        self.medium: Medium | None = None
        self.drawn_by = "path"
        self.film, self.sampler, self.integrator = Film(768, 576), Sampler("independent", 4), Integrator("path", -1)

    def setting(self, node: XmlNode) -> None:
        """Reads a camera, film, sampler or integrator."""
        kinds = {"integrator": self._integrator, "film": self._film, "sampler": self._sampler}
        kinds.get(node.tag, self._sensor)(node)

    def _integrator(self, node: XmlNode) -> None:
        kind, properties = node.get("type"), Properties(node, self.report)
        self.drawn_by = kind
        if kind == "volpath":  # the same in scenes without holes, and written for those with such
            kind = "path"
        name = self.report.kind(INTEGRATORS, kind, "integrator", node.place, kind not in SAME_PICTURE)
        edges = properties.whole("maxDepth", -1, -1, 1 << 20)
        for child in properties.rest:
            self.report.add(str(child.place), f"{child.tag} {child.get('type')!r} inside an integrator")
        # Mitsuba counts the edges of a path, the canonical scene its bounces
        self.integrator = Integrator(name, -1 if edges < 0 else max(edges - 1, 0))  # type: ignore[arg-type]
        properties.left_over()

    def _film(self, node: XmlNode) -> None:
        properties = Properties(node, self.report)
        size = properties.whole("width", 768, 1, 32768), properties.whole("height", 576, 1, 32768)
        name, radius = "gaussian", None
        for child in properties.rest:
            if child.tag == "rfilter":
                inner = Properties(child, self.report)
                name = self.report.kind(FILTERS, child.get("type"), "filter", child.place)
                wide = 4.0 * inner.number("stddev", 0.5) if name == "gaussian" else _RADII[name]
                wide = inner.number("lobes", wide) if name == "sinc" else wide
                radius = inner.number("radius", wide)
                inner.left_over()
        width = _RADII[name] if radius is None else radius
        self.film = Film(*size, name, width, properties.text("filename", ""))  # type: ignore[arg-type]
        for setting in _FILE_SETTINGS:
            if setting in properties:
                properties.asked.add(setting)
                self.report.hint(properties.where, f"{setting} of the film", "linear radiance")
        properties.left_over()

    def _sampler(self, node: XmlNode) -> None:
        kind, properties = node.get("type"), Properties(node, self.report)
        name = self.report.kind(SAMPLERS, kind, "sampler", node.place, picture=False)
        self.sampler = Sampler(name, properties.whole("sampleCount", 4, 1, 1 << 24))  # type: ignore[arg-type]
        properties.left_over()

    def _sensor(self, node: XmlNode) -> None:
        kind, properties = node.get("type"), Properties(node, self.report)
        self.medium = None
        for child in properties.rest:
            node = self.media.find(child, True) if child.tag == "ref" else child
            if node.tag in ("film", "sampler"):
                self.setting(node)
            elif node.tag == "medium":
                properties.asked.add(child.get("name"))
                self.medium = self.media.read(node)
            else:
                self.report.unknown(node.place, f"{node.tag} inside a sensor", node.get("type"))
        keys, times_s = properties.motion()
        to_world, track = product(keys[0], FORWARD), motion(keys, times_s, properties.where, self.report)
        for plane in ("nearClip", "farClip"):
            if plane in properties:
                properties.asked.add(plane)
                self.report.hint(properties.where, f"{plane} of the sensor", "nothing is cut")
        if self.camera is not None:
            self.report.add(properties.where, "another sensor", "the last one")
        shutter = properties.number("shutterOpen", 0.0), properties.number("shutterClose", 0.0)
        right, down = (properties.number(f"principalPointOffset{axis}", 0.0) for axis in "XY")
        shift = (right, -down if down else 0.0)
        if kind in ("perspective", "thinlens"):
            lens = properties.number("apertureRadius", 0.0) if kind == "thinlens" else 0.0
            focus = properties.number("focusDistance", FAR)
            if not focus > 0.0:
                if lens > 0.0:
                    self.report.add(properties.where, f"a lens in focus at {focus:g}", "a pinhole")
                lens, focus = 0.0, FAR
            self.camera = PerspectiveCamera(to_world, self._field(properties), lens, focus, track, shutter, shift)
        elif kind == "orthographic":
            # its window is [-1, 1] horizontally for any aspect
            half = min(self.film.width_px, self.film.height_px) / self.film.width_px
            self.camera = OrthographicCamera(to_world, half, track)
            if shift != (0.0, 0.0):
                self.report.add(properties.where, "a parallel picture off the viewing direction", "one about it")
        elif kind == "spherical":
            self.camera = EnvironmentCamera(to_world)
        else:
            self.report.unknown(node.place, "sensor", kind, "perspective")
            self.camera = PerspectiveCamera(to_world, self._field(properties), 0.0, FAR, track, shutter)
        properties.left_over()

    def _field(self, properties: Properties) -> float:
        """Field of view along the shorter side, degrees."""
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


def seeing_all(instances: list[Instance]) -> PerspectiveCamera:
    """The camera of a scene without one: it looks along z with 45 degrees, at a distance equal to the width of the
    shapes."""
    corners = [
        product(as_mesh(one.shape).vertices.astype(np.float64), one.to_world[:3, :3].T) + one.to_world[:3, 3]
        for one in instances
    ]
    points = np.concatenate(corners) if corners else np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    low, high = points.min(axis=0), points.max(axis=0)
    away = float((high - low)[:2].max()) / (2.0 * tan(math.radians(22.5)))
    to_world = np.diag([-1.0, 1.0, -1.0, 1.0])
    to_world[:3, 3] = *(0.5 * (low + high))[:2], low[2] - max(away, 1e-3)
    return PerspectiveCamera(to_world, 45.0)
