"""Reader of LuxCore's scenes: properties of a scene (``.scn``), and configurations that name one (``.cfg``).

LuxCore's parser of LuxRender 1.x files translates them to these properties. The reader goes the other way: each part
becomes the directive of LuxRender from which LuxCore makes it, so that both formats share their meaning.

Source: LuxCore SDK reference manual (wiki of LuxCoreRender); properties, defaults and order as in LuxCore 2.10, where
textures, materials and volumes can be named by later ones only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from scenes.arithmetic import product
from scenes.canonical import ConstantTexture, Medium, Mesh, Scene, SceneError
from scenes.canonical.values import Matrix
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.directives.reader import checked
from scenes.formats.directives.scene_reader import scene_of
from scenes.formats.directives.syntax import Directive, Parameters, Values, parameters_of
from scenes.formats.geometry.transform_stack import translation
from scenes.formats.losses import LossReport
from scenes.formats.luxcore.defaults import drop_meaningless
from scenes.formats.luxcore.directives import directive, numbers, parameters, texts
from scenes.formats.luxcore.files import LuxCoreFiles
from scenes.formats.luxcore.lights import color_unit, light_values, lumens_of
from scenes.formats.luxcore.materials import material_values, texture_values, volume_values
from scenes.formats.luxcore.settings import settings
from scenes.formats.luxcore.surfaces import LuxCoreSurfaces
from scenes.formats.luxcore.syntax import Block, Property, parsed_properties, parts_of
from scenes.formats.luxrender.read import LUMINANCE, LuxReader
from scenes.formats.text.places import TextPosition

_PARTS = ("textures", "volumes", "materials", "shapes", "objects", "lights")
"""Parts of a scene in the order in which they refer to each other."""

_EMISSION = ("", ".gain", ".power", ".efficency", ".efficiency", ".normalizebycolor")
_SHAPES = {"ply": "filename", "vertices": "P", "faces": "indices", "normals": "N", "uvs": "uv"}


@dataclass
class LuxCoreReader(LuxReader):
    """State of reading a LuxCore scene.

    Attributes:
        lamps: properties of the emission of materials by their names.
        borders: names of the volumes inside and outside of the surfaces of materials, each with its place.
        shapes_of: named shapes, in properties.
    """

    lamps: dict[str, Block] = field(default_factory=dict)
    borders: dict[str, Block] = field(default_factory=dict)
    shapes_of: dict[str, Block] = field(default_factory=dict)
    _shapes_used: set[str] = field(default_factory=set)
    _inlined: dict[int, tuple[Values, Mesh]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.names.floats = self.names.colors  # textures have no types
        self.shapes.more = {"inlinedmesh": self._shared_mesh}

    def make_surfaces(self) -> LuxCoreSurfaces:
        return LuxCoreSurfaces(self.files, self.report, self.names)

    def read(self, path: Path) -> None:
        """Reads a file, and the scene that it names."""
        self._file, main = path, parsed_properties(self.files.text(path, str(path)), path.name)
        found = main
        if "scene.file" in main:
            named = main.pop("scene.file")
            self._file = self.files.path(named.word(), str(named.place), path)
            if self._file == path.resolve():
                raise SceneError(f"{named.place}: scene.file: expected another file, got this one")
            text = self.files.text(self._file, str(named.place))
            found = parsed_properties(text, self._file.name)
            if "scene.file" in found:
                raise SceneError(f"{found['scene.file'].place}: scene.file: expected a scene, got a configuration")
            found = {**main, **found}
        elif path.suffix.lower() == ".cfg" and not any(key.startswith("scene.") for key in main):
            raise SceneError(f"{path}: expected a configuration of LuxCore with a property scene.file, found none")
        if not found:
            raise SceneError(f"{path}: expected properties of LuxCore, such as scene.camera.type = perspective")
        self._read_properties(found)

    def _read_properties(self, found: Block) -> None:
        first, file = next(iter(found.values())), self.beside
        parts = {part: parts_of(found, f"scene.{part}.") for part in _PARTS}
        camera = {rest: found.pop(f"scene.camera.{rest}") for rest in
                  [key[13:] for key in found if key.startswith("scene.camera.")]}  # fmt: skip
        world = found.pop("scene.world.volume.default", None)
        for one in settings(found, first, file, self.report):
            self._do(one)
        for name, block in parts["textures"].items():
            self._read_block(name, block, self._texture_block)
        for name, block in parts["volumes"].items():
            self._read_block(name, block, self._volume_block)
        around = self._volume_named(camera.pop("volume", world))
        self._camera(camera, around, first.place)
        self.attributes.exterior = self._volume_named(world)
        for name, block in parts["materials"].items():
            self._read_block(name, block, self._material_block)
        self.shapes_of = parts["shapes"]
        for name, block in parts["objects"].items():
            self._read_block(name, block, self._object_block)
        for block in (block for name, block in self.shapes_of.items() if name not in self._shapes_used):
            for left in block.values():
                self.report.hint(str(left.place), f"property {left.key!r} of a shape that no object has")
        for name, block in parts["lights"].items():
            self._read_block(name, block, self._light_block)
        for key, left in found.items():
            self.report.add(str(left.place), f"property {key!r}")

    def _read_block(self, name: str, block: Block, read: Callable[[str, Block, TextPosition], None]) -> None:
        place = next(iter(block.values())).place
        drop_meaningless(block, self.report)
        for rest in [rest for rest in block if len(rest.split()) != 1]:
            left = block.pop(rest)
            self.report.add(str(left.place), f"property {left.key!r}")
        read(name, block, place)

    def _lost(self, block: Block, *names: str) -> None:
        """Reports properties that are not supported, and takes them out."""
        for rest in [rest for rest in block if rest in names or rest.startswith(tuple(f"{one}." for one in names))]:
            left = block.pop(rest)
            self.report.add(str(left.place), f"property {left.key!r}")

    def _direct(self, name: str, words: tuple[str, ...], values: list[Values], place: TextPosition) -> None:
        """Reads a part as a directive; properties with LuxRender's names for LuxCore's are reported."""
        given = [head[0].split()[1] for head in values[::2]]  # type: ignore[union-attr]
        for again in sorted({one for one in given if given.count(one) > 1}):
            self.report.add(str(place), f"{name} {words[0]!r}: property {again!r}, which has another name here")
        self._do(directive(name, words, values, place, self.beside))

    # --- textures, volumes, materials ----------------------------------------------------------------------------

    def _texture_block(self, name: str, block: Block, place: TextPosition) -> None:
        kind = block.pop("type").word() if "type" in block else "imagemap"
        of, made, values = texture_values(kind, block, self.names.colors, self.report)
        if made == "const":
            given = parameters_of(directive("Texture", (), values, place, self.beside), 0)
            index = self.surfaces.color(given, "n", grey(0.5)), self.surfaces.color(given, "k", grey(0.5))
            self.names.define(self.names.indices, name, index)
            self.left_over(given, f"texture {name!r}")
            return
        self._direct("Texture", (name, of, made), values, place)

    def _volume_block(self, name: str, block: Block, place: TextPosition) -> None:
        kind = block.pop("type").word() if "type" in block else "homogeneous"
        several = block.pop("multiscattering", None)
        values = volume_values(kind, block, self.names.colors, self.report)
        before, self._scatters = self._scatters, False
        self._direct("MakeNamedVolume", (name, kind), values, place)
        single = several is None or several.word() in ("0", "false")
        if self._scatters and single:
            self.report.add(str(place), "a volume that scatters light once", "any number of times")
        self._scatters, self._integrator = before or self._scatters, "multi"

    def _volume_named(self, found: Property | None) -> Medium | None:
        if found is None:
            return None
        return self._named(directive("Interior", (found.word(),), [], found.place, self.beside))

    def _material_block(self, name: str, block: Block, place: TextPosition) -> None:
        self.lamps[name] = {rest: block.pop(f"emission{rest}") for rest in _EMISSION if f"emission{rest}" in block}
        self.borders[name] = {side: block.pop(f"volume.{side}") for side in ("interior", "exterior")
                              if f"volume.{side}" in block}  # fmt: skip
        values = material_values(name, block, self.names, self.report)
        self._direct("MakeNamedMaterial", (name,), values, place)

    # --- camera, objects, lights ---------------------------------------------------------------------------------

    def _camera(self, block: Block, around: Medium | None, place: TextPosition) -> None:
        place = next(iter(block.values())).place if block else place
        drop_meaningless(block, self.report)
        kind = block.pop("type").word() if "type" in block else "perspective"
        self._lost(block, "clippingplane", "cliphither", "clipyon", "hither", "yon", "autofocus", "bokeh", "motion")
        ends: list[float] = []
        for rest, default in (("lookat.orig", (0, 10, 0)), ("lookat.target", (0, 0, 0)), ("up", (0, 0, 0.1))):
            ends += block.pop(rest).numbers(3).tolist() if rest in block else default
        self._place(np.eye(4))
        self._do(Directive("LookAt", (np.array(ends, np.float64),), place, self.beside))
        if kind != "perspective":  # without a meaning
            block.pop("fieldofview", None)
        values = parameters(block, ())
        for name, rest, value in (("fov", "fieldofview", 45.0), ("focaldistance", "focaldistance", 10.0)):
            values += numbers(name, value) if rest not in block and kind == "perspective" else []
        if "screenwindow" not in block:  # the longer side is from -1 to 1; in LuxRender the shorter one is
            size_px = np.array([self.film.width_px, self.film.height_px])
            wide, high = (size_px / size_px.max()).tolist()
            values += numbers("screenwindow", -wide, wide, -high, high)
        self.attributes.exterior = around
        self._direct("Camera", (kind,), values, place)
        self._direct("WorldBegin", (), [], place)

    def _place(self, matrix: Matrix) -> None:
        self.transforms.replace(matrix)

    def _matrix(self, block: Block, name: str) -> Matrix:
        """A transform, column by column."""
        found = block.pop(name, None)
        if found is None:
            return np.eye(4)
        made = found.numbers(16).reshape(4, 4).T.copy()
        return checked(Directive(found.key, (), found.place, self.beside), made)

    def _object_block(self, name: str, block: Block, place: TextPosition) -> None:
        pose = self._matrix(block, "transformation")
        if "shape" in block:
            wanted = block.pop("shape")
            shape = dict(self.shapes_of.get(wanted.word(), {}))
            self._shapes_used.add(wanted.word())
            if not shape:
                self.report.add(str(wanted.place), f"the shape {wanted.word()!r}, which is not defined")
                return
        else:
            shape = {rest: block.pop(rest) for rest in (*_SHAPES, "appliedtransformation") if rest in block}
        drop_meaningless(shape, self.report)
        self._lost(block, "motion")
        self._place(product(pose, self._matrix(shape, "appliedtransformation")))
        material = block.pop("material", None)
        if material is None:
            raise SceneError(f"{place}: scene.objects.{name}: expected a property material, found none")
        self._do(directive("NamedMaterial", (material.word(),), [], material.place, self.beside))
        around = self.attributes.exterior
        self._light_up(material.word())
        for side, found in self.borders.get(material.word(), {}).items():
            setattr(self.attributes, side, self._volume_named(found))
        self._shape(shape, block, place)
        self.attributes.interior, self.attributes.exterior = None, around

    def _shape(self, shape: Block, rest: Block, place: TextPosition) -> None:
        kind = shape.pop("type").word() if "type" in shape else "mesh" if "ply" in shape else "inlinedmesh"
        values = parameters({**shape, **rest}, (), _SHAPES)
        if kind == "mesh":
            values += [] if "ply" in shape else texts(filename="")
        self._direct("Shape", ({"mesh": "plymesh"}.get(kind, kind),), values, place)

    def _shared_mesh(self, given: Parameters, report: LossReport) -> Mesh:
        """A mesh in the file itself, which its objects share."""
        points = given.given.get("P", np.zeros(0))
        if id(points) not in self._inlined:
            made = self.shapes.made("trianglemesh", given, False, self.beside)
            assert made is not None and isinstance(made[0], Mesh)
            self._inlined[id(points)] = points, made[0]
        given.asked.update(_SHAPES.values())
        return self._inlined[id(points)][1]

    def _light_up(self, material: str) -> None:
        """The emission of the next shape, and the power to which it is scaled."""
        lamp = self.lamps.get(material, {})
        self.attributes.emission, self.attributes.power = None, 0.0
        if "" not in lamp:
            return
        values = parameters({"emission": lamp[""]}, self.names.colors)
        given = parameters_of(directive("emission", (), values, lamp[""].place, self.beside), 0)
        found = self.surfaces.texture(given, "emission", grey(0.0))
        color = np.array(mean_of(found))
        if not isinstance(found, ConstantTexture):
            self.report.add(str(lamp[""].place), "a lamp with a texture", "its mean")
        gain = np.broadcast_to(lamp[".gain"].numbers(1, 3), 3) if ".gain" in lamp else np.ones(3)
        if not (color * gain > 0.0).any():
            return
        self.attributes.emission = rgb(color * gain)
        lumens = lumens_of(dict(lamp), ".")
        unit = color_unit(lamp.get(".normalizebycolor"), color)
        self.attributes.power = lumens * float(product(LUMINANCE, color * gain)) / unit

    def _light_block(self, name: str, block: Block, place: TextPosition) -> None:
        kind = block.pop("type").word() if "type" in block else "sky2"
        place_of = self._matrix(block, "transformation")
        if kind in ("point", "mappoint") and "position" in block:  # a point in the light's space, unlike LuxRender's
            place_of = product(place_of, translation(*block.pop("position").numbers(3).tolist()))
        self._place(place_of)
        kind, values = light_values(kind, block, self.report)
        self._direct("LightSource", (kind,), values, place)


def load_luxcore(path: Path, root: Path | None, report: LossReport) -> Scene:
    """Reads a scene; see :data:`scenes.formats.text.format.Read`.

    Raises:
        SceneError: the scene cannot be read; the message gives file, line and column.
    """
    return scene_of(LuxCoreReader(LuxCoreFiles(path, root), report), path)
