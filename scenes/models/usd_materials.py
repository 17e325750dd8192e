"""Materials of a USD file: UsdPreviewSurface in the terms of glTF, which :mod:`scenes.models.gltf_materials` converts.

Source: OpenUSD documentation, UsdPreviewSurface specification.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from scenes.formats.losses import LossReport
from scenes.models.gltf_textures import multiplied
from scenes.models.usd_library import Ar, Sdf, UsdShade
from scenes.models.usd_motion import UsdMotion
from scenes.models.usd_textures import WRAPS, Make, Pictures, Reading, UsdDocument
from scenes.models.usd_values import finite, note_animated
from scenes.pictures import Pixels

_NUMBERS = {"metallic": 0.0, "roughness": 0.5, "opacity": 1.0, "opacityThreshold": 0.0, "ior": 1.5, "clearcoat": 0.0,
            "clearcoatRoughness": 0.01, "useSpecularWorkflow": 0, "displacement": 0.0, "occlusion": 1.0}  # fmt: skip
_COLORS = {"diffuseColor": (0.18, 0.18, 0.18), "emissiveColor": (0.0, 0.0, 0.0), "specularColor": (0.0, 0.0, 0.0),
           "normal": (0.0, 0.0, 1.0)}  # fmt: skip
_TEXTURED = ("diffuseColor", "emissiveColor", "normal", "metallic", "roughness", "opacity")
_BLACK_MOST = 0.02
_REPEAT = WRAPS["repeat"]
_DISPLAYED = {"name": "no material", "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.5}}


class UsdMaterials:
    """Reads materials, each once.

    Attributes:
        document: materials in the terms of glTF.
    """

    def __init__(self, document: UsdDocument, pictures: Pictures, motion: UsdMotion, report: LossReport) -> None:
        self.document, self.pictures, self.report = document, pictures, report
        self.code, self.pose = motion.code, motion.pose
        self._names: list[str] = []
        self._numbers: dict[str, tuple[int, str]] = {}
        self._wraps: dict[Reading, tuple[int, int]] = {}

    def number(self, material: Any, both_sides: bool = False) -> tuple[int, str]:
        """The number of a material (None for that of a mesh without one), and the primvar of colours that it uses.

        A material that shines differs on shapes with both sides and on those with one.
        """
        key = "" if material is None else str(material.GetPath())
        if key not in self._numbers:
            described = None if material is None else self._described(material)
            properties, colors = described or (_DISPLAYED, "displayColor")
            self._numbers[key] = self._add(properties), colors
        number, colors = self._numbers[key]
        properties = self.document.materials[number]
        if not both_sides or "emissiveTexture" in properties or not any(properties.get("emissiveFactor", ())):
            return number, colors
        if f"{key}|" not in self._numbers:
            self._numbers[f"{key}|"] = self._add({**properties, "doubleSided": True}), colors
        return self._numbers[f"{key}|"]

    def _add(self, properties: dict[str, Any]) -> int:
        self.document.materials.append(properties)
        return len(self.document.materials) - 1

    def coordinates(self, number: int) -> dict[int, str]:
        """Numbers and primvars of the texture coordinates of a material."""
        used: set[int] = set()

        def look(part: Any) -> None:
            if isinstance(part, dict):
                used.update([part["texCoord"]] if "texCoord" in part else [])
                for value in part.values():
                    look(value)

        look(self.document.materials[number])
        return {index: self._names[index] for index in sorted(used)}

    def _described(self, material: Any) -> tuple[dict[str, Any], str] | None:
        where = f"material {material.GetPrim().GetName()}"
        shader = material.ComputeSurfaceSource()[0]
        kind = shader.GetShaderId() if shader else None
        if kind != "UsdPreviewSurface":
            self.report.add(where, f"a surface of kind {kind or 'none'}", "the displayed colour")
            return None
        given = {name: self._value(shader, name, rest, where) for name, rest in {**_NUMBERS, **_COLORS}.items()}
        for name, value in given.items():
            if isinstance(value, Reading) and name not in _TEXTURED:
                self.report.add(where, f"a texture of {name}")
                given[name] = {**_NUMBERS, **_COLORS}[name]
        if not isinstance(given["normal"], Reading) and tuple(given["normal"]) != _COLORS["normal"]:
            self.report.add(where, "a normal that is no picture", "that of the surface")
        if given["occlusion"] != 1.0:
            self.report.add(where, "occlusion")
        made, colors = self._as_gltf(given, where)
        if (
            given["opacityThreshold"] <= 0.0
            and str(self._constant(shader, "opacityMode") or "transparent") == "transparent"
        ):
            if given["opacity"] != 0.0 and given["opacity"] != 1.0:
                self.report.add(where, "highlights where a surface is clear (opacityMode transparent)", "none there")
            elif given["opacity"] == 0.0:
                made["extensions"] |= {"KHR_materials_transmission": {"transmissionFactor": 1.0},
                                       "KHR_materials_volume": {"thicknessFactor": 1.0}}  # fmt: skip
                del made["alphaMode"]
        return made, colors

    def _as_gltf(self, given: dict[str, Any], where: str) -> tuple[dict[str, Any], str]:
        colors = ""
        base, metallic = given["diffuseColor"], given["metallic"]
        if given["useSpecularWorkflow"]:
            base, metallic = self._without_specular(given, where)
        if isinstance(base, str):
            colors, base = base, (1.0, 1.0, 1.0)
        rough: dict[str, Any] = {"baseColorFactor": [1.0, 1.0, 1.0, 1.0]}
        made: dict[str, Any] = {"name": where.removeprefix("material "), "pbrMetallicRoughness": rough}
        opacity = given["opacity"]
        if isinstance(base, Reading) or isinstance(opacity, Reading):
            rough["baseColorTexture"] = self._base(base, opacity, where)
        if not isinstance(base, Reading):
            rough["baseColorFactor"][:3] = [float(part) for part in base]
        if not isinstance(opacity, Reading):
            rough["baseColorFactor"][3] = float(opacity)
        if isinstance(opacity, Reading) or opacity < 1.0:
            cutoff = float(given["opacityThreshold"])
            made |= {"alphaMode": "MASK", "alphaCutoff": cutoff} if cutoff > 0.0 else {"alphaMode": "BLEND"}
        self._facets(rough, metallic, given["roughness"], where)
        if isinstance(given["normal"], Reading):
            reading = given["normal"]
            made["normalTexture"] = self._info(reading, lambda: 0.5 * self.pictures.values(reading) + np.float32(0.5))
        glow = given["emissiveColor"]
        if isinstance(glow, Reading):
            made |= {"emissiveFactor": [1.0, 1.0, 1.0], "emissiveTexture": self._plain_info(glow)}
        else:
            made["emissiveFactor"] = [float(part) for part in glow]
        made["extensions"] = {"KHR_materials_ior": {"ior": float(given["ior"])}}
        if given["clearcoat"] > 0.0:
            coat = {"clearcoatFactor": given["clearcoat"], "clearcoatRoughnessFactor": given["clearcoatRoughness"]}
            made["extensions"]["KHR_materials_clearcoat"] = coat
        if given["displacement"] != 0.0:
            self.report.add(where, "displacement")
        return made, colors

    def _without_specular(self, given: dict[str, Any], where: str) -> tuple[Any, float]:
        """Base colour and metallic share of a surface with a specular colour: metal if it is black otherwise."""
        base = given["diffuseColor"]
        black = not isinstance(base, Reading | str) and max(base) <= _BLACK_MOST
        self.report.add(where, "a specular workflow", "metal of the specular colour" if black else "a dielectric")
        return (given["specularColor"], 1.0) if black else (base, 0.0)

    def _base(self, base: Any, opacity: Any, where: str) -> dict[str, Any]:
        """The texture of the base colour, with that of the opacity."""
        if not isinstance(base, Reading):
            return self._info(opacity, lambda: np.ones((1, 1, 3), np.float32), lambda: self.pictures.values(opacity))
        if isinstance(opacity, Reading) and opacity.place != base.place:
            self.report.add(where, "a texture of the opacity at other coordinates than the colour", "opaque")
            opacity = 1.0
        through = (lambda: self.pictures.values(opacity)) if isinstance(opacity, Reading) else None
        return self._info(base, lambda: self.pictures.values(base), through)

    def _facets(self, rough: dict[str, Any], metallic: Any, roughness: Any, where: str) -> None:
        """Roughness and metallic share, whose textures become one."""
        read = [value for value in (roughness, metallic) if isinstance(value, Reading)]
        if len({one.place for one in read}) > 1:
            self.report.add(where, "a texture of the metallic share at other coordinates than the roughness", "0")
            metallic, read = 0.0, read[:1]
        rough["metallicFactor"] = 1.0 if isinstance(metallic, Reading) else float(metallic)
        rough["roughnessFactor"] = 1.0 if isinstance(roughness, Reading) else float(roughness)
        if not read:
            return

        def both() -> Pixels:
            one = np.ones((1, 1, 3), np.float32)
            first, second = (
                self.pictures.values(value) if isinstance(value, Reading) else one for value in (roughness, metallic)
            )
            parts = multiplied(first, np.ones_like(second)), multiplied(np.ones_like(first), second)
            return np.stack([np.ones_like(parts[0][..., 0]), parts[0][..., 0], parts[1][..., 0]], axis=-1)

        rough["metallicRoughnessTexture"] = self._info(read[0], both)

    def _plain_info(self, reading: Reading) -> dict[str, Any]:
        return self._info(reading, lambda: self.pictures.values(reading))

    def _info(self, reading: Reading, make: Make, opacity: Make | None = None) -> dict[str, Any]:
        """A reference to a new texture at the coordinates of a reading.

        glTF has ``v`` downwards; with coordinates ``(s, -t)`` its transform is that of USD but for the offset.
        """
        self.document.textures.append((make, opacity, self._wraps.get(reading, (_REPEAT, _REPEAT))))
        coordinates, (scale, turn_deg, offset) = reading.place[:2]
        change = {"offset": [offset[0], 1.0 - offset[1]], "rotation": math.radians(turn_deg), "scale": list(scale)}
        return {
            "index": len(self.document.textures) - 1,
            "texCoord": coordinates,
            "extensions": {"KHR_texture_transform": change},
        }

    def _value(self, shader: Any, name: str, rest: Any, where: str) -> Any:
        """A constant, the reading of a texture, or the name of a primvar of colours."""
        found = self._constant(shader, name)
        source = self._connected(shader, name)
        if source is None:
            return rest if found is None else found
        kind, output = source[0].GetShaderId(), source[1]
        if kind == "UsdUVTexture":
            path = self._file(source[0], where)
            return self._fallback(source[0], output, name) if path is None else self._reading(*source, path, where)
        if kind in ("UsdPrimvarReader_float3", "UsdPrimvarReader_float4") and name == "diffuseColor":
            return str(self._constant(source[0], "varname") or "displayColor")
        self.report.add(where, f"{name} of a node {kind or 'without kind'}", "its default")
        return rest

    def _constant(self, shader: Any, name: str) -> Any:
        """The value of an input, through the interfaces of materials and groups; None if there is none.

        Raises:
            SceneError: it has numbers that are not finite.
        """
        given = shader.GetInput(name)
        for attribute in UsdShade.Utils.GetValueProducingAttributes(given) if given else ():
            if not UsdShade.Output.IsOutput(attribute):
                note_animated(attribute.GetPrim(), self.pose)
                found = attribute.Get(self.code)
                return None if isinstance(found, Sdf.AssetPath) else finite(found, attribute.GetPath())
        return None

    def _connected(self, shader: Any, name: str) -> tuple[Any, str] | None:
        """The shader whose output an input reads, and the name of the output."""
        given = shader.GetInput(name)
        for attribute in UsdShade.Utils.GetValueProducingAttributes(given) if given else ():
            if UsdShade.Output.IsOutput(attribute):
                return UsdShade.Shader(attribute.GetPrim()), attribute.GetName().partition(":")[2]
        return None

    def _fallback(self, shader: Any, channels: str, name: str) -> Any:
        """The value of an input whose picture is missing, by default that of UsdUVTexture."""
        given = [float(part) for part in self._constant(shader, "fallback") or (0.0, 0.0, 0.0, 1.0)]
        parts = 3 * (given["rgba".index(channels)],) if channels in tuple("rgba") else tuple(given[:3])
        return parts[0] if name in _NUMBERS else parts

    def _reading(self, shader: Any, channels: str, path: str, where: str) -> Reading:
        """What a UsdUVTexture reads."""
        scale, bias = (self._constant(shader, name) for name in ("scale", "bias"))
        wraps = tuple(str(self._constant(shader, name) or "black") for name in ("wrapS", "wrapT"))
        reading = Reading(
            path,
            channels,
            str(self._constant(shader, "sourceColorSpace") or "auto"),
            (1.0, 1.0, 1.0, 1.0) if scale is None else tuple(map(float, scale)),
            (0.0, 0.0, 0.0, 0.0) if bias is None else tuple(map(float, bias)),
            (*self._coordinates(shader, where), wraps),
        )
        self._wraps[reading] = WRAPS.get(wraps[0], WRAPS["black"]), WRAPS.get(wraps[1], WRAPS["black"])
        return reading

    def _file(self, shader: Any, where: str) -> str | None:
        """The resolved path of the picture of a UsdUVTexture; None if it is missing, which is reported."""
        name, given = "", shader.GetInput("file")
        for attribute in UsdShade.Utils.GetValueProducingAttributes(given) if given else ():
            note_animated(attribute.GetPrim(), self.pose)
            found = attribute.Get(self.code)
            if isinstance(found, Sdf.AssetPath):
                name, path = found.path, found.resolvedPath
                if "<UDIM>" in found.path:
                    self.report.add(where, "tiles of a texture", "the first one")
                    layer = attribute.GetPropertyStack(self.code)[0].layer
                    name = found.path.replace("<UDIM>", "1001")
                    path = str(Ar.GetResolver().Resolve(layer.ComputeAbsolutePath(name)))
                if path:
                    return path
        known = self.document.sources.known(name, where, self.report, "the picture", "its fallback")
        return None if known is None else str(known)

    def _coordinates(self, shader: Any, where: str) -> tuple[int, tuple[Any, ...]]:
        """The number of the texture coordinates, and their scale, rotation in degrees and offset."""
        change: tuple[Any, ...] = (1.0, 1.0), 0.0, (0.0, 0.0)
        source = self._connected(shader, "st")
        if source is not None and source[0].GetShaderId() == "UsdTransform2d":
            scale, turn_deg, offset = (self._constant(source[0], name) for name in ("scale", "rotation", "translation"))
            change = (
                (1.0, 1.0) if scale is None else (float(scale[0]), float(scale[1])),
                float(turn_deg or 0.0),
                (0.0, 0.0) if offset is None else (float(offset[0]), float(offset[1])),
            )
            source = self._connected(source[0], "in")
        name = "st"
        if source is None:
            self.report.add(where, "a picture without texture coordinates", "those of the primvar st")
        else:
            if source[0].GetShaderId() != "UsdPrimvarReader_float2":
                self.report.add(where, f"texture coordinates of a node {source[0].GetShaderId()}", "the primvar st")
            name = str(self._constant(source[0], "varname") or "st")
        if name not in self._names:
            self._names.append(name)
        return self._names.index(name), change
