"""Parts of a LuxCore scene as directives of LuxRender 1.x, which LuxCore's own parser turns into these parts.

Source: the properties that ``ParseLXS`` of LuxCore 2.10 makes of a LuxRender file.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from pathlib import Path

import numpy as np

from scenes.arithmetic import product
from scenes.formats.directives.syntax import Directive, Values
from scenes.formats.luxcore.syntax import Block, Property
from scenes.formats.luxrender.read import LUMINANCE
from scenes.formats.text.places import TextPosition

NAMES = {
    "kd": "Kd", "ks": "Ks", "kr": "Kr", "kt": "Kt", "ka": "Ka", "material1": "namedmaterial1", "base": "base",
    "material2": "namedmaterial2", "texture1": "tex1", "texture2": "tex2", "file": "filename", "filter": "filtertype",
    "fieldofview": "fov", "bumptex": "bumpmap",
}  # fmt: skip
"""Names of parameters that differ in LuxRender."""

TEXTS = frozenset(
    "type file filter wrap material1 material2 base frontmaterial backmaterial fresnel name mapfile iesfile "
    "mapping.type channel colorspace colorspace.config shape".split()
)
"""Properties that are words."""

_SCALARS = frozenset("uroughness vroughness sigma amount index cauchyb d gamma temperature".split())
"""Properties that are one number, for which LuxCore takes the luminance of a colour."""

_ANY_COUNT = frozenset("vertices faces normals uvs".split())


def texts(**given: str) -> list[Values]:
    """Parameters of one word each."""
    return [value for name, word in given.items() for value in ((f"string {name}",), (word,))]


def numbers(name: str, *values: float) -> list[Values]:
    """A parameter of numbers."""
    return [(f"{'color' if len(values) == 3 else 'float'} {name}",), np.array(values, np.float64)]


def parameters(block: Block, textures: Container[str], names: Mapping[str, str] = NAMES) -> list[Values]:
    """The properties of a block as parameters; a word that is not a number names a texture."""
    return [value for rest, found in block.items() for value in _parameter(rest, found, textures, names)]


def _parameter(rest: str, found: Property, textures: Container[str], names: Mapping[str, str]) -> list[Values]:
    name = names.get(rest, rest)
    if rest in ("multibounce", "normalize"):
        return [(f"bool {name}",), (str(found.word() in ("1", "true")).lower(),)]
    if rest in TEXTS:
        return texts(**{name: found.word()})
    if not found.is_number or (found.text in textures):
        return [(f"texture {name}",), (found.words()[0] if found.words() else "",)]
    values = found.numbers()
    if rest in _SCALARS and len(values) == 3:
        values = np.array([product(LUMINANCE, values)])
    return [(f"{'color' if len(values) == 3 and rest not in _ANY_COUNT else 'float'} {name}",), values]


def directive(name: str, words: tuple[str, ...], values: list[Values], place: TextPosition, file: Path) -> Directive:
    """A directive with its words and parameters."""
    return Directive(name, (*((word,) for word in words), *values), place, file)
