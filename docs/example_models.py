"""Models that each show one feature of glTF."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from docs.example_gltf import Model, ball, box, checks, moved, quad, waves

ORANGE, WHITE, BLUE = (230, 120, 40), (240, 240, 240), (40, 80, 200)
TILES = checks(WHITE, ORANGE)
ROUGH = {"roughness": 0.6, "metallic": 0.0}


def _material(file: dict[str, Any]) -> dict[str, Any]:
    return file["materials"][0]


def _sampler(**values: int) -> Callable:
    return lambda file, accessor: file.update(samplers=[values]) or file["textures"][0].update(sampler=0)


def _transformed(file: dict[str, Any], accessor: Callable) -> None:
    change = {"offset": [0.25, 0.1], "rotation": 0.5, "scale": [2.0, 1.5]}
    _material(file)["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = {"KHR_texture_transform": change}
    file["extensionsUsed"] = ["KHR_texture_transform"]


def _as_transformed(uvs: NDArray) -> NDArray:
    c, s = np.cos(0.5), np.sin(0.5)
    u, v = uvs[:, 0] * 2.0, uvs[:, 1] * 1.5
    return np.stack([c * u + s * v + 0.25, c * v - s * u + 0.1], axis=1)


def _second_set(file: dict[str, Any], accessor: Callable) -> None:
    attributes = file["meshes"][0]["primitives"][0]["attributes"]
    attributes["TEXCOORD_1"] = attributes["TEXCOORD_0"]
    attributes["TEXCOORD_0"] = accessor(np.zeros((4, 2), np.float32))
    _material(file)["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 1


def _nested(file: dict[str, Any], accessor: Callable) -> None:
    file["nodes"] = [
        {"children": [1], "translation": [0.2, 0.1, 0.0], "rotation": [0, 0, np.sin(0.3), np.cos(0.3)]},
        {"mesh": 0, "scale": [1.0, -0.5, 0.8]},
    ]


def _animated(file: dict[str, Any], accessor: Callable) -> None:
    keys = accessor(np.array([[0.0], [0.5]], np.float32))
    turns = accessor(np.array([[0, 0, 0, 1], [0, 0, 0.5**0.5, 0.5**0.5]], np.float32))
    samplers = [{"input": keys, "output": turns, "interpolation": "LINEAR"}]
    file["animations"] = [
        {"samplers": samplers, "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}]}
    ]


def _strip(file: dict[str, Any], accessor: Callable) -> None:
    primitive = file["meshes"][0]["primitives"][0]
    primitive |= {"mode": 5, "indices": accessor(np.array([[0], [1], [3], [2]], np.uint16))}


def _coated(file: dict[str, Any], accessor: Callable) -> None:
    _material(file)["extensions"] = {
        "KHR_materials_clearcoat": {"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.1}
    }


def _glass(file: dict[str, Any], accessor: Callable) -> None:
    _material(file)["extensions"] = {"KHR_materials_transmission": {"transmissionFactor": 1.0},
                                     "KHR_materials_volume": {"thicknessFactor": 1.0}}  # fmt: skip


def _strong(file: dict[str, Any], accessor: Callable) -> None:
    _material(file)["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": 2.0}}


def _unlit(file: dict[str, Any], accessor: Callable) -> None:
    _material(file)["extensions"] = {"KHR_materials_unlit": {}}


def models() -> dict[str, Model]:
    """All models by name."""
    mask = np.concatenate([TILES, checks((255,) * 3, (0,) * 3)[..., :1]], axis=-1)
    veil = np.concatenate(
        [TILES, np.broadcast_to(np.linspace(0, 255, 64).astype(np.uint8)[None, :, None], (64, 64, 1))], -1
    )
    parts = checks((0, 60, 255), (0, 230, 0), 6)
    parts[..., 1] = np.where(parts[..., 2] > 0, 60, 230)
    grey = {**ROUGH, "base": (0.6, 0.6, 0.6)}
    colors = 0.5 + 0.5 * ball()["positions"]
    tiled, wrapped = {"base": TILES}, quad(2.0)["uvs"]
    mirror = np.concatenate(
        [np.concatenate([TILES, TILES[:, ::-1]], 1), np.concatenate([TILES[::-1], TILES[::-1, ::-1]], 1)]
    )
    nested = moved(np.degrees(0.6), to=(0.2, 0.1, 0)) @ moved(scale=(1.0, -0.5, 0.8))
    return {
        "flat-faces": Model("faces without normals are flat", **box(values=grey)),
        "smooth": Model("normals of vertices", **ball(values=grey)),
        "factor-texture": Model(
            "factor times texture", **quad(pictures=tiled, values={**ROUGH, "base": (0.5, 1.0, 0.3)})
        ),
        "vertex-colours": Model("linear colours of vertices", **ball(colors=colors, values=ROUGH)),
        "alpha-mask": Model(
            "holes by a cutoff, and a normal map",
            **ball(pictures={"base": mask, "normal": waves()}, values={**ROUGH, "cutoff": 0.5}),
        ),
        "alpha-blend": Model(
            "opacity from a texture", **quad(pictures={"base": veil}, values={**ROUGH, "blend": True})
        ),
        "normal-map": Model("normal map", **ball(pictures={"normal": waves()}, values=grey)),
        "emission": Model(
            "emission: factor, texture, strength",
            **quad(pictures={"glow": TILES}, values={**ROUGH, "glow": (0.4, 0.2, 0.1)}, change=_strong),
        ),
        "metal-texture": Model(
            "metal and roughness from a texture", **ball(pictures={"parts": parts}, values={"base": (0.9, 0.6, 0.3)})
        ),
        "metal-rough": Model(
            "rough metal", **ball(values={"roughness": 0.4, "metallic": 1.0, "base": (0.9, 0.6, 0.3)})
        ),
        "metal-smooth": Model(
            "nearly smooth metal", **ball(values={"roughness": 0.15, "metallic": 1.0, "base": (0.9, 0.9, 0.9)})
        ),
        "dielectric": Model(
            "glossy dielectric", **ball(values={"roughness": 0.3, "metallic": 0.0, "base": (0.1, 0.2, 0.6)})
        ),
        "clear-coat": Model(
            "clear coat", **ball(values={**ROUGH, "base": (0.6, 0.1, 0.1), "coat": 0.1}, change=_coated)
        ),
        "glass": Model(
            "transmission through a volume",
            **ball(values={"roughness": 0.0, "metallic": 0.0, "glass": True}, change=_glass),
        ),
        "nearest": Model(
            "nearest texel",
            **quad(
                pictures={"base": TILES[::8, ::8]},
                values={**ROUGH, "filter": "nearest"},
                change=_sampler(magFilter=9728),
            ),
        ),
        "clamped": Model(
            "texture clamped at its edge",
            **quad(2.0, pictures=tiled, values={**ROUGH, "wrap": "clamp"}, change=_sampler(wrapS=33071, wrapT=33071)),
        ),
        "mirrored": Model(
            "texture repeated with mirroring",
            **quad(
                2.0,
                pictures=tiled,
                values={**ROUGH, "shown": mirror},
                lookup=wrapped / 2,
                change=_sampler(wrapS=33648, wrapT=33648),
            ),
        ),
        "transformed": Model(
            "transform of texture coordinates",
            **quad(pictures=tiled, values=ROUGH, lookup=_as_transformed(quad()["uvs"]), change=_transformed),
        ),
        "second-set": Model(
            "second set of texture coordinates", **quad(pictures=tiled, values=ROUGH, change=_second_set)
        ),
        "nodes": Model("nested nodes, one mirrored", **box(values=grey, place=nested, change=_nested)),
        "animation": Model("animated node", **box(values=grey, place=moved(45.0), change=_animated)),
        "strip": Model("strip of triangles", **quad(pictures=tiled, values=ROUGH, change=_strip)),
        "unlit": Model("surface without lighting", **quad(pictures=tiled, values={"unlit": True}, change=_unlit)),
    }
