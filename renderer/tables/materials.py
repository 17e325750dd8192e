"""Materials and textures of a scene as rows of the tables that kernels read."""

from __future__ import annotations

import dataclasses
import weakref

import numpy as np
import torch
import warp as wp

from renderer.layout.kinds import Filter, TextureKind, Wrap
from renderer.tables.checks import check_finite, check_light
from renderer.tables.scattering import scatter_row, unwrapped
from scenes.arithmetic import cos
from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    Emissive,
    Glass,
    HeightField,
    ImageTexture,
    Material,
    Matte,
    Mirror,
    Phong,
    SceneError,
    Texture,
)

_WRAPS = {"repeat": Wrap.REPEAT, "clamp": Wrap.CLAMP, "black": Wrap.BLACK}
_FILTERS = {"nearest": Filter.NEAREST, "bilinear": Filter.BILINEAR, "mipmap": Filter.MIPMAP}
_WHITE, _BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


def mip_levels(image: np.ndarray) -> list[np.ndarray]:
    """Mip map of an image: each level is the area average of the one before, down to one texel.

    Args:
        image: ``(height, width, 3)`` float32.

    Returns:
        Levels from the full image on; sides are halved and rounded down, to at least 1.
    """
    levels = [np.ascontiguousarray(image, np.float32)]
    while max(levels[-1].shape[:2]) > 1:
        height, width = (max(1, side // 2) for side in levels[-1].shape[:2])
        planes = torch.tensor(levels[-1]).permute(2, 0, 1)
        smaller = torch.nn.functional.adaptive_avg_pool2d(planes, (height, width))
        levels.append(smaller.permute(1, 2, 0).contiguous().numpy())
    return levels


_smaller: dict[int, list[np.ndarray]] = {}
"""Further levels of images that cannot change, by the id of the image, as long as it lives."""


def _levels_of(image: np.ndarray) -> list[np.ndarray]:
    """The mip map of an image, made once of one that cannot change: scenes of several times share images."""
    if image.flags.writeable:
        return mip_levels(image)
    if id(image) not in _smaller:
        _smaller[id(image)] = mip_levels(image)[1:]
        weakref.finalize(image, _smaller.pop, id(image))
    return [np.ascontiguousarray(image, np.float32), *_smaller[id(image)]]


class MaterialTable:
    """Rows of materials, textures and mip levels, and the pool of texels."""

    def __init__(self, device: str, paths: bool = False) -> None:
        """Creates an empty table; with ``paths`` each material also has a row for scattering along paths."""
        self.device, self.paths = device, paths
        self.rows: list[dict] = []
        self.scattering: list[dict] = []
        self.textures: list[dict] = []
        self.levels: list[dict] = []
        self.texels: list[np.ndarray] = []
        self._texel_count = 0
        self._material_index: dict[int, int] = {}
        self._texture_index: dict[int, int] = {}
        self._image_index: dict[tuple[int, bool], tuple[int, int]] = {}
        self._alive: list[object] = []  # keys are object ids, so the objects must outlive the table

    def add_image(self, image: np.ndarray, mipmap: bool) -> tuple[int, int]:
        """Adds an image to the pool; returns the index of its first level and the number of levels."""
        key = (id(image), mipmap)
        if key not in self._image_index:
            levels = _levels_of(image) if mipmap else [np.ascontiguousarray(image, np.float32)]
            first = len(self.levels)
            for level in levels:
                height, width = level.shape[:2]
                self.levels.append({"first_texel": self._texel_count, "width": width, "height": height})
                self.texels.append(level.reshape(-1, 3))
                self._texel_count += height * width
            if self._texel_count > np.iinfo(np.int32).max:
                raise SceneError(f"textures: expected at most 2^31 texels in all, got {self._texel_count}")
            self._image_index[key] = (first, len(levels))
            self._alive.append(image)
        return self._image_index[key]

    def upload_texels(self) -> wp.array:
        """All texels on a device, followed by a black one, so that the last texel can be read as four floats."""
        table = np.concatenate([*self.texels, np.zeros((1, 3), np.float32)])
        return wp.array(table, dtype=wp.vec3, device=self.device, copy=self.device != "cpu")

    def add_texture(self, texture: Texture, where: str) -> int:
        """Adds a texture and returns its index; the same object is stored once."""
        if id(texture) not in self._texture_index:
            row = self._texture_row(texture, where)  # children first
            self._texture_index[id(texture)] = len(self.textures)
            self.textures.append(row)
            self._alive.append(texture)
        return self._texture_index[id(texture)]

    def _texture_row(self, texture: Texture, where: str) -> dict:
        if isinstance(texture, ConstantTexture):
            check_light(texture.value, f"{where}: ConstantTexture")
            return {"kind": TextureKind.CONSTANT, "value": texture.value}
        if isinstance(texture, ImageTexture):
            name = f"{where}: ImageTexture {texture.source!r}"
            check_light(texture.image, name)
            check_finite((*texture.uv_scale, *texture.uv_offset), f"{name}.uv_scale, uv_offset")
            first, count = self.add_image(texture.image, texture.filter == "mipmap")
            height, width = texture.image.shape[:2]
            area = height * width * abs(texture.uv_scale[0] * texture.uv_scale[1])
            return {
                "kind": TextureKind.IMAGE,
                "value": _WHITE,
                "uv_scale": texture.uv_scale,
                "uv_offset": texture.uv_offset,
                "texel_scale": np.sqrt(area),
                "first_level": first,
                "level_count": count,
                "wrap": _WRAPS[texture.wrap],
                "filter": _FILTERS[texture.filter],
            }
        if isinstance(texture, CheckerboardTexture):
            check_finite(texture.uv_scale, f"{where}: CheckerboardTexture.uv_scale")
            return {
                "kind": TextureKind.CHECKERBOARD,
                "value": _WHITE,
                "uv_scale": texture.uv_scale,
                "even": self.add_texture(texture.even, where),
                "odd": self.add_texture(texture.odd, where),
            }
        raise SceneError(f"{where}: texture {type(texture).__name__} is not supported yet")

    def add(self, material: Material, where: str) -> int:
        """Adds a material and returns its index; the same object is stored once."""
        if id(material) not in self._material_index:
            where = f"Instance {where!r}"
            if self.paths:
                self.scattering.append(scatter_row(material, self, where))
            row = self._material_row(_along_tree(material) if self.paths else material, where)
            self._material_index[id(material)] = len(self.rows)
            self.rows.append(row)
            self._alive.append(material)
        return self._material_index[id(material)]

    def _material_row(self, material: Material, where: str) -> dict:
        row: dict = {
            "diffuse": -1,
            "mirror": -1,
            "transmission": -1,
            "ior": 1.0,
            "thin": 0,
            "cos_spread": 1.0,
            "specular": _BLACK,
            "exponent": 1.0,
            "ambient": 0.0,
            "fresnel_min": 0.0,
            "fresnel_max": 0.0,
            "fresnel_exponent": 5.0,
            "mirror_tint": _WHITE,
            "emission": _BLACK,
        }
        if isinstance(material, Phong):
            row["diffuse"] = self.add_texture(material.diffuse, where)
            for name in ("specular", "exponent", "ambient", "fresnel_min", "fresnel_max", "fresnel_exponent"):
                row[name] = getattr(material, name)
            row["mirror_tint"] = material.mirror_tint
            row["cos_spread"] = _cos_half(material.mirror_spread_deg)
        elif isinstance(material, Matte):
            if material.sigma_deg != 0.0:
                raise SceneError(f"{where}: Matte.sigma_deg {material.sigma_deg} is not supported yet, expected 0")
            row["diffuse"] = self.add_texture(material.reflectance, where)
        elif isinstance(material, Mirror):
            row["mirror"] = self.add_texture(material.reflectance, where)
            row["fresnel_min"] = row["fresnel_max"] = 1.0
            row["cos_spread"] = _cos_half(material.spread_deg)
        elif isinstance(material, Glass):
            if tuple(material.roughness) != (0.0, 0.0):
                raise SceneError(f"{where}: Glass.roughness {material.roughness} is not supported yet, use spread_deg")
            row["mirror"] = self.add_texture(material.reflectance, where)
            row["transmission"] = self.add_texture(material.transmittance, where)
            row["ior"], row["thin"] = material.ior, int(material.thin)
            row["cos_spread"] = _cos_half(material.spread_deg)
        elif isinstance(material, HeightField):
            return self._material_row(material.base, where)
        elif isinstance(material, Emissive):
            row["emission"] = material.radiance
        else:
            raise SceneError(f"{where}: material {type(material).__name__} is not supported yet")
        for name in row.keys() - {"diffuse", "mirror", "transmission"}:
            check_light(row[name], f"{where}: {type(material).__name__}.{name}")
        return row


def _along_tree(material: Material) -> Material:
    """The material's equivalent for the tree of rays when the scene is rendered along paths: it holds only the
    parameters that both use."""
    base = unwrapped(material)
    if isinstance(base, Glass):
        return dataclasses.replace(base, roughness=(0.0, 0.0))
    return base if isinstance(base, Phong | Mirror) else Emissive(_BLACK)


def _cos_half(angle_deg: float) -> float:
    return float(cos(np.radians(angle_deg) / 2.0))
