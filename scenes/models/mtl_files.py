"""Material libraries of OBJ (MTL).

``Kd`` or the image of ``map_Kd`` is the diffuse colour; ``Ks`` and ``Ns`` are the highlight, dimmed so that no more
light is reflected than arrives. By ``illum``, 0 is a constant colour without lighting, 1 has no highlight, 3 and 8 are
mirrors by ``Ks``, 5 is a mirror that grows at grazing angles, 4 and 9 are thin panes, 6 and 7 are glass of the index
``Ni``. ``d`` (or ``1 - Tr``) is the opacity, ``Ke`` the emission. For path tracing ``map_d`` is the opacity, too: the
alpha of its image, or its brightness where it has none, or the channel of ``-imfchan``; and ``norm`` is a normal map.
``Pm`` and ``Pr``, if given, are the metallic share and the roughness as in glTF.

Deviation: an image replaces ``Kd`` (the format multiplies them), because exporters leave ``Kd`` at an arbitrary grey.

Source: Wavefront, "MTL material format" (Advanced Visualizer appendix); D. Dodson, "PBR extension of MTL".
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from scenes.canonical import (
    ConstantTexture,
    Emissive,
    Glass,
    ImageTexture,
    Masked,
    Material,
    NormalMapped,
    Phong,
    Rgb,
    SceneError,
    Texture,
)
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.spectra import rgb
from scenes.formats.losses import LossReport
from scenes.loading import read_alpha, read_image, read_values
from scenes.models.phong_of_parts import EXPONENT_MAX, diffuse_share, glowing, metallic_rough, scaled, seen_through
from scenes.models.sources import Sources, joined_lines
from scenes.pictures import Pixels

_FIXED = {"-blendu": 1, "-blendv": 1, "-cc": 1, "-clamp": 1, "-mm": 2, "-texres": 1, "-bm": 1, "-imfchan": 1,
          "-boost": 1, "-type": 1, "-colorspace": 1}  # fmt: skip
_VECTORS = ("-o", "-s", "-t")
_MAPS = ("map_", "bump", "disp", "decal", "refl", "norm")
_ALONG_PATHS = ("map_d", "norm")
_CHANNELS = ("r", "g", "b", "m", "l")  # red, green, blue, alpha, brightness
_UNUSED = ("map_ka", "map_aat")  # ambient light, and anti-aliasing of pictures


@dataclass
class Entry:
    """The entry of a material in a library: rests of lines by keyword in lower case."""

    lines: dict[str, str] = field(default_factory=dict)

    def number(self, name: str, default: float) -> float:
        words = self.lines.get(name, "").split()
        return _number(words[-1]) if words else default

    def color(self, name: str, default: Rgb) -> Rgb | None:
        """A colour; None if it is not an RGB triple."""
        words = self.lines.get(name, "").split()
        if not words:
            return default
        if words[0] in ("spectral", "xyz"):
            return None
        values = [_number(word) for word in words[:3]]
        return rgb(values if len(values) == 3 else values[:1] * 3)


def _number(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise SceneError(f"expected a number, got {word[:20]!r}")
    return value


def entries(text: str) -> dict[str, Entry]:
    """Materials of a library by name; of several with one name the first is used."""
    found: dict[str, Entry] = {}
    entry = None
    for line in joined_lines(text).splitlines():
        words = line.split(maxsplit=1)
        if len(words) == 2 and words[0].lower() == "newmtl":
            entry = Entry()
            found.setdefault(words[1].strip(), entry)
        elif len(words) == 2 and entry is not None:
            entry.lines[words[0].lower()] = words[1].strip()
    return found


@dataclass(frozen=True)
class MtlMap:
    """The name of an image and the options before it."""

    name: str
    options: dict[str, tuple[str, ...]]

    def pair(self, option: str, default: float) -> tuple[float, float]:
        values = [_number(word) for word in self.options.get(option, ())]
        values += [default] * (2 - len(values))
        return values[0], values[1]


def map_of(rest: str) -> MtlMap:
    """The options and the name of a line such as ``-s 2 2 1 -clamp on bricks old.png``.

    Vectors have one to three numbers, fewer if the name itself is a number; the name may contain spaces.
    """
    words = rest.split()
    options: dict[str, tuple[str, ...]] = {}
    at = 0
    while at < len(words) - 1 and (words[at].lower() in _FIXED or words[at].lower() in _VECTORS):
        name = words[at].lower()
        count = _FIXED.get(name, 0)
        if name in _VECTORS:
            while count < 3 and at + 2 + count < len(words) and _is_number(words[at + 1 + count]):
                count += 1
        options[name] = tuple(words[at + 1 : at + 1 + count])
        at += 1 + count
    # spaces of the name as in the line
    name = rest.split(maxsplit=at)[at] if at < len(words) else ""
    return MtlMap(name.strip().strip('"'), options)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _diffuse(line: str, rest: Texture, sources: Sources, where: str, report: LossReport) -> Texture:
    """The texture of a map; ``rest`` if its image is missing, which is reported.

    Raises:
        SceneError: the image cannot be read.
    """
    found = map_of(line)
    path = sources.known(found.name, where, report, "the picture", "the colour without it")
    return rest if path is None else _texture(found, read_image(path), path, where, report)


def _texture(
    found: MtlMap, image: Pixels, path: Path, where: str, report: LossReport, read: frozenset[str] = frozenset()
) -> ImageTexture:
    """The texture of an image: ``-s`` scales and ``-o`` offsets the coordinates, ``-clamp`` clamps them, and ``-mm``
    changes the values; options in ``read`` are used by the caller, and others are reported."""
    base, gain = found.pair("-mm", 1.0) if "-mm" in found.options else (0.0, 1.0)
    if (base, gain) != (0.0, 1.0):
        image = np.clip(base + gain * image, 0.0, None).astype(np.float32)
    for option in sorted(found.options.keys() - {"-s", "-o", "-clamp", "-mm"} - read):
        report.add(where, f"the option {option} of {found.name}")
    wrap: Literal["clamp", "repeat"] = "clamp" if found.options.get("-clamp") == ("on",) else "repeat"
    return ImageTexture(image, found.pair("-s", 1.0), found.pair("-o", 0.0), wrap, source=str(path))


def material_of(name: str, entry: Entry, sources: Sources, report: LossReport, facets: bool = False) -> Material:
    """A material of a library, for path tracing with ``facets``.

    Raises:
        SceneError: a number is invalid, or an image cannot be read.
    """
    where = f"material {name}"
    used = ("map_kd", *_UNUSED, *(_ALONG_PATHS if facets else ()))
    for keyword in entry.lines:
        if keyword.startswith(_MAPS) and keyword not in used:
            report.add(where, keyword)
    diffuse = entry.color("kd", (0.8, 0.8, 0.8))
    if diffuse is None:
        report.add(where, "a diffuse colour that is not RGB", "grey")
        diffuse = (0.5, 0.5, 0.5)
    texture: Texture = ConstantTexture(rgb(np.clip(diffuse, 0.0, 1.0)))
    if "map_kd" in entry.lines:
        texture = _diffuse(entry.lines["map_kd"], texture, sources, where, report)
    material = _reflecting(entry, texture, where, report)
    opacity = entry.number("d", 1.0 - entry.number("tr", 0.0))
    opacity = float(np.clip(opacity, 0.0, 1.0))
    if isinstance(material, Phong) and not facets:
        material = seen_through(material, opacity, where, report)
    emission = entry.color("ke", (0.0, 0.0, 0.0)) or (0.0, 0.0, 0.0)
    shining = glowing(material, rgb(np.maximum(emission, 0.0)), where, report)
    return _along_paths(shining, opacity, entry, sources, where, report) if facets else shining


def _along_paths(
    material: Material, opacity: float, entry: Entry, sources: Sources, where: str, report: LossReport
) -> Material:
    """A material with its normal map and its holes."""

    def named(keyword: str) -> tuple[MtlMap, Path | None]:
        found = map_of(entry.lines.get(keyword, ""))
        known = keyword in entry.lines
        return found, sources.known(found.name, where, report, "the picture") if known else None

    found, path = named("norm")
    if path is not None:
        normals = _texture(found, read_values(path), path, where, report, frozenset({"-bm"}))
        scale = _number(found.options["-bm"][0]) if found.options.get("-bm") else 1.0
        material = NormalMapped(material, normals, scale)
    found, path = named("map_d")
    if path is not None:
        channel = found.options.get("-imfchan", ("",))[0].lower()
        values = np.repeat(_channel(channel, path)[..., None], 3, axis=2) * np.float32(opacity)
        read = frozenset({"-imfchan"} if channel in _CHANNELS else ())
        return Masked(material, _texture(found, values, path, where, report, read))
    if opacity < 1.0 and not isinstance(material, Glass):
        return Masked(material, ConstantTexture(rgb(np.full(3, opacity))))
    return material


def _channel(name: str, path: Path) -> Pixels:
    """A channel ``(h, w)`` of an image by its name in ``_CHANNELS``; by another one alpha, or the brightness where that
    is 1 everywhere.

    Raises:
        SceneError: the image cannot be read.
    """
    values = read_values(path)
    if name in ("r", "g", "b"):
        return values[..., _CHANNELS.index(name)]
    alpha = np.ones((1, 1), np.float32) if name == "l" else read_alpha(path)
    return values.mean(axis=2) if name != "m" and (alpha == 1.0).all() else alpha


def _reflecting(entry: Entry, texture: Texture, where: str, report: LossReport) -> Material:
    """The material for the colours by ``illum``."""
    kind = int(entry.number("illum", -1))
    if "pm" in entry.lines or "pr" in entry.lines:
        metallic, roughness = (float(np.clip(entry.number(*part), 0.0, 1.0)) for part in (("pm", 0.0), ("pr", 0.5)))
        return metallic_rough(texture, scaled(texture, diffuse_share(metallic, roughness)), metallic, roughness)
    if kind == 0:
        if isinstance(texture, ConstantTexture):
            return Emissive(texture.value)
        report.add(where, "a surface without lighting (illum 0)", "a diffuse one")
        return Phong(texture)
    filtered = rgb(np.clip(entry.color("tf", (1.0, 1.0, 1.0)) or (1.0, 1.0, 1.0), 0.0, 1.0))
    if kind in (4, 6, 7, 9):
        ior = max(entry.number("ni", 1.5), 1.0)
        return Glass(transmittance=ConstantTexture(filtered), ior=ior, thin=kind in (4, 9) or ior == 1.0)
    diffuse = np.clip(mean_of(texture), 0.0, 1.0)
    specular = np.minimum(np.clip(entry.color("ks", (0.0, 0.0, 0.0)) or 0.0, 0.0, 1.0), 1.0 - diffuse)
    exponent = entry.number("ns", 0.0)
    if kind in (3, 5, 8) and specular.max() > 0.0:
        share = float(specular.max())
        grazing = 1.0 if kind == 5 else share
        return Phong(
            texture, (0.0, 0.0, 0.0), 1.0, fresnel_min=share, fresnel_max=grazing, mirror_tint=rgb(specular / share)
        )
    if exponent < 1.0 or kind == 1:  # a wider highlight is not visible as such
        return Phong(texture)
    return Phong(texture, rgb(specular), min(exponent, EXPONENT_MAX))
