"""Textures and materials of LuxCore that LuxRender 1.x lacks, or has under other names.

Source: LuxCore SDK reference manual (wiki of LuxCoreRender), section on materials; Burley 2012 (Disney's).
"""

from __future__ import annotations

import numpy as np

from scenes.canonical import ConstantTexture, Masked, Material, MetallicRough, Texture
from scenes.formats.appearance.folding import mean_of, product_of
from scenes.formats.appearance.spectra import grey
from scenes.formats.directives.names import Of
from scenes.formats.directives.surfaces import Maker
from scenes.formats.directives.syntax import Parameters
from scenes.formats.luxrender.read_materials import LuxSurfaces

MATERIALS = {
    "roughmatte": "matte",
    "archglass": "glass",
    "glossy2": "glossy",
    "roughmattetranslucent": "mattetranslucent",
}
"""Kinds of materials with other names in LuxRender."""

TEXTURES = {
    "constfloat1": "constant", "constfloat3": "constant", "checkerboard2d": "checkerboard",
    "checkerboard3d": "checkerboard", "fresnelpreset": "preset", "fresnelconst": "const",
}  # fmt: skip
"""Kinds of textures with other names in LuxRender."""

DEFAULTS: dict[str, dict[str, tuple[float, ...]]] = {
    "matte": {"Kd": (0.75, 0.75, 0.75)}, "metal2": {"uroughness": (0.1,), "vroughness": (0.1,)},
    "roughglass": {"uroughness": (0.1,), "vroughness": (0.1,)},
    "mattetranslucent": {"Kr": (0.5, 0.5, 0.5), "Kt": (0.5, 0.5, 0.5)},
}  # fmt: skip
"""Defaults that are not LuxRender's."""


_BLACKBODY = 89_160.0
"""Ratio of LuxCore 2.10's black bodies to those of ``normalize``, whose spectrum is at most 1 (measured at 2000, 3000
and 6500 K)."""


class LuxCoreSurfaces(LuxSurfaces):
    """Reader of textures and materials of LuxCore."""

    def makers(self) -> dict[str, Maker]:
        return {**super().makers(), "disney": self._disney, "twosided": self._one_of, "glossycoating": self._base}

    def base_colors(self) -> dict[str, str]:
        return dict.fromkeys(("carpaint", "velvet", "cloth", "glossytranslucent"), "Kd")

    def masked(self, material: Material, parameters: Parameters) -> Material:
        """The material with the opacity that LuxCore calls transparency."""
        if "transparency" not in parameters:
            return material
        return Masked(material, self.texture(parameters, "transparency", grey(1.0), "float"))

    def material(self, kind: str, parameters: Parameters) -> Material:
        return self.masked(super().material(kind, parameters), parameters)

    def made_texture(self, kind: str, parameters: Parameters, of: Of) -> Texture:
        made = super().made_texture(kind, parameters, of)
        if kind != "blackbody" or parameters.truth("normalize", False):
            return made
        return product_of(made, ConstantTexture(grey(_BLACKBODY)))

    def _disney(self, parameters: Parameters) -> Material:
        where = str(parameters.place)
        base = self.texture(parameters, "basecolor", grey(0.5))
        values = [self._share(parameters, name) for name in ("metallic", "roughness", "clearcoat", "clearcoatgloss")]
        metallic, roughness, coat, gloss = values
        specular = 0.08 * self._share(parameters, "specular")
        index = (1.0 + np.sqrt(specular)) / (1.0 - np.sqrt(specular))
        self.report.add(where, "material 'disney'", "a metallic-roughness surface, matte below")
        for name in ("subsurface", "speculartint", "anisotropic", "sheen", "sheentint"):
            found = self.texture(parameters, name, grey(0.0), "float")
            if max(mean_of(found)) > 0.0:
                self.report.add(where, f"{name} of the material 'disney'")
        return MetallicRough(base, metallic, roughness, None, float(index), coat, 1.0 - gloss)

    def _share(self, parameters: Parameters, name: str) -> float:
        return min(max(self.scalar(parameters, name, 0.0), 0.0), 1.0)

    def _one_of(self, parameters: Parameters) -> Material:
        self.report.add(str(parameters.place), "another material at the back", "that of the front")
        parameters.asked.add("backmaterial")
        return self.named(parameters.text("frontmaterial", ""), str(parameters.place))

    def _base(self, parameters: Parameters) -> Material:
        self.report.add(str(parameters.place), "material 'glossycoating'", "the material below the coat")
        parameters.asked.update(parameters.given)
        return self.named(parameters.text("base", ""), str(parameters.place))
