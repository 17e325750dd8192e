"""Shapes of Mitsuba 0.5, converted to instances of the canonical scene.

Source: Mitsuba 0.5 documentation, section on shapes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from scenes.arithmetic import determinant, norm, product
from scenes.canonical import (
    ConstantTexture,
    Cube,
    Curves,
    Disk,
    Glass,
    Instance,
    Material,
    Matte,
    Medium,
    Rectangle,
    Rgb,
    SceneError,
    Shape,
    Sphere,
)
from scenes.canonical.values import Matrix
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.mixtures import BLACK, NOTHING, is_nothing
from scenes.formats.appearance.spectra import grey
from scenes.formats.geometry import revolution
from scenes.formats.geometry.meshed import as_mesh, depends_on_uv, mitsuba_cube, mitsuba_disk, turned_over
from scenes.formats.geometry.orientation import FLIPPED, scales_evenly
from scenes.formats.geometry.recognition import shape_of
from scenes.formats.geometry.transform_stack import motion, moved_by, translation
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.curves import curves_of, sized
from scenes.formats.mitsuba.media import MitsubaMedia
from scenes.formats.mitsuba.meshes import MitsubaMeshes
from scenes.formats.mitsuba.properties import Properties
from scenes.formats.mitsuba.read_materials import MitsubaSurfaces
from scenes.formats.text.scene_files import SceneFiles
from scenes.formats.text.xml_tree import XmlNode

_SHAPES = ("sphere", "rectangle", "cube", "disk", "cylinder", "obj", "ply", "serialized", "bsplinecurve", "linearcurve",
           "hair")  # fmt: skip
_CURVES = {"bsplinecurve": "bspline", "linearcurve": "linear", "hair": "linear"}
_LEFT_OUT = ("heightfield", "deformable", "sdfgrid", "ellipsoids", "ellipsoidsmesh")
_DEFAULT = Matte(ConstantTexture(grey(0.5)))


class MitsubaShapes:
    """Creates instances from elements; each mesh file is read once."""

    def __init__(
        self,
        files: SceneFiles,
        report: LossReport,
        surfaces: MitsubaSurfaces,
        media: MitsubaMedia,
        find: Callable[[XmlNode], XmlNode],
    ) -> None:
        self.files, self.report, self.surfaces, self.media, self.find = files, report, surfaces, media, find
        self.groups: dict[int, list[Instance]] = {}
        self.modern = False
        self.meshes = MitsubaMeshes(files, report)
        self._read_curves: dict[tuple, Curves] = {}

    def read(self, node: XmlNode) -> list[Instance]:
        """Instances of a shape: one, those of a group, or none if it is left out, which is reported."""
        kind, properties = node.get("type"), Properties(node, self.report)
        if kind == "shapegroup":
            parts = []
            for part in (child for child in properties.rest if child.tag == "shape"):
                if part.get("type") in ("instance", "shapegroup"):  # as in Mitsuba; nested groups would multiply
                    self.report.add(str(part.place), f"{part.get('type')} inside a shapegroup")
                else:
                    parts.append(part)
            self.groups[id(node)] = [found for part in parts for found in self.read(part)]
            return []
        if kind == "merge":
            inside = [child for child in properties.rest if child.tag == "shape" and child.get("type") != "merge"]
            return [found for part in inside for found in self.read(part)]
        if kind == "instance":
            return self._instances(properties)
        if kind in _LEFT_OUT:
            self.report.add(properties.where, f"shape {kind!r}")
            return []
        if kind not in _SHAPES:
            self.report.unknown(properties.where, "shape", kind)
            return []
        keys, times_s = properties.motion()
        track = motion(keys, times_s, properties.where, self.report)
        used = self._materials_of(properties) if kind == "obj" else []
        surfaces, emission = self._inside(properties, used)
        sides = self._sides(properties)
        found = []
        for name, (material, one_sided) in surfaces.items():
            if is_nothing(material) and emission is None and sides == (None, None):
                self.report.hint(properties.where, "the border of a medium, which is invisible")
                continue
            faces = {name} if name is not None else set(used) - set(surfaces)
            made = self._made(kind, properties, material, faces if len(surfaces) > 1 else None, keys[0])
            if made is None:
                return []
            shape, local, kept = made
            if isinstance(shape, Curves):
                shape, keys = sized(shape, keys)
            turn_over, place = properties.truth("flipNormals", False), product(keys[0], local)
            if kind == "sphere" and not scales_evenly(keys[0][:3, :3]):
                self.report.add(
                    properties.where, "a sphere that a transform stretches", "stretched; Mitsuba's is round"
                )
            inside, outside = sides
            if self.modern and kept and determinant(keys[0]) < 0.0:  # as measured with Mitsuba 3.9
                has_sides = turn_over or emission is not None or one_sided or isinstance(material, Glass)
                if isinstance(shape, Sphere) and has_sides:
                    turn_over = not turn_over
                else:
                    inside, outside = outside, inside
            made = Instance(shape, material, place, track, node.get("id"), emission, one_sided)
            if turn_over:
                made = turned_over(made)
                if isinstance(shape, Sphere):
                    became = f"a mesh of {len(as_mesh(made.shape).faces)} triangles"
                    self.report.add(properties.where, "a sphere inside out", became)
            found.append(dataclasses.replace(made, interior=inside, exterior=outside))
        if found:
            properties.left_over()
        return found

    def _instances(self, properties: Properties) -> list[Instance]:
        keys, times_s = properties.motion()
        track = motion(keys, times_s, properties.where, self.report)
        for child in properties.rest:
            group = self.find(child) if child.tag == "ref" else child
            if id(group) in self.groups:
                properties.left_over()
                parts = self.groups[id(group)]
                if track is not None and any(part.track is not None for part in parts):
                    self.report.add(properties.where, "a motion within a motion", "that of the instance")
                return [
                    dataclasses.replace(
                        part,
                        to_world=product(keys[0], part.to_world),
                        track=moved_by(keys[0], part.track) if track is None and part.track is not None else track,
                    )
                    for part in parts
                ]
        raise SceneError(f"{properties.where}: instance: expected a reference to a shapegroup before it")

    def _materials_of(self, properties: Properties) -> list[str]:
        """Material names used by the faces of an OBJ file, for Mitsuba 0.5; in Mitsuba 3 a shape has one material.

        Source: Mitsuba 0.5 documentation, section on the shape ``obj``: a named bsdf applies to the faces that use a
        material of this name.
        """
        if self.modern or not any(child.tag in ("bsdf", "ref") and child.get("name") for child in properties.rest):
            return []
        return self.meshes.materials_of(properties)

    def _inside(
        self, properties: Properties, used: list[str]
    ) -> tuple[dict[str | None, tuple[Material, bool]], Rgb | None]:
        """Materials of a shape, each with whether its back is black, and its emission.

        The key None has the material of all faces without a named one; without any, a lamp is black, a shape of Mitsuba
        0.5 with only a medium invisible, and others are grey.
        """
        named: dict[str | None, tuple[Material, bool]] = {}
        material, emission, one_sided, default = None, None, True, _DEFAULT
        by_name = any(name and name in used for name in (child.get("name") for child in properties.rest))
        for child in properties.rest:
            node = self.find(child) if child.tag == "ref" else child
            properties.asked.add(child.get("name"))
            name = child.get("name")
            if node.tag == "bsdf" and name and name in used:
                named[name] = self.surfaces.material(node), self.surfaces.one_sided(node)
            elif node.tag == "bsdf" and name and by_name:
                self.report.hint(str(node.place), f"the material {name!r} of a mesh, which no face uses")
            elif node.tag == "bsdf":
                named.clear()  # it applies to all faces
                if material is not None:
                    self.report.add(str(node.place), "several materials for one mesh", "the last")
                material, one_sided = self.surfaces.material(node), self.surfaces.one_sided(node)
            elif node.tag == "emitter" and node.get("type") == "area":
                inner = Properties(node, self.report)
                radiance = self.surfaces.texture(inner, "radiance", grey(1.0))
                emission = mean_of(radiance)
                if not isinstance(radiance, ConstantTexture):
                    self.report.add(inner.where, "a lamp with a texture", "its mean")
                if "samplingWeight" in inner:
                    self.report.hint(inner.where, "samplingWeight of a light", "the renderer's own choice")
                    inner.asked.add("samplingWeight")
                inner.left_over()
            elif node.tag == "medium":
                default = default if self.modern else NOTHING
            elif node.tag == "subsurface":
                self.report.add(str(node.place), f"{node.tag} (participating medium)")
            elif node.tag not in ("texture",):
                raise SceneError(f"{node.place}: expected a part of a shape, got {node.tag!r}")
        if len(named) < len(used) or not named:
            named[None] = material or (BLACK if emission is not None and default is _DEFAULT else default), one_sided
        return named, emission

    def _sides(self, properties: Properties) -> tuple[Medium | None, Medium | None]:
        """The media inside and outside of a shape."""
        found: dict[str, Medium | None] = {}
        for child in properties.rest:
            node = self.find(child) if child.tag == "ref" else child
            if node.tag == "medium":
                if child.get("name") not in ("interior", "exterior"):
                    self.report.unknown(child.place, "medium of a shape", child.get("name"))
                found[child.get("name")] = self.media.read(node)
        return found.get("interior"), found.get("exterior")

    def _made(
        self, kind: str, properties: Properties, material: Material, faces: set[str] | None, to_world: Matrix
    ) -> tuple[Shape, Matrix, bool] | None:
        """The shape, its place in the shape's space, and whether a reflection leaves its outside where it is."""
        where, place = properties.where, np.eye(4)
        if kind == "sphere":
            radius = properties.number("radius", 1.0)
            if not radius > 0.0:
                raise SceneError(f"{where}: radius: expected a positive number, got {radius:g}")
            place = translation(*properties.vector("center", grey(0.0)).tolist())
            return Sphere(radius), product(place, FLIPPED) if depends_on_uv(material) else place, True
        if kind in ("rectangle", "cube", "disk"):
            shapes = {"rectangle": Rectangle(), "cube": Cube(), "disk": Disk()}
            if not depends_on_uv(material) or kind == "rectangle":
                return shapes[kind], place, kind == "cube"
            mesh = mitsuba_cube() if kind == "cube" else mitsuba_disk()
            if kind == "disk":
                self.report.add(where, "a textured disk", f"a mesh of {len(mesh.faces)} triangles")
            return mesh, place, kind == "cube"
        if kind == "cylinder":
            return self._cylinder(properties)
        if kind in _CURVES:
            found = curves_of(properties, _CURVES[kind], self.files, self._read_curves)
            return None if found is None else (found, place, True)
        found = self.meshes.placed(kind, properties, faces, to_world, material is _DEFAULT, self.modern)
        return None if found is None else (*shape_of(found[0], material, where, self.report), found[1])

    def _cylinder(self, properties: Properties) -> tuple[Shape, Matrix, bool]:
        first, last = properties.vector("p0", grey(0.0)), properties.vector("p1", (0.0, 0.0, 1.0))
        radius, length = properties.number("radius", 1.0), norm(last - first)
        if not (radius > 0.0 and length > 0.0):
            raise SceneError(f"{properties.where}: cylinder: expected a radius and two ends apart")
        axis = (last - first) / length
        side = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
        side /= norm(side)
        place = np.eye(4)
        place[:3] = np.stack([side, np.cross(axis, side), axis, first], axis=1)
        mesh = revolution.cylinder(radius, 0.0, length)
        self.report.add(properties.where, "shape 'cylinder'", f"a mesh of {len(mesh.faces)} triangles")
        return mesh, place, True
