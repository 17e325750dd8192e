"""Rows of the materials' scattering along paths, one function per material.

Wrappers (height fields, holes, perturbed normals) extend the row of their base.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from renderer.layout.kinds import ScatterKind
from renderer.tables.checks import check_light
from renderer.tables.coats import rough_coat, thrown_back
from scenes.canonical import (
    Bumped,
    Emissive,
    Glass,
    HeightField,
    Masked,
    Material,
    Matte,
    Metal,
    MetallicRough,
    Mirror,
    NormalMapped,
    Phong,
    Plastic,
    SceneError,
    Texture,
)

Row = dict[str, Any]


class Textures(Protocol):
    """A table that numbers textures."""

    def add_texture(self, texture: Texture, where: str) -> int: ...


EMPTY: Row = {
    "kind": ScatterKind.BLACK,
    "base": -1,
    "specular": -1,
    "parts": -1,
    "alpha": 0.0,
    "rough": (1.0, 0.0),
    "roughness": 1.0,
    "metallic": 0.0,
    "clear": 0.0,
    "clear_alpha": 1.0,
    "ior": 1.0,
    "thin": 0,
    "eta": (1.0, 1.0, 1.0),
    "k": (0.0, 0.0, 0.0),
    "beckmann": 0,
    "inner": 0.0,
    "passed_low": (0.0, 0.0, 0.0, 0.0),
    "passed_high": (0.0, 0.0, 0.0, 0.0),
    "glow": -1,
    "emission": (0.0, 0.0, 0.0),
    "opacity": -1,
    "cutoff": -1.0,
    "bend": -1,
    "bend_scale": 1.0,
    "bumps": 0,
}
"""A surface that scatters nothing."""


def _phong(material: Phong, textures: Textures, where: str) -> Row:
    return {"kind": ScatterKind.PHONG, "base": textures.add_texture(material.diffuse, where)}


def _matte(material: Matte, textures: Textures, where: str) -> Row:
    square = np.radians(material.sigma_deg) ** 2
    rough = float(1.0 - 0.5 * square / (square + 0.33)), float(0.45 * square / (square + 0.09))
    return {"kind": ScatterKind.DIFFUSE, "base": textures.add_texture(material.reflectance, where), "rough": rough}


def _mirror(material: Mirror, textures: Textures, where: str) -> Row:
    return {"kind": ScatterKind.MIRROR, "specular": textures.add_texture(material.reflectance, where)}


def _glass(material: Glass, textures: Textures, where: str) -> Row:
    return {
        "kind": ScatterKind.GLASS,
        "base": textures.add_texture(material.transmittance, where),
        "specular": textures.add_texture(material.reflectance, where),
        "ior": material.ior,
        "thin": int(material.thin),
        "alpha": mean_alpha(material.roughness),
        "beckmann": int(material.distribution == "beckmann"),
    }


def _metal(material: Metal, textures: Textures, where: str) -> Row:
    alpha = mean_alpha(material.roughness)
    return {
        "beckmann": int(material.distribution == "beckmann"),
        "kind": ScatterKind.METAL,
        "specular": textures.add_texture(material.reflectance_scale, where),
        "alpha": alpha,
        "eta": material.eta,
        "k": material.k,
    }


def _plastic(material: Plastic, textures: Textures, where: str) -> Row:
    if not material.layered:
        raise SceneError(f"{where}: Plastic.layered: expected True (all that paths support), got False")
    rough = {"inner": thrown_back(material.ior)}
    if material.roughness > 0.0:
        passed, inner = rough_coat(material.ior, material.roughness, material.distribution)
        rough = {"inner": inner, "passed_low": tuple(passed[:4]), "passed_high": tuple(passed[4:])}
    return {
        **rough,
        "kind": ScatterKind.COATED,
        "base": textures.add_texture(material.diffuse, where),
        "specular": textures.add_texture(material.specular, where),
        "ior": material.ior,
        "alpha": material.roughness,
        "beckmann": int(material.distribution == "beckmann"),
    }


def _metallic_rough(material: MetallicRough, textures: Textures, where: str) -> Row:
    return {
        "kind": ScatterKind.METALLIC,
        "base": textures.add_texture(material.base, where),
        "parts": -1 if material.parts is None else textures.add_texture(material.parts, where),
        "roughness": material.roughness,
        "metallic": material.metallic,
        "ior": material.ior,
        "clear": material.coat,
        "clear_alpha": max(material.coat_roughness**2, 1.0e-4),
        "emission": material.emission,
        "glow": -1 if material.glow is None else textures.add_texture(material.glow, where),
    }


def _emissive(material: Emissive, textures: Textures, where: str) -> Row:
    return {"kind": ScatterKind.BLACK, "emission": material.radiance}


def _height_field(material: HeightField, textures: Textures, where: str) -> Row:
    return scatter_row(material.base, textures, where)


def _masked(material: Masked, textures: Textures, where: str) -> Row:
    inner = scatter_row(material.base, textures, where)
    if inner["opacity"] >= 0:
        raise SceneError(f"{where}: Masked: expected a base without holes of its own")
    cutoff = -1.0 if material.cutoff is None else material.cutoff
    return inner | {"opacity": textures.add_texture(material.opacity, where), "cutoff": cutoff}


def _bumped(material: Bumped, textures: Textures, where: str) -> Row:
    return _bent(material.base, material.height, material.scale, 1, textures, where)


def _normal_mapped(material: NormalMapped, textures: Textures, where: str) -> Row:
    return _bent(material.base, material.normals, material.scale, 0, textures, where)


def _bent(base: Material, picture: Texture, scale: float, bumps: int, textures: Textures, where: str) -> Row:
    inner = scatter_row(base, textures, where)
    if inner["bend"] >= 0:
        raise SceneError(f"{where}: expected one normal or bump map, got two")
    return inner | {"bend": textures.add_texture(picture, where), "bend_scale": scale, "bumps": bumps}


ROWS: dict[type, Callable[[Any, Textures, str], Row]] = {
    Phong: _phong,
    Matte: _matte,
    Mirror: _mirror,
    Glass: _glass,
    Metal: _metal,
    Plastic: _plastic,
    MetallicRough: _metallic_rough,
    Emissive: _emissive,
    HeightField: _height_field,
    Masked: _masked,
    Bumped: _bumped,
    NormalMapped: _normal_mapped,
}
"""The function for the row of each material."""


def scatter_row(material: Material, textures: Textures, where: str) -> Row:
    """The row of a material, with the fields of :class:`renderer.layout.scattering.ScatterRecord`.

    Raises:
        SceneError: for a material or values that path tracing does not support.
    """
    if type(material) not in ROWS:
        raise SceneError(f"{where}: material {type(material).__name__} is not supported by paths")
    row = EMPTY | ROWS[type(material)](material, textures, where)
    for name in ("alpha", "roughness", "metallic", "clear", "ior", "eta", "k", "emission"):
        check_light(row[name], f"{where}: {type(material).__name__}.{name}")
    return row


def unwrapped(material: Material) -> Material:
    """The base of a material without height field, holes and perturbed normals."""
    while isinstance(material, HeightField | Masked | Bumped | NormalMapped):
        material = material.base
    return material


def mean_alpha(roughness: tuple[float, float]) -> float:
    """One alpha for both axes: their geometric mean."""
    return float(np.sqrt(roughness[0] * roughness[1]))
