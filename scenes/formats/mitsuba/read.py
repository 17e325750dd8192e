"""Reader of Mitsuba scenes: those of 0.5, and those of 2 and 3 after translation to 0.5.

Source: Mitsuba 0.5 documentation; Mitsuba 3 documentation; conventions measured with Mitsuba 3; Hagemann 2018, ch. 4.
"""

from __future__ import annotations

from pathlib import Path

from scenes.canonical import (
    Instance,
    Material,
    Scene,
    SceneError,
)
from scenes.formats.appearance.media import as_drawn_by, settled
from scenes.formats.geometry.conventions import duration_s, with_unit_axes
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.media import MitsubaMedia
from scenes.formats.mitsuba.modern import in_old_words, is_modern
from scenes.formats.mitsuba.read_lights import MitsubaLights
from scenes.formats.mitsuba.read_materials import MitsubaSurfaces
from scenes.formats.mitsuba.read_settings import MitsubaSettings, seeing_all
from scenes.formats.mitsuba.read_shapes import MitsubaShapes
from scenes.formats.mitsuba.read_textures import MISSING
from scenes.formats.text.scene_files import DEPTH_MAX, SceneFiles
from scenes.formats.text.xml_tree import XmlNode, parse_xml

TEXT_MAX = 1 << 16
"""Maximum number of characters of a value with its parameters."""


_OF_MEDIA = ("volpath",)
_OF_MEDIA_0 = (*_OF_MEDIA, "volpath_simple", "bdpt", "mlt", "pssmlt", "erpt", "ptracer", "photonmapper")
"""Integrators that draw media, of Mitsuba 3 and of 0.5."""

_MEDIA = ("interior", "exterior", "medium")
"""Names of references to media."""

_NAME_MAX = 256
"""Maximum number of characters of a parameter's name."""


class MitsubaReader(MitsubaSettings):
    """State of reading a Mitsuba file."""

    def __init__(self, files: SceneFiles, report: LossReport) -> None:
        super().__init__(report)
        self.files = files
        self.names: dict[str, XmlNode] = {}
        self.defaults: dict[str, str] = {}
        self._longest = 0
        self._missing: dict[tuple[str, str], XmlNode] = {}
        self.surfaces = MitsubaSurfaces(files, report, self.find)
        self.media = MitsubaMedia(report, self.find)
        self.shapes = MitsubaShapes(files, report, self.surfaces, self.media, self.find)
        self.materials: dict[str, Material] = {}
        self.instances: list[Instance] = []
        self.lights = MitsubaLights(files, report)

    # --- the tree ------------------------------------------------------------------------------------------------

    def read(self, path: Path) -> None:
        """Reads a file and its includes."""
        for node in self._nodes(path, []):
            self._node(node)

    def read_tree(self, root: XmlNode, path: Path) -> None:
        """Reads the elements of a parsed tree; ``path`` is used for messages and includes."""
        for node in self._within(root, path, []):
            self._node(node)

    def _nodes(self, path: Path, inside: list[Path]) -> list[XmlNode]:
        """Elements of the scene and of included files; fills in parameters and collects names."""
        where = str(inside[-1]) if inside else str(path)
        if path in inside:
            raise SceneError(f"{where}: expected files that do not include themselves, {path.name} does")
        if len(inside) >= DEPTH_MAX:
            raise SceneError(f"{where}: expected at most {DEPTH_MAX} files inside each other")
        return self._within(parse_xml(self.files.read(path, where), path.name), path, inside)

    def _within(self, root: XmlNode, path: Path, inside: list[Path]) -> list[XmlNode]:
        if root.tag != "scene":
            raise SceneError(f"{root.place}: expected a scene, got {root.tag!r}")
        modern = self.shapes.modern = self.media.modern = is_modern(root.get("version"), root)
        found = []
        for node in root.children:
            if node.tag == "default":
                self.defaults.setdefault(node.get("name"), node.get("value"))
                self._longest = min(max(self._longest, len(node.get("name"))), _NAME_MAX)
                continue
            self._filled(node)
            if modern:
                in_old_words(node, self.report)
            if node.tag == "include":
                found += self._nodes(self.files.path(node.get("filename"), str(node.place), path), [*inside, path])
            elif node.tag == "alias":
                self._named(node, node.get("id"))
                self.names[node.get("as")] = self.names[node.get("id")]
            else:
                found.append(node)
        return found

    def _filled(self, node: XmlNode) -> None:
        """Replaces ``$name`` by the parameter, and collects named elements."""
        for key, value in node.attributes.items():
            if "$" in value:
                node.attributes[key] = self._with_parameters(value, node)
        if node.tag == "spectrum" and "filename" in node.attributes:
            self._sample(node)
        if node.tag not in ("ref", "alias") and "id" in node.attributes:
            self.names[node.get("id")] = node
        for child in node.children:
            self._filled(child)

    def _with_parameters(self, text: str, node: XmlNode) -> str:
        """A value with its parameters inserted; of two matching names the longer one is used."""
        for _ in range(DEPTH_MAX):  # the value of a parameter may contain further parameters
            found = [self._parameter(part) for part in text.split("$")[1:]]
            if not any(name for name, _ in found):
                break
            pieces = [self.defaults[name] + rest if name else f"${rest}" for name, rest in found]
            text = text.split("$", 1)[0] + "".join(pieces)
            if len(text) > TEXT_MAX:
                raise SceneError(f"{node.place}: expected at most {TEXT_MAX:,} characters with parameters")
        if "$" in text:
            raise SceneError(f"{node.place}: expected a parameter with a default, got {text[:40]!r}")
        return text

    def _parameter(self, text: str) -> tuple[str, str]:
        """The longest parameter name at the beginning of a text, empty if there is none, and the rest of the text."""
        for length in range(min(len(text), self._longest), 0, -1):
            if text[:length] in self.defaults:
                return text[:length], text[length:]
        return "", text

    def _sample(self, node: XmlNode) -> None:
        """Replaces the name of a spectrum file by its samples, or by none if the file is missing."""
        name, where = node.attributes.pop("filename"), str(node.place)
        path = self.files.known(name, where, self.report, f"the spectrum {name!r}", "the constant 0.5")
        if path is None:
            node.attributes["value"] = "0.5"
            return
        words = " ".join(line.split("#")[0] for line in self.files.text(path, where).splitlines()).split()
        if not words or len(words) % 2:
            raise SceneError(f"{path}: expected pairs of a wavelength and a value")
        node.attributes["value"] = ", ".join(f"{a}:{b}" for a, b in zip(words[::2], words[1::2], strict=True))

    def _named(self, node: XmlNode, name: str) -> XmlNode:
        if name not in self.names:
            raise SceneError(f"{node.place}: expected a name of something before it, got {name!r}")
        return self.names[name]

    def find(self, reference: XmlNode, medium: bool = False) -> XmlNode:
        """The element to which a reference refers; for an unknown name a grey or empty one, which is reported, or none
        where a ``medium`` alone is without a name."""
        name, part = reference.get("id"), reference.get("name")
        if name in self.names:
            return self.names[name]
        tag = "medium" if medium or part in _MEDIA else "texture" if part else "bsdf"
        became = "vacuum" if tag == "medium" else "grey"
        self.report.add(str(reference.place), f"{name!r}, which no earlier element has as its name", became)
        kind = "diffuse" if tag == "bsdf" else MISSING
        return self._missing.setdefault((name, tag), XmlNode(tag, {"type": kind}, reference.place))

    def _node(self, node: XmlNode) -> None:
        if node.tag in ("integrator", "sensor", "camera", "sampler", "film"):
            self.setting(node)
        elif node.tag == "bsdf":
            self.materials[node.get("id") or f"bsdf{len(self.materials)}"] = self.surfaces.material(node)
        elif node.tag == "texture":
            self.surfaces.made_texture(node)
        elif node.tag == "shape":
            self.instances += self.shapes.read(node)
        elif node.tag == "emitter":
            self.lights.read(node)
        elif node.tag == "medium":
            self.media.read(node)
        elif node.tag in ("phase", "volume"):
            return  # parts of media that have their names
        elif node.tag == "subsurface":
            named = f" {node.get('id')!r}" if node.get("id") else ""
            self.report.add(str(node.place), f"{node.tag}{named} (participating medium)")
        else:
            self.report.unknown(node.place, "element", node.tag)


def load_mitsuba(path: Path, root: Path | None, report: LossReport) -> Scene:
    """Reads a scene; see :data:`scenes.formats.text.format.Read`.

    Raises:
        SceneError: the scene cannot be read; the message gives file, line and column.
    """
    reader = MitsubaReader(SceneFiles(path, root), report)
    main = reader.files.folder / Path(path).name
    if not main.is_file():
        raise SceneError(f"{path}: expected a scene file, found none")
    reader.read(main)
    return scene_of(reader, path)


def scene_of(reader: MitsubaReader, path: Path) -> Scene:
    """The scene that a reader has read."""
    report = reader.report
    if reader.camera is None:
        report.add(str(path), "no sensor", "one that sees the shapes along z")
        reader.camera = seeing_all(reader.instances)
    reader.camera = with_unit_axes(reader.camera, str(path), report)
    parts = tuple(reader.instances), tuple(reader.lights.lights), reader.film, reader.sampler, reader.integrator
    lasts = duration_s(reader.camera, reader.instances)
    scene = Scene(reader.camera, *parts, medium=reader.medium, materials=dict(reader.materials), name=Path(path).stem,
                  duration_s=lasts)  # fmt: skip
    scene = settled(scene, report)
    drawn = reader.drawn_by in (_OF_MEDIA if reader.media.modern else _OF_MEDIA_0)
    return scene if drawn else as_drawn_by(scene, reader.drawn_by, Path(path).name, report)
