"""Conversion of trees of dictionaries, as ``mitsuba.load_dict`` takes them, to elements of Mitsuba 3; in Python or as a
JSON file.

Source: Mitsuba 3 documentation, "Scene description using Python dictionaries".
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scenes.canonical import Scene, SceneError
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.read import MitsubaReader, scene_of
from scenes.formats.text.places import TextPosition
from scenes.formats.text.scene_files import SceneFiles
from scenes.formats.text.xml_tree import DEPTH_MAX, NODES_MAX, XmlNode

_KINDS = {
    "shape": "obj ply serialized sphere cylinder disk rectangle cube bsplinecurve linearcurve sdfgrid shapegroup "
    "instance merge ellipsoids ellipsoidsmesh",
    "bsdf": "diffuse dielectric thindielectric roughdielectric conductor roughconductor measured plastic roughplastic "
    "bumpmap normalmap blendbsdf mask twosided null principled principledthin hair pplastic polarizer retarder "
    "circular",
    "emitter": "area point constant envmap spot projector directional directionalarea sunsky timed_sunsky",
    "sensor": "perspective thinlens orthographic radiancemeter irradiancemeter distant batch",
    "texture": "bitmap checkerboard mesh_attribute volume",
    "spectrum": "uniform regular irregular srgb d65 blackbody rawconstant",
    "integrator": "direct path aov volpath volpathmis prb prb_basic prbvolpath ptracer depth moment stokes "
    "direct_projective prb_projective",
    "sampler": "independent stratified multijitter orthogonal ldsampler",
    "film": "hdrfilm specfilm",
    "rfilter": "box tent gaussian mitchell catmullrom lanczos",
    "medium": "homogeneous heterogeneous",
    "phase": "isotropic hg blendphase sggx rayleigh tabphase",
    "volume": "constvolume gridvolume",
}
_TAGS = {kind: tag for tag, kinds in _KINDS.items() for kind in kinds.split()}


class Key(TextPosition):
    """A place in a tree, given by the keys that lead to it."""

    def __str__(self) -> str:
        return self.file


class _Converter:
    """Creates elements from dictionaries, and counts them."""

    def __init__(self) -> None:
        self.count = 0

    def node(self, value: Any, name: str, where: str, depth: int = 0) -> XmlNode:
        """The element of a value under a key."""
        self.count += 1
        if depth > DEPTH_MAX or self.count > NODES_MAX:
            raise SceneError(f"{where}: expected at most {DEPTH_MAX} levels and {NODES_MAX:,} entries")
        place, named = Key(where, 1, 1), {"name": name}
        if isinstance(value, Mapping):
            return self._plugin(value, name, place, depth)
        if isinstance(value, bool | np.bool_):
            return XmlNode("boolean", {**named, "value": str(bool(value)).lower()}, place)
        if isinstance(value, int | float | np.integer | np.floating):
            return XmlNode("float", {**named, "value": repr(float(value))}, place)
        if isinstance(value, str):
            return XmlNode("string", {**named, "value": value}, place)
        return self._numbers(getattr(value, "matrix", value), named, place)

    def _numbers(self, value: Any, named: dict[str, str], place: TextPosition) -> XmlNode:
        """A vector, a transform, or a list of numbers as text."""
        try:
            found = np.array(value, np.float64)
        except (TypeError, ValueError, OverflowError):
            raise SceneError(f"{place}: expected a number, text, vector, transform or dictionary") from None
        text = " ".join(repr(float(part)) for part in found.ravel())
        if found.ndim == 2 and found.shape in ((4, 4), (3, 3)):
            if found.shape == (3, 3):  # transform of texture coordinates
                full = np.eye(4)
                full[:2, :2], full[:2, 3] = found[:2, :2], found[:2, 2]
                text = " ".join(repr(float(part)) for part in full.ravel())
            return XmlNode("transform", named, place, [XmlNode("matrix", {"value": text}, place)])
        return XmlNode("vector" if found.shape == (3,) else "string", {**named, "value": text}, place)

    def _plugin(self, value: Mapping[str, Any], name: str, place: TextPosition, depth: int) -> XmlNode:
        kind = value.get("type")
        if not isinstance(kind, str):
            raise SceneError(f"{place}: expected a 'type'")
        if kind == "ref":
            return XmlNode("ref", {"name": name, "id": str(value.get("id", ""))}, place)
        if kind in ("rgb", "spectrum") and "value" in value:
            return XmlNode(kind, {"name": name, "value": _colour(value["value"], place)}, place)
        tag = "scene" if kind == "scene" and depth == 0 else _TAGS.get(kind, "")
        attributes = {"type": kind, "id": str(value["id"])} if "id" in value else {"type": kind}
        if depth > 1 or tag in ("texture", "spectrum"):
            attributes["name"] = name
        if depth == 1:
            attributes.setdefault("id", name)
        if not tag:
            tag = "a plugin of unknown kind"  # the reader reports it
        elif tag == "scene":
            attributes = {"version": "3.0.0"}
        children = [
            self.node(part, key, f"{place}.{key}", depth + 1)
            for key, part in value.items()
            if key not in ("type", "id") and part is not None
        ]
        return XmlNode(tag, attributes, place, children)


def _colour(value: Any, place: TextPosition) -> str:
    """One or three numbers, or pairs of a wavelength and a value."""
    try:
        found = np.array(value, np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{place}: expected numbers, got {str(value)[:40]!r}") from None
    if found.ndim == 2 and found.shape[1] == 2:
        return ", ".join(f"{float(at)!r}:{float(part)!r}" for at, part in found)
    return " ".join(repr(float(part)) for part in found.ravel())


def scene_of_dictionary(tree: Mapping[str, Any], folder: Path, report: LossReport, name: str = "scene") -> Scene:
    """The canonical scene of a tree of dictionaries.

    Args:
        tree: tree as for ``mitsuba.load_dict``, with ``"type": "scene"``; matrices may be arrays, lists or transforms.
        folder: folder to which file names are relative, and outside of which nothing is read.
        report: receives the losses.
        name: name of the scene, for messages.

    Raises:
        SceneError: the scene cannot be read; the message gives the keys that lead to the error.
    """
    return _scene(tree, Path(folder) / name, None, report)


def load_dictionary(path: Path, root: Path | None, report: LossReport) -> Scene:
    """Reads a tree from a JSON file; see :data:`scenes.formats.text.format.Read`.

    Raises:
        SceneError: the scene cannot be read; the message gives the keys that lead to the error.
    """
    files = SceneFiles(path, root)
    if not (files.folder / Path(path).name).is_file():
        raise SceneError(f"{path}: expected a scene file, found none")
    try:
        tree = json.loads(files.text(files.folder / Path(path).name, str(path)))
    except ValueError as error:
        raise SceneError(f"{path}: expected JSON ({' '.join(str(error).split())[:100]})") from None
    return _scene(tree, Path(path), root, report)


def _scene(tree: Any, path: Path, root: Path | None, report: LossReport) -> Scene:
    if not isinstance(tree, Mapping) or tree.get("type") != "scene":
        raise SceneError(f"{path.name}: expected a dictionary of the type 'scene'")
    reader = MitsubaReader(SceneFiles(path, root), report)
    reader.read_tree(_Converter().node(tree, "", path.name), path)
    return scene_of(reader, path)
