"""Writer of Mitsuba 0.5 files, or with the names and plugins of Mitsuba 3.

Source: Mitsuba 0.5 documentation; Mitsuba 3 documentation, plugin reference; Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field

import numpy as np

from scenes.arithmetic import determinant, product
from scenes.canonical import (
    Camera,
    Cube,
    Curves,
    Disk,
    EnvironmentCamera,
    Instance,
    Material,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    Rectangle,
    Scene,
    Sphere,
)
from scenes.canonical.values import Matrix
from scenes.formats.appearance.mixtures import direct_if_same, lets_through
from scenes.formats.geometry.conventions import FAR
from scenes.formats.geometry.meshed import as_mesh, depends_on_uv, of_radius_one
from scenes.formats.geometry.orientation import FLIPPED, scales_evenly, upright
from scenes.formats.geometry.placing import (
    PartKey,
    borders_media,
    has_outside,
    lose_shine_behind,
    motion_keys,
    part_key,
    radiance_of,
    shared_parts,
    shines,
)
from scenes.formats.losses import LossReport, first_of
from scenes.formats.mitsuba.read_settings import FILTERS, FORWARD
from scenes.formats.mitsuba.write_curves import MitsubaCurveWriter
from scenes.formats.mitsuba.write_elements import Element
from scenes.formats.text.numbers import number
from scenes.formats.text.output import Output
from scenes.formats.text.xml_tree import xml_text

_FILTERS = first_of(FILTERS)
_UNMOVED = np.eye(4)
_DEVIATIONS = 4.0  # that the radius of a Gaussian filter of Mitsuba 3 is wide
_SAMPLERS = {"independent": "independent", "stratified": "stratified", "sobol": "sobol", "halton": "halton",
             "hammersley": "hammersley"}  # fmt: skip
_INTEGRATORS = {"path": "path", "direct": "direct", "whitted": "direct", "bidirectional": "bdpt",
                "photonmap": "photonmapper", "metropolis": "pssmlt"}  # fmt: skip


@dataclass
class MitsubaWriter(MitsubaCurveWriter):
    """Collects the elements of a scene; ``modern`` selects Mitsuba 3."""

    shared: frozenset[PartKey] = frozenset()
    _groups: dict[PartKey, str] = field(default_factory=dict)
    _textured: dict[int, tuple[Material, bool]] = field(default_factory=dict)

    # --- the scene -----------------------------------------------------------------------------------------------

    def write(self, scene: Scene) -> None:
        """Writes a scene."""
        self.root.set("version", "3.0.0" if self.modern else "0.5.0")
        self.media(scene)
        self._integrator(scene)
        self._sensor(scene)
        one_sided = {id(one.material) for one in scene.instances if one.one_sided}
        for name, material in scene.materials.items():
            self.material(material, name, id(material) in one_sided)
        self.emitters([*scene.lights, *([scene.background] if scene.background is not None else [])])
        if scene.background is not None:
            self.report.add(scene.name or "scene", "a background that lights nothing", "one that lights")
        if scene.ambient != (0.0, 0.0, 0.0):
            self.report.add(scene.name or "scene", "constant ambient light")
        self.shared = shared_parts(scene, curves=not self.modern)  # whose radii are not scaled by transforms
        for instance in scene.instances:
            self._instance(instance)

    def _integrator(self, scene: Scene) -> None:
        scene = direct_if_same(scene)
        kind, depth = _INTEGRATORS[scene.integrator.kind], scene.integrator.depth
        if self.modern and kind in ("bdpt", "photonmapper", "pssmlt"):
            self.report.hint("integrator", scene.integrator.kind, "path")
            kind = "path"
        if scene.integrator.kind == "whitted":
            kind = "path"  # follows mirrors and glass
            self.report.add("integrator", "whitted", "path")
        if self._media and kind in ("path", "direct"):
            depth = min(depth, 1) if kind == "direct" and depth >= 0 else depth
            kind = "volpath"
        if kind == "path" and any(
            map(lets_through, {id(one.material): one.material for one in scene.instances}.values())
        ):
            kind = "volpath"  # whose light passes holes, which that of path does not
        made = self.plugin("integrator", kind, self.root)
        if kind != "direct":
            self.put(made, "integer", "maxDepth", str(depth if depth < 0 else depth + 1))
        elif depth != 1:
            self.report.add("integrator", f"a depth of {depth}", "direct light")

    def _sensor(self, scene: Scene) -> None:
        camera, film = scene.camera, scene.film
        made = self._camera(camera, film.width_px / min(film.width_px, film.height_px))
        self.around(made, scene.medium)
        self.root.append(made)
        kind = _SAMPLERS[scene.sampler.kind]
        if self.modern and kind in ("sobol", "halton", "hammersley"):
            self.report.hint("sampler", kind, "independent")
            kind = "independent"
        sampler = self.plugin("sampler", kind, made)
        self.put(sampler, "integer", "sampleCount", str(scene.sampler.samples_per_pixel))
        holder = self.plugin("film", "hdrfilm", made)
        self.put(holder, "integer", "width", str(film.width_px))
        self.put(holder, "integer", "height", str(film.height_px))
        rfilter = self.plugin("rfilter", _FILTERS[film.filter], holder)
        if self.modern:
            if film.filter == "tent":
                self.put(rfilter, "float", "radius", number(film.filter_radius_px))
            elif film.filter == "gaussian":
                self.put(rfilter, "float", "stddev", number(film.filter_radius_px / _DEVIATIONS))
            elif film.filter == "sinc" and film.filter_radius_px == int(film.filter_radius_px):
                self.put(rfilter, "integer", "lobes", str(int(film.filter_radius_px)))
            elif film.filter != "box" and (film.filter, film.filter_radius_px) != ("mitchell", 2.0):
                self.report.add("film", f"a filter of radius {film.filter_radius_px:g}", "the width it has by default")
        else:
            self.put(rfilter, "float", "radius", number(film.filter_radius_px))

    def _camera(self, camera: Camera, across: float) -> Element:
        """A camera with its placement; the picture is ``across`` shorter sides wide."""
        keys, times_s = motion_keys(getattr(camera, "track", None), camera.to_world)
        local = FORWARD
        if isinstance(camera, PerspectiveCamera):
            made = self.plugin("sensor", "thinlens" if camera.lens_radius > 0.0 else "perspective")
            self.put(made, "float", "fov", number(camera.fov_deg))
            self.put(made, "string", "fovAxis", "smaller")
            self._shift(made, camera)
            if camera.lens_radius > 0.0:
                self.put(made, "float", "apertureRadius", number(camera.lens_radius))
            if camera.lens_radius > 0.0 or (camera.focal_distance != FAR and not self.modern):
                self.put(made, "float", "focusDistance", number(camera.focal_distance))
            for name, value in zip(("shutterOpen", "shutterClose"), camera.shutter_s, strict=True):
                if camera.shutter_s != (0.0, 0.0):
                    self.put(made, "float", name, number(value))
        elif isinstance(camera, OrthographicCamera):
            made = self.plugin("sensor", "orthographic")
            half = camera.half_width * across
            local = product(FORWARD, np.diag([half, half, 1.0, 1.0]))
        else:
            made = self.plugin("sensor", "spherical" if isinstance(camera, EnvironmentCamera) else "perspective")
            if self.modern or not isinstance(camera, EnvironmentCamera):
                self.report.add("camera", type(camera).__name__, "one that the target may not have")
        self._placing(made, [product(key, local) for key in keys], times_s, "camera", True)
        return made

    def _shift(self, made: Element, camera: PerspectiveCamera) -> None:
        """Writes the offset of the principal point from the centre of the picture, to the right and down, with inverted
        sign."""
        if camera.shift == (0.0, 0.0):
            return
        if not self.modern or camera.lens_radius > 0.0:
            self.report.add("camera", "a picture off the viewing direction", "one about it")
            return
        for axis, offset in zip("XY", (camera.shift[0], -camera.shift[1]), strict=True):
            self.put(made, "float", f"principalPointOffset{axis}", number(offset))

    # --- shapes ------------------------------------------------------------------------------------------------------

    def _instance(self, instance: Instance) -> None:
        """Writes a shape with its placement; shared and moving shapes are instances of a group, because only these may
        move."""
        if self._as_triangles(instance):
            instance = of_radius_one(instance)
        keys, times_s = motion_keys(instance.track, instance.to_world)
        where, shared = instance.name or "shape", part_key(instance) in self.shared
        mirrored = determinant(instance.to_world) < 0.0
        alone = shines(instance) or (borders_media(instance) and mirrored)
        if alone or not (shared or (len(keys) > 1 and not self.modern)):
            made, local = self._shape(instance)
            self.root.append(made)
            self._placing(made, keys if local is _UNMOVED else [product(key, local) for key in keys], times_s, where)
            return
        key = part_key(instance)
        if key not in self._groups:
            made, local = self._shape(instance)
            label = self.label("group")
            self.plugin("shape", "shapegroup", self.root, id=label).append(made)
            self._placing(made, [local], [0.0], where)
            self._groups[key] = label
        made = self.plugin("shape", "instance", self.root)
        ElementTree.SubElement(made, "ref", {"id": self._groups[key]})
        self._placing(made, keys, times_s, where, True)

    def _placing(
        self, made: Element, keys: list[Matrix], times_s: list[float], where: str, may_move: bool = False
    ) -> None:
        """The transform of an element, or its animation."""
        if len(keys) > 1 and may_move and not self.modern:
            holder = ElementTree.SubElement(made, "animation", {"name": "toWorld"})
            for key, time_s in zip(keys, times_s, strict=True):
                step = ElementTree.SubElement(holder, "transform", {"time": repr(float(time_s))})
                values = " ".join(repr(float(value)) for value in key.ravel())
                ElementTree.SubElement(step, "matrix", {"value": values})
            return
        if len(keys) > 1:
            what = "the motion of the camera" if where == "camera" else "the motion of a shape"
            self.report.add(where, what, "its place at the start")
        if not (keys[0] == _UNMOVED).all():
            self.matrix(made, "toWorld", keys[0])

    def _depends_on_uv(self, material: Material) -> bool:
        if id(material) not in self._textured:
            self._textured[id(material)] = material, depends_on_uv(material)
        return self._textured[id(material)][1]

    def _as_triangles(self, instance: Instance) -> bool:
        """Whether a shape must be written as triangles, because of its texture coordinates or as a non-uniformly scaled
        sphere."""
        shape, textured = instance.shape, self._depends_on_uv(instance.material)
        if isinstance(shape, Curves):
            return textured or not self.has_curves(instance)
        if isinstance(shape, Cube | Disk):
            return textured
        if not isinstance(shape, Sphere):
            return False
        axes = instance.to_world[:3, :3]
        return not scales_evenly(axes) or (textured and determinant(axes) > 0.0)

    def _shape(self, instance: Instance) -> tuple[Element, Matrix]:
        """The element of a shape without its placement, and the transform of its own size."""
        shape, material = instance.shape, instance.material
        if self._as_triangles(instance):
            if isinstance(shape, Curves):
                self.report.add(instance.name or "shape", "curves", f"a mesh of {len(as_mesh(shape).faces)} triangles")
            elif isinstance(shape, Disk | Sphere):
                what = (
                    f"{'a textured' if self._depends_on_uv(material) else 'a stretched'} {type(shape).__name__.lower()}"
                )
                became = f"a mesh of {len(as_mesh(shape).faces)} triangles"
                self.report.add(instance.name or "shape", what, became)
            shape = as_mesh(shape)
        label, local = self.material(material, "", instance.one_sided), _UNMOVED
        mirrored = determinant(instance.to_world) < 0.0
        kinds: dict[type, str] = {Sphere: "sphere", Disk: "disk", Rectangle: "rectangle", Cube: "cube", Mesh: "ply"}
        curves = isinstance(shape, Curves)
        made = self.curves(instance) if curves else self.plugin("shape", kinds[type(shape)])
        if isinstance(shape, Mesh):
            if has_outside(instance) and mirrored:
                # lamps and media have their outside where the placed faces are counter-clockwise
                shape, local = upright(shape, instance.to_world)[0], FLIPPED
            self.put(made, "string", "filename", self.output.mesh(shape))
            if shape.normals is None:
                self.put(made, "boolean", "faceNormals", "true")
        elif isinstance(shape, Sphere):
            self.put(made, "float", "radius", number(shape.radius))
            local = FLIPPED if mirrored else local
        elif isinstance(shape, Cube):
            local = FLIPPED if has_outside(instance) and mirrored else local
        elif isinstance(shape, Disk):
            local = np.diag([shape.radius, shape.radius, 1.0, 1.0])
        ElementTree.SubElement(made, "ref", {"id": label})
        self.borders(made, instance)
        emission = radiance_of(instance)
        lose_shine_behind(instance, self.report)
        if emission is not None:
            self.color(self.plugin("emitter", "area", made), "radiance", emission)
        return made, local


def save_mitsuba(scene: Scene, output: Output, report: LossReport, modern: bool = False) -> None:
    """Writes a scene and its files; they are not in place before the output is placed."""
    writer = MitsubaWriter(output, report, modern)
    writer.write(scene)
    output.text(output.path.name, xml_text(writer.root))


def save_mitsuba3(scene: Scene, output: Output, report: LossReport) -> None:
    """The same for Mitsuba 3."""
    save_mitsuba(scene, output, report, modern=True)
