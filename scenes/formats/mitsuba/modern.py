"""Translation of elements of Mitsuba 2 and 3 to those of Mitsuba 0.5, so that one reader reads both.

Properties have other names, some plugins have other defaults, spectra may be plugins, and textures are placed by a
transform.

Source: Mitsuba 3 documentation, plugin reference; behaviour of Mitsuba 3.9.1.
"""

from __future__ import annotations

import re

import numpy as np

from scenes.canonical import SceneError
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.properties import numbers, transform_of
from scenes.formats.text.xml_tree import XmlNode

_OLD_NAMES = {"int_ior": "intIOR", "ext_ior": "extIOR"}
_DEFAULTS = {
    "conductor": ("string", "material", "none"),
    "roughconductor": ("string", "material", "none"),
    "bitmap": ("string", "filterType", "bilinear"),
    "sunsky": ("rgb", "albedo", "0.3"),
}
"""Defaults that differ from those of Mitsuba 0.5."""

_SAMPLERS = {"multijitter": "stratified", "orthogonal": "stratified"}
_INTEGRATORS = {"volpathmis": "volpath", "prb": "path", "prb_basic": "path", "prbvolpath": "volpath",
                "prb_projective": "path", "direct_projective": "direct"}  # fmt: skip
_WRAPPERS = ("aov", "moment", "stokes")
"""Integrators that write additional outputs of a nested integrator."""


def is_modern(version: str, root: XmlNode) -> bool:
    """Whether a file belongs to Mitsuba 2 or 3: by its version or, without one, by the name of its transforms."""
    if re.fullmatch(r"0(\.\d+)*", version):
        return False
    if re.fullmatch(r"[23](\.\d+)*", version):
        return True
    if version:
        raise SceneError(f"{root.place}: expected a scene of Mitsuba 0.5, 2 or 3, got one of version {version!r}")
    return any(_speaks_modern(child) for child in root.children)


def _speaks_modern(node: XmlNode) -> bool:
    return node.get("name") in ("to_world", "max_depth", "sample_count", "int_ior") or any(
        map(_speaks_modern, node.children)
    )


def in_old_words(node: XmlNode, report: LossReport) -> None:
    """Translates an element and its descendants in place, after their parameters have been filled in."""
    if "name" in node.attributes:
        node.attributes["name"] = old_name(node.attributes["name"])
    if node.tag == "integrator":
        _integrator(node, report)
    for child in node.children:
        in_old_words(child, report)
    kind = node.get("type")
    if node.tag == "spectrum" and kind:
        _spectrum(node, report)
        return
    if node.tag == "texture" and kind in ("uniform", "srgb", "d65", "regular", "irregular", "blackbody", "rawconstant"):
        _spectrum(node, report)
        return
    if kind in _DEFAULTS and not _has(node, _DEFAULTS[kind][1], "eta"):
        tag, name, value = _DEFAULTS[kind]
        node.children.append(XmlNode(tag, {"name": name, "value": value}, node.place))
    if node.tag == "texture":
        _placed_by_numbers(node, report)
    if node.tag == "emitter" and kind == "sunsky":
        _zenith_along_y(node)
    if node.tag == "sampler" and kind in _SAMPLERS:
        report.hint(str(node.place), f"sampler {kind!r}", _SAMPLERS[kind])
        node.attributes["type"] = _SAMPLERS[kind]


def old_name(name: str) -> str:
    """The name of a property in Mitsuba 0.5: ``to_world`` is ``toWorld``."""
    return _OLD_NAMES.get(name) or re.sub(r"(?<=[a-z0-9])_([a-z0-9])", lambda found: found[1].upper(), name)


def _has(node: XmlNode, *names: str) -> bool:
    return any(child.get("name") in names for child in node.children)


def _value(node: XmlNode, name: str, default: str) -> str:
    for child in node.children:
        if child.get("name") == name:
            return child.get("value", default)
    return default


def _spectrum(node: XmlNode, report: LossReport) -> None:
    """Converts a spectrum plugin to a spectrum value."""
    kind = node.attributes.pop("type")
    node.tag = "spectrum"
    if kind == "blackbody":
        node.tag = "blackbody"
        node.attributes.update(temperature=_value(node, "temperature", "5000"), scale=_value(node, "scale", "1"))
    elif kind in ("uniform", "rawconstant", "d65"):
        node.attributes["value"] = _value(node, "scale" if kind == "d65" else "value", "1")
        colors = [child for child in node.children if child.get("name") == "color"]
        if kind == "d65" and colors:
            node.tag, node.attributes["value"] = colors[0].tag, colors[0].get("value", "1")
    elif kind == "srgb":
        node.tag, node.attributes["value"] = "rgb", _value(node, "color", "0.5")
    elif kind in ("regular", "irregular") and _has(node, "values"):
        values = numbers(node, _value(node, "values", ""), None)
        if kind == "regular":
            low, high = (
                numbers(node, _value(node, f"wavelength{end}", text), 1)[0]
                for end, text in (("Min", "360"), ("Max", "830"))
            )
            at = np.linspace(low, high, len(values)).tolist()
        else:
            at = numbers(node, _value(node, "wavelengths", ""), None)
        if len(at) != len(values) or not values:
            raise SceneError(f"{node.place}: {kind}: expected as many wavelengths as values")
        node.attributes["value"] = ", ".join(f"{a!r}:{b!r}" for a, b in zip(at, values, strict=True))
    else:
        report.add(str(node.place), f"spectrum {kind!r}", "the constant 0.5")
        node.attributes["value"] = "0.5"
    node.children = []


def _placed_by_numbers(node: XmlNode, report: LossReport) -> None:
    """Converts the transform of texture coordinates to two scales and two offsets, and the flag for linear values to a
    gamma."""
    for child in [part for part in node.children if part.get("name") == "toUv"]:
        node.children.remove(child)
        matrix = transform_of(child) if len(child.children) else np.eye(4)
        if abs(matrix[0, 1]) + abs(matrix[1, 0]) > 1e-9:
            report.add(str(child.place), "texture coordinates that are turned", "not turned")
        given = {"uscale": matrix[0, 0], "vscale": matrix[1, 1], "uoffset": matrix[0, 3], "voffset": matrix[1, 3]}
        for name, value in given.items():
            node.children.append(XmlNode("float", {"name": name, "value": repr(float(value))}, child.place))
    for child in [part for part in node.children if part.get("name") == "raw"]:
        node.children.remove(child)
        if child.get("value").lower() == "true":
            node.children.append(XmlNode("float", {"name": "gamma", "value": "1"}, child.place))


def _zenith_along_y(node: XmlNode) -> None:
    """Rotates daylight with the zenith z, as in Mitsuba 3, to the zenith y of Mitsuba 0.5."""
    turn = XmlNode("rotate", {"x": "1", "angle": "90"}, node.place)
    placed = [child for child in node.children if child.get("name") == "toWorld"]
    if placed:
        placed[0].children.insert(0, turn)
    else:
        node.children.append(XmlNode("transform", {"name": "toWorld"}, node.place, [turn]))


def _integrator(node: XmlNode, report: LossReport) -> None:
    """Replaces wrapping integrators by the nested one that computes the picture."""
    inside = [child for child in node.children if child.tag == "integrator"]
    if node.get("type") in _WRAPPERS and len(inside) == 1:
        report.hint(str(node.place), f"integrator {node.get('type')!r}", "the one inside it")
        node.attributes.update(inside[0].attributes)
        node.children = inside[0].children
        _integrator(node, report)
        return
    node.attributes["type"] = _INTEGRATORS.get(node.get("type"), node.get("type"))
