"""Properties of Mitsuba elements: numbers, vectors, colours and transforms."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from scenes.arithmetic import affine, power, product
from scenes.canonical import Rgb, SceneError
from scenes.canonical.values import Matrix
from scenes.formats.appearance.spectra import grey, radiant_rgb, rgb, sampled_rgb, xyz_to_rgb
from scenes.formats.geometry.transform_stack import KEYS_MAX, invertible, looking, rotation, scaling, translation
from scenes.formats.losses import HINTS, LossReport
from scenes.formats.text.numbers import NUMBER_MAX
from scenes.formats.text.xml_tree import XmlNode
from scenes.loading import decode_srgb

PROPERTIES = ("integer", "float", "string", "boolean", "rgb", "srgb", "spectrum", "blackbody", "point", "vector",
              "transform", "animation", "xyz")  # fmt: skip


@dataclass
class Properties:
    """The properties of an element by name, and its other children."""

    node: XmlNode
    report: LossReport
    given: dict[str, XmlNode] = field(default_factory=dict)
    rest: list[XmlNode] = field(default_factory=list)
    asked: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        for child in self.node.children:
            if child.tag in PROPERTIES:
                name = child.get("name")
                if name in self.given:  # Mitsuba 0.5 warns and takes the last; Mitsuba 3 refuses the file
                    what = f"{self.node.get('type')}: several values of {name!r}"
                    self.report.hint(str(child.place), what, "the last")
                self.given[name] = child
            else:
                self.rest.append(child)

    @property
    def where(self) -> str:
        """Place of the element."""
        return str(self.node.place)

    def __contains__(self, name: str) -> bool:
        return name in self.given

    def number(self, name: str, default: float) -> float:
        """A float or integer property."""
        self.asked.add(name)
        if name not in self.given:
            return default
        return numbers(self.given[name], self.given[name].get("value"), 1)[0]

    def whole(self, name: str, default: int, least: int, most: int) -> int:
        """An integer within bounds."""
        value = self.number(name, default)
        if value != int(value) or not least <= value <= most:
            what = f"{self.given[name].place}: {name}"
            raise SceneError(f"{what}: expected a whole number from {least} to {most}, got {value:g}")
        return int(value)

    def text(self, name: str, default: str) -> str:
        """A string property."""
        self.asked.add(name)
        return self.given[name].get("value", default) if name in self.given else default

    def truth(self, name: str, default: bool) -> bool:
        """A boolean property."""
        value = self.text(name, str(default)).lower()
        if value not in ("true", "false"):
            raise SceneError(f"{self.where}: {name}: expected true or false, got {value!r}")
        return value == "true"

    def vector(self, name: str, default: Rgb) -> np.ndarray:
        """A point or vector."""
        self.asked.add(name)
        return np.array(default) if name not in self.given else np.array(triple(self.given[name], 0.0))

    def color(self, name: str, default: Rgb) -> Rgb:
        """A colour, in any representation."""
        self.asked.add(name)
        if name not in self.given:
            return default
        node = self.given[name]
        return grey(self.number(name, 0.0)) if node.tag in ("float", "integer") else color_of(node)

    def transform(self, name: str = "toWorld") -> Matrix:
        """A transform; an animation becomes its first transform, which is reported."""
        keys, _ = self.motion(name)
        if len(keys) > 1:
            self.report.add(str(self.given[name].place), "an animated transform", "the first of its transforms")
        return keys[0]

    def motion(self, name: str = "toWorld") -> tuple[list[Matrix], list[float]]:
        """Transforms of an animation and their times, seconds; a single one at time zero without animation."""
        self.asked.add(name)
        if name not in self.given:
            return [np.eye(4)], [0.0]
        node = self.given[name]
        if node.tag != "animation":
            return [transform_of(node)], [0.0]
        steps = [child for child in node.children if child.tag == "transform"]
        times_s = [numbers(step, step.get("time", "0"), 1)[0] for step in steps]
        if not 1 <= len(steps) <= KEYS_MAX or not (np.diff(times_s) > 0.0).all():
            raise SceneError(
                f"{node.place}: animation: expected 1 to {KEYS_MAX} transforms, each later than the one before"
            )
        return [transform_of(step) for step in steps], times_s

    def left_over(self) -> None:
        """Reports unused properties and unused named textures."""
        for name in self.given:
            if name not in self.asked:
                what = f"{self.node.get('type')}: property {name!r}"
                self.report.add(self.where, what, picture=name not in HINTS)
        for child in self.rest:
            if child.tag in ("texture", "ref") and child.get("name") and child.get("name") not in self.asked:
                self.report.add(str(child.place), f"{self.node.get('type')}: texture {child.get('name')!r}")


def numbers(node: XmlNode, text: str, count: int | None) -> list[float]:
    """Numbers of a text, separated by commas or spaces.

    Raises:
        SceneError: a word is not a number or is too great, or the count differs from ``count``.
    """
    words = text.replace(",", " ").split()
    try:
        found = [float(word) for word in words]
    except ValueError:
        raise SceneError(f"{node.place}: {node.get('name') or node.tag}: expected numbers, got {text[:40]!r}") from None
    if not all(abs(value) <= NUMBER_MAX for value in found) or (count is not None and len(found) != count):
        wanted = f"{count} numbers" if count is not None else "numbers"
        what = f"{node.place}: {node.get('name') or node.tag}"
        raise SceneError(f"{what}: expected {wanted} up to {NUMBER_MAX:g}, got {text[:40]!r}")
    return found


def triple(node: XmlNode, default: float, whole: str = "value") -> list[float]:
    """Three numbers, given as ``x``, ``y`` and ``z`` or as one value."""
    if whole in node.attributes:
        found = numbers(node, node.get(whole), None)
        if len(found) == 1:
            return found * 3
        return numbers(node, node.get(whole), 3)
    return [numbers(node, node.get(axis, repr(default)), 1)[0] for axis in "xyz"]


def color_of(node: XmlNode) -> Rgb:
    """The colour of an element.

    Raises:
        SceneError: the colour cannot be read.
    """
    text = node.get("value").strip()
    if node.tag == "blackbody":
        kelvin = numbers(node, node.get("temperature", "5000").rstrip("Kk"), 1)[0]
        if not 100.0 <= kelvin <= 1e6:
            raise SceneError(f"{node.place}: temperature: expected 100 to 1000000 K, got {kelvin:g}")
        return radiant_rgb(kelvin, numbers(node, node.get("scale", "1"), 1)[0])
    if text.startswith("#"):
        if not re.fullmatch(r"#[0-9a-fA-F]{6}", text):
            raise SceneError(f"{node.place}: expected a colour such as #a0b0c0, got {text[:20]!r}")
        values = np.array([int(text[at : at + 2], 16) for at in (1, 3, 5)], np.uint8)
        return rgb(decode_srgb(values) if node.tag == "srgb" else values / 255.0)
    if node.tag == "spectrum" and ":" in text:
        pairs = [part.split(":") for part in text.replace(",", " ").split()]
        if any(len(pair) != 2 for pair in pairs):
            raise SceneError(f"{node.place}: expected pairs such as 400:0.5, got {text[:40]!r}")
        table = np.array([numbers(node, " ".join(pair), 2) for pair in pairs])
        return sampled_rgb(table[:, 0], table[:, 1])
    found = numbers(node, text, None)
    if len(found) not in (1, 3):
        raise SceneError(f"{node.place}: {node.get('name')}: expected one or three numbers, got {text[:40]!r}")
    values = np.array(found * 3 if len(found) == 1 else found)
    if node.tag == "xyz":
        return xyz_to_rgb(values)
    if node.tag == "srgb":
        clipped = np.clip(values, 0.0, 1.0)
        values = np.where(clipped <= 0.04045, clipped / 12.92, power((clipped + 0.055) / 1.055, 2.4))
    return rgb(values)


def transform_of(node: XmlNode) -> Matrix:
    """The product of the steps of a transform; each step is applied after those before it."""
    matrix = np.eye(4)
    for step in node.children:
        if step.tag == "translate":
            made = translation(*triple(step, 0.0))
        elif step.tag == "scale":
            made = scaling(*triple(step, 1.0))
        elif step.tag == "rotate":
            made = rotation(numbers(step, step.get("angle", "0"), 1)[0], *triple(step, 0.0))
        elif step.tag == "matrix":
            made = _matrix(step)
        elif step.tag in ("lookat", "lookAt"):
            made = _looked_along(step)
        else:
            raise SceneError(f"{step.place}: expected a step of a transform, got {step.tag!r}")
        matrix = product(made, matrix)
    plain = affine(matrix)
    if plain is None or not invertible(plain):
        raise SceneError(f"{node.place}: transform: expected one that can be inverted, without perspective")
    return plain


def _matrix(step: XmlNode) -> Matrix:
    """A matrix of sixteen numbers, or of nine without translation, row by row."""
    found = numbers(step, step.get("value"), None)
    if len(found) == 9:
        made = np.eye(4)
        made[:3, :3] = np.reshape(found, (3, 3))
        return made
    return np.array(numbers(step, step.get("value"), 16)).reshape(4, 4)


def _looked_along(step: XmlNode) -> Matrix:
    """Camera-to-world transform from two points and an upward direction."""
    origin, target = (np.array(numbers(step, step.get(name), 3)) for name in ("origin", "target"))
    if "up" in step.attributes:
        up = np.array(numbers(step, step.get("up"), 3))
    else:
        up = np.eye(3)[int(np.abs(target - origin).argmin())]
    found = looking(origin, target, up, left_handed=True)
    if found is None:
        raise SceneError(f"{step.place}: lookat: expected an upward direction across the line of sight")
    return found


IORS = {
    "vacuum": 1.0, "helium": 1.00004, "hydrogen": 1.00013, "air": 1.00028, "carbon dioxide": 1.00045, "water": 1.3330,
    "acetone": 1.36, "ethanol": 1.361, "carbon tetrachloride": 1.461, "glycerol": 1.4729, "benzene": 1.501,
    "silicone oil": 1.52045, "bromine": 1.661, "water ice": 1.31, "fused quartz": 1.458, "pyrex": 1.470,
    "acrylic glass": 1.49, "polypropylene": 1.49, "bk7": 1.5046, "sodium chloride": 1.544, "amber": 1.55, "pet": 1.575,
    "diamond": 2.419,
}  # fmt: skip
"""Refractive indices by their names in Mitsuba 0.5 (documentation, section on dielectrics)."""


def ior(properties: Properties, name: str, default: str) -> float:
    """A refractive index by name or number."""
    node = properties.given.get(name)
    if node is not None and node.tag != "string":
        return properties.number(name, 1.5)
    found = properties.text(name, default).lower()
    if found not in IORS:
        raise SceneError(f"{properties.where}: {name}: expected one of {', '.join(IORS)}, got {found!r}")
    return IORS[found]
