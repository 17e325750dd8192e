"""Writer of textures and materials of LuxRender 1.x files.

Source: LuxRender scene file format 1.0 (wiki of LuxRender); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import (
    Bumped,
    ConstantTexture,
    Glass,
    Glossy,
    ImageTexture,
    Masked,
    Material,
    Matte,
    Metal,
    Mirror,
    MixMaterial,
    Phong,
    Plastic,
    Rgb,
    Texture,
    Translucent,
    Uber,
)
from scenes.formats.appearance.facets import Facets
from scenes.formats.appearance.folding import is_binary, mean_of, product_of, within_one
from scenes.formats.appearance.indices import reflectance_of_index
from scenes.formats.appearance.mixtures import NOTHING, added_coat, dimmed, is_nothing, lets_through, lobes_of
from scenes.formats.appearance.spectra import METALS, grey, rgb
from scenes.formats.directives.surface_writer import Kind, SurfaceWriter, mixture_line
from scenes.formats.directives.textures import Pair
from scenes.formats.geometry.conventions import first_row_below
from scenes.formats.text.numbers import listed, number

_REFLECTANCES = ("Kd", "Ks", "Kr", "Kt")
_METAL_NAMES = {"Ag": "silver", "Al": "aluminium", "Au": "gold", "Cu": "copper"}


class LuxSurfaceWriter(SurfaceWriter):
    """Collects the lines of textures and materials."""

    color_texture = "color"
    distribution = "LuxRender's own"
    color = "color"
    checkerboard_end = ' "integer dimension" [ 2 ] "string mapping" [ "uv" ]'
    _null: Matte | None = None

    def constant(self, name: str, value: Rgb, kind: Kind = "color") -> str:
        """A constant parameter; LuxRender and LuxCore take reflectances above 1 for 1."""
        bounded = kind == "color" and name in _REFLECTANCES
        return super().constant(name, within_one(value, name, self.report) if bounded else value, kind)

    def image_line(self, texture: ImageTexture) -> str:
        image, scale, offset = self._placed_alike(texture)
        file = self.output.picture(image, texture.source, (".exr",))
        levels = {"nearest": "nearest", "bilinear": "bilinear", "mipmap": "mipmap_ewa"}[texture.filter]
        more = f'"string filtertype" [ "{levels}" ] "float gamma" [ 1 ] '
        return self.placed_image(file, texture, more, scale, offset)

    def _placed_alike(self, texture: ImageTexture) -> tuple[NDArray[np.float32], Pair, Pair]:
        """Image, scale and offset with which LuxRender and LuxCore draw a texture alike, as far as there are any.

        LuxCore 2.10 takes the offset along u for both directions, always repeats images and always blends texels. The
        rows of an image that is repeated are moved, so that both offsets are the same.
        """
        where, image = f"texture {texture.source or 'picture'}", texture.image
        scale, offset = first_row_below(texture.uv_scale, texture.uv_offset)
        if image.shape[:2] == (1, 1):
            return image, scale, offset
        if texture.filter == "nearest":
            self.report.add(where, "texels with sharp edges", "blended in LuxCore")
        if texture.wrap != "repeat":
            self.report.add(where, f"what lies beyond the edges of a picture ({texture.wrap})", "repeated in LuxCore")
        rows = (offset[1] - offset[0]) * len(image)
        if texture.wrap == "repeat" and abs(rows - round(rows)) < 1e-3:
            if round(rows) % len(image):
                image, offset = np.roll(image, -round(rows), axis=0), (offset[0], offset[0])
        elif abs(rows - len(image) * round(rows / len(image))) > 1e-3:
            self.report.add(where, "an offset along v that is not that along u", "that along u in LuxCore")
        return image, scale, offset

    def material_line(self, material: Material, name: str) -> str:
        where = f"material {name!r}"
        if isinstance(material, Bumped):
            return self.bumped_line(material, name, "bumpmap")
        if isinstance(material, Uber):
            material = lobes_of(material, where, self.report, schlick=True)
        if isinstance(material, Masked):
            material = MixMaterial(self.nothing(), material.base, material.opacity)
        elif isinstance(material, Plastic) and not material.layered:
            material = added_coat(material)
        elif isinstance(material, Metal) and _even(material.reflectance_scale):
            material = dimmed(material)
        if isinstance(material, MixMaterial):
            self._lose_light_of_mixture(material, where)
            first, second = self.material(material.first), self.material(material.second)
            if isinstance(material.amount, ConstantTexture) and len(set(material.amount.value)) > 1:
                self.report.add(where, "a mixture with a share for each colour", "by their mean")
            return mixture_line(first, second, self.texture(material.amount, "amount", "float"))
        return super().material_line(material, name)

    def _lose_light_of_mixture(self, material: MixMaterial, where: str) -> None:
        """LuxCore 2.10 lets a share of the rays through a mixture with holes or panes, and weights the light that it
        samples at the others by the share of their part once more."""
        parts = [NOTHING if part is self._null else part for part in (material.first, material.second)]
        if any(map(lets_through, parts)) and not is_binary(material.amount) and not all(map(_is_sharp, parts)):
            self.report.add(where, "light on a part of a mixture with holes or panes", "darker by its share in LuxCore")

    def nothing(self) -> Material:
        """An invisible surface."""
        if self._null is None:
            self._null = Matte(ConstantTexture((0.0, 0.0, 0.0)))
            self.define(self._null, self.label("m", "nothing"), '"string type" [ "null" ]')
        return self._null

    def plain_material(self, material: Material, where: str) -> tuple[str, list[str]]:
        if isinstance(material, Glass):
            return self._glass(material, where)
        if isinstance(material, Metal):
            return self._metal(material, where)
        if isinstance(material, Translucent):
            # LuxCore assumes energy conservation whatever the file says
            kept = 1.0 - np.array(mean_of(material.reflectance))
            if isinstance(material.reflectance, ConstantTexture) and (kept > 1e-6).all():
                through = product_of(material.transmittance, ConstantTexture(rgb(1.0 / kept)))
            else:
                through = material.transmittance
                self.report.add(where, "what a textured translucent surface lets through", "less what it reflects")
            sides = [self.texture(material.reflectance, "Kr"), self.texture(through, "Kt")]
            return "mattetranslucent", [*sides, '"bool energyconserving" [ "true" ]']
        if isinstance(material, Glossy | Plastic | Phong):
            return self._coated(material, where)
        if isinstance(material, Matte) and material.sigma_deg:
            what = f"a roughness of {material.sigma_deg:g} degrees"
            self.report.add(where, what, f"as much in LuxRender, {material.sigma_deg:g} radians in LuxCore")
        return super().plain_material(material, where)

    def _coated(self, material: Glossy | Plastic | Phong, where: str) -> tuple[str, list[str]]:
        """A material that is, or is replaced by, a coat over a diffuse base."""
        if isinstance(material, Glossy):
            parts = material.diffuse, material.specular, Facets(material.roughness, material.alpha)
        elif isinstance(material, Plastic):
            fresnel = ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
            coat = ConstantTexture(rgb(fresnel * np.array(mean_of(material.specular))))
            alpha = max(material.roughness, 1e-3)
            parts = material.diffuse, coat, Facets((alpha, alpha), material.alpha)
            self.report.add(
                where, "plastic", f"glossy that reflects {fresnel:.3g} of its highlight at normal incidence"
            )
        else:
            alpha = math.sqrt(2.0 / (material.exponent + 2.0))
            mirror = np.array(material.specular) + material.fresnel_min * np.array(material.mirror_tint)
            parts = material.diffuse, ConstantTexture(rgb(mirror)), Facets((alpha, alpha))
            self.report.add(where, "Phong reflection with a Fresnel-weighted mirror", f"glossy of alpha {alpha:.3g}")
        textures = [self.texture(parts[0], "Kd"), self.texture(parts[1], "Ks"), self.facets(parts[2])]
        return "glossy", [*textures, '"bool multibounce" [ "false" ]']

    def _glass(self, material: Glass, where: str) -> tuple[str, list[str]]:
        if material.spread_deg:
            self.report.add(where, "rays spread about the perfect ones", "clear glass")
        parts = [self.texture(material.reflectance, "Kr"), self.texture(material.transmittance, "Kt")]
        parts.append(f'"float index" [ {number(material.ior)} ]')
        if material.roughness != (0.0, 0.0):
            return "roughglass", [*parts, self.facets(material)]
        if material.thin and not material.front_only:
            front = reflectance_of_index(grey(material.ior), grey(0.0))[0]
            became = (
                f"one in LuxCore that reflects {front:.3g} at its front and lets all through, and nothing at its back"
            )
            self.report.add(where, "a pane", became)
        return "glass", [*parts, f'"bool architectural" [ "{str(material.thin).lower()}" ]']

    def _metal(self, material: Metal, where: str) -> tuple[str, list[str]]:
        """A metal: a preset if it is one, else by its colour at normal incidence."""
        label = self.label("t")
        known = (_METAL_NAMES.get(name) for name, index in METALS.items() if index == (material.eta, material.k))
        preset, plain = next(known, ""), mean_of(material.reflectance_scale) == (1.0, 1.0, 1.0)
        if preset and plain:
            self.definitions.append(f'\tTexture "{label}" "fresnel" "preset" "string name" [ "{preset}" ]')
        else:
            color = np.array(reflectance_of_index(material.eta, material.k)) * mean_of(material.reflectance_scale)
            self.definitions.append(f'\tTexture "{label}" "fresnel" "fresnelcolor" "color Kr" {listed(color)}')
            what = "the complex index of a metal" if material.k != (0.0, 0.0, 0.0) else "the index of a metal"
            self.report.add(where, what, "its colour at normal incidence, which LuxCore draws brighter")
        return "metal2", [f'"texture fresnel" [ "{label}" ]', self.facets(material)]


def _is_sharp(material: Material) -> bool:
    """Whether a surface is invisible, or mirrors and refracts alone."""
    if isinstance(material, Metal | Glass):
        return material.roughness == (0.0, 0.0)
    return is_nothing(material) or isinstance(material, Mirror)


def _even(scale: Texture) -> bool:
    """Whether a factor is below one and equal for all colours."""
    return isinstance(scale, ConstantTexture) and len(set(scale.value)) == 1 and scale.value[0] < 1.0
