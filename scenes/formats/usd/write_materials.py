"""Writer of materials and textures of a USD file: UsdPreviewSurface.

Exact are metallic-roughness surfaces, matte ones (of index 1), solid glass (opacity 0), holes (cut out: ``presence``),
normal maps and what only shines. All others become the nearest such surface, which is reported.

Source: OpenUSD documentation, UsdPreviewSurface specification 2.6.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenes.canonical import ConstantTexture, ImageTexture, Material, Rgb, Texture
from scenes.formats.appearance.indices import index_of_reflectance, reflectance_of_index
from scenes.formats.appearance.normals import map_of
from scenes.formats.appearance.pictured import factored, unmirrored
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.appearance.surfaces import Surface, surface_of
from scenes.formats.losses import LossReport
from scenes.formats.usd.document import ROOT, UsdStage, sharp
from scenes.models.usd_library import Gf, Sdf, UsdShade

_COORDINATES = "st"
_ONE = (1.0, 1.0, 1.0)


@dataclass
class UsdMaterialWriter:
    """Writes materials, each once."""

    document: UsdStage
    report: LossReport
    _folder: str = field(default=f"{ROOT}/Materials", init=False)

    def material(self, material: Material, emission: Rgb | None, where: str) -> Any:
        """The prim of a material.

        Args:
            material: material.
            emission: radiance of a lamp with this material; None for that of the material.
            where: place for messages.
        """
        key = "material", id(material), emission
        return self.document.once(key, material, lambda: self._material(material, emission, where))

    def _material(self, material: Material, emission: Rgb | None, where: str) -> Any:
        surface = surface_of(material, where, self.report)
        if surface.transmitted and not surface.thick:
            surface = self._pane(surface, where)
        stage = self.document.stage
        self.document.once("materials", None, lambda: stage.DefinePrim(self._folder, "Scope"))
        made = UsdShade.Material.Define(stage, self.document.path(f"{where}_material", self._folder))
        shader = UsdShade.Shader.Define(stage, f"{made.GetPath()}/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        made.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        _Shader(self.document, self.report, made, shader, surface, where).inputs(emission)
        return made

    def _pane(self, surface: Surface, where: str) -> Surface:
        """A pane, of which the format has none: what it reflects at normal incidence is a mirror, and the rest is not
        there."""
        straight = reflectance_of_index(grey(surface.ior), grey(0.0))[0]
        both = 2.0 * straight / (1.0 + straight)
        self.report.add(where, "a pane without thickness", f"a mirror that covers {both:.3g} of its surface")
        white = ConstantTexture(_ONE)
        return Surface(white, 1.0, 0.0, opacity=ConstantTexture(grey(both)), normals=surface.normals)


@dataclass
class _Shader:
    """Writes the inputs of one surface."""

    document: UsdStage
    report: LossReport
    material: Any
    shader: Any
    surface: Surface
    where: str

    def inputs(self, emission: Rgb | None) -> None:
        surface = self.surface
        factor, image = self._textured(surface.base)
        if max(factor) > 1.0 and image is None:
            self.report.add(self.where, f"a colour of {max(factor):.3g}", "1")
            factor = rgb(np.minimum(factor, 1.0))
        self._value("diffuseColor", "color3f", factor, image)
        parts, numbers = _ONE, None
        if surface.parts is not None:
            parts, numbers = self._textured(surface.parts)
        for name, share, channel in (("roughness", surface.roughness, "g"), ("metallic", surface.metallic, "b")):
            value = share * parts["rgb".index(channel)]
            self._value(name, "float", (value, value, value), numbers, channel, numbers=True)
        self._input("ior", "float", self._index())
        if surface.coat > 0.0:
            self._input("clearcoat", "float", surface.coat)
            self._input("clearcoatRoughness", "float", surface.coat_roughness)
        self._opacity()
        self._normals()
        self._emission(emission)

    def _index(self) -> float:
        """The index; a factor of the reflection is in it, and without one there is none (index 1)."""
        surface = self.surface
        if surface.specular in (0.0, 1.0):
            return surface.ior if surface.specular else 1.0
        straight = surface.specular * reflectance_of_index(grey(surface.ior), grey(0.0))[0]
        return index_of_reflectance(grey(min(straight, 0.9)))[0][0]

    def _opacity(self) -> None:
        surface = self.surface
        if surface.transmitted:
            self._input("opacity", "float", 0.0)
            self._input("opacityMode", "token", "transparent")
            if surface.opacity is not None:
                self.report.add(self.where, "holes in glass", "glass without holes")
            return
        if surface.opacity is None:
            return
        factor, image = self._textured(surface.opacity)
        values = np.array(factor) if image is None else image.image * np.array(factor)
        if np.ptp(values, axis=-1).any():
            self.report.add(self.where, "a coloured opacity", "the mean of its channels")
            means = np.repeat(values.mean(axis=-1, keepdims=True), 3, axis=-1)
            if image is None:
                factor = rgb(means)
            else:
                factor, image = _ONE, dataclasses.replace(image, image=means.astype(np.float32))
        self._value("opacity", "float", factor, image, "r", numbers=True)
        self._input("opacityMode", "token", "presence")
        if surface.cutoff is not None:
            self._input("opacityThreshold", "float", surface.cutoff)

    def _normals(self) -> None:
        if self.surface.normals is None:
            return
        _, image = self._textured(map_of(self.surface.normals))
        if image is None:  # a texture of textures, which is reported
            return
        scale = self.surface.normal_scale
        values = (2.0 * scale, 2.0 * scale, 2.0, 1.0), (-scale, -scale, -1.0, 0.0)
        self._connect("normal", "normal3f", image, "rgb", values, numbers=True)

    def _emission(self, emission: Rgb | None) -> None:
        radiance, glow = self.surface.emission, self.surface.glow
        if emission is not None:
            if max(radiance) > 0.0:
                self.report.add(self.where, "a lamp of a material that shines", "the lamp")
            radiance, glow = emission, None
        if max(radiance) <= 0.0:
            return
        factor, image = (_ONE, None) if glow is None else self._textured(glow)
        self._value("emissiveColor", "color3f", rgb(np.multiply(radiance, factor)), image)

    # --- textures ----------------------------------------------------------------------------------------------------

    def _textured(self, texture: Texture) -> tuple[Rgb, ImageTexture | None]:
        """A texture as a factor times a picture that is interpolated; beside a normal map pictures are not mirrored by
        their coordinates."""
        factor, image = factored(texture, self.where, self.report)
        if image is None:
            return factor, None
        given = image
        if given.filter == "nearest" and max(given.image.shape[:2]) > 1:
            self.report.add(self.where, "texels with sharp edges", "ones that are blurred at their edges")
            finer = self.document.once(("sharp", id(given.image)), given, lambda: sharp(given)).image
            image = dataclasses.replace(given, image=finer, filter="mipmap", source="")
        if self.surface.normals is not None and min(given.uv_scale) < 0.0:
            interpolated = image
            image = self.document.once(("mirrored", id(given)), given, lambda: unmirrored(interpolated))
        return factor, image

    def _value(
        self,
        name: str,
        kind: str,
        factor: Rgb,
        image: ImageTexture | None,
        channels: str = "rgb",
        numbers: bool = False,
    ) -> None:
        """Writes an input: a constant, or a factor times a picture."""
        if image is None:
            self._input(name, kind, factor if kind == "color3f" else factor[0])
        else:
            self._connect(name, kind, image, channels, ((*factor, 1.0), (0.0, 0.0, 0.0, 0.0)), numbers)

    def _input(self, name: str, kind: str, value: Any) -> None:
        self._set(self.shader, name, kind, value)

    def _set(self, shader: Any, name: str, kind: str, value: Any) -> None:
        made = value if isinstance(value, str | float | Sdf.AssetPath) else getattr(Gf, f"Vec{len(value)}f")(*value)
        shader.CreateInput(name, Sdf.ValueTypeNames.Find(kind)).Set(made)

    def _connect(
        self, name: str, kind: str, image: ImageTexture, channels: str, values: tuple[Any, Any], numbers: bool
    ) -> None:
        """Connects an input to a picture."""
        file, space = self.document.picture(image, numbers)
        reader = self._node(f"{name}Texture", "UsdUVTexture")
        self._set(reader, "file", "asset", Sdf.AssetPath(f"./{file}"))
        self._set(reader, "sourceColorSpace", "token", space)
        for axis in "ST":
            self._set(reader, f"wrap{axis}", "token", image.wrap)
        for part, value, plain in zip(("scale", "bias"), values, (1.0, 0.0), strict=True):
            if any(one != plain for one in value):
                self._set(reader, part, "float4", value)
        output = "Float3" if channels == "rgb" else "Float"
        made = reader.CreateOutput(channels, getattr(Sdf.ValueTypeNames, output))
        reader.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(self._coordinates(image))
        self.shader.CreateInput(name, Sdf.ValueTypeNames.Find(kind)).ConnectToSource(made)

    def _coordinates(self, image: ImageTexture) -> Any:
        """The output of the texture coordinates, with the transform of a picture."""
        made = self.document.once(("st", str(self.material.GetPath())), None, self._plain_coordinates)
        if (image.uv_scale, image.uv_offset) == ((1.0, 1.0), (0.0, 0.0)):
            return made
        key = "st", str(self.material.GetPath()), image.uv_scale, image.uv_offset
        return self.document.once(key, None, lambda: self._changed_coordinates(made, image))

    def _plain_coordinates(self) -> Any:
        node = self._node("coordinates", "UsdPrimvarReader_float2")
        self._set(node, "varname", "string", _COORDINATES)
        return node.CreateOutput("result", Sdf.ValueTypeNames.Float2)

    def _changed_coordinates(self, before: Any, image: ImageTexture) -> Any:
        node = self._node("transform", "UsdTransform2d")
        node.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(before)
        self._set(node, "scale", "float2", image.uv_scale)
        self._set(node, "translation", "float2", image.uv_offset)
        return node.CreateOutput("result", Sdf.ValueTypeNames.Float2)

    def _node(self, name: str, kind: str) -> Any:
        path = self.document.path(name, str(self.material.GetPath()))
        made = UsdShade.Shader.Define(self.document.stage, path)
        made.CreateIdAttr(kind)
        return made
