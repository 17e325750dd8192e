"""Small glTF models from arrays and values."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

TIME_S = 0.25
"""Time at which the models are rendered, seconds."""

GRID = np.meshgrid(np.linspace(0, 1, 49), np.linspace(0, 1, 25))


@dataclass
class Model:
    """A mesh with a material.

    Attributes:
        feature: what of the format it shows.
        positions, faces, normals, uvs, colors: the mesh; texture coordinates as in glTF, v downwards.
        place: transform ``(4, 4)`` of the mesh at :data:`TIME_S`.
        pictures: textures by role: ``base``, ``parts`` (roughness in green, metal in blue), ``normal``, ``glow``.
        values: roughness, metallic, base, coat, glow, cutoff, blend, glass, unlit, as the reference needs them.
        lookup: texture coordinates as the reference needs them, if they differ from ``uvs``.
        change: completes the JSON of the file.
    """

    feature: str
    positions: NDArray
    faces: NDArray
    normals: NDArray | None = None
    uvs: NDArray | None = None
    colors: NDArray | None = None
    place: NDArray = field(default_factory=lambda: np.eye(4))
    pictures: dict[str, NDArray] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)
    lookup: NDArray | None = None
    change: Callable[[dict[str, Any], Callable[[NDArray], int]], None] = lambda file, accessor: None


def ball(**more: Any) -> dict[str, Any]:
    """A unit sphere with normals and texture coordinates."""
    u, v = (part.ravel() for part in GRID)
    ring = np.sin(np.pi * v)
    points = np.stack([ring * np.sin(2 * np.pi * u), np.cos(np.pi * v), ring * np.cos(2 * np.pi * u)], axis=1)
    at = (np.arange(24)[:, None] * 49 + np.arange(48)).ravel()
    faces = np.concatenate([np.stack([at, at + 49, at + 50], 1), np.stack([at, at + 50, at + 1], 1)])
    return {"positions": points, "faces": faces, "normals": points, "uvs": np.stack([u, v], axis=1), **more}


def quad(repeat: float = 1.0, **more: Any) -> dict[str, Any]:
    """A square that leans back, with texture coordinates from 0 to ``repeat``."""
    points = np.array([[-1, -0.9, 0.4], [1, -0.9, 0.4], [1, 0.9, -0.4], [-1, 0.9, -0.4]], float)
    uvs = repeat * np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)
    return {"positions": points, "faces": np.array([[0, 1, 2], [0, 2, 3]]), "uvs": uvs, **more}


def box(**more: Any) -> dict[str, Any]:
    """A cube of eight points, without normals."""
    points = 0.7 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = np.array([corners for a, b, c, d in sides for corners in ((a, b, c), (a, c, d))])
    return {"positions": points, "faces": faces, **more}


def checks(first: tuple[int, ...], second: tuple[int, ...], count: int = 8, size: int = 64) -> NDArray[np.uint8]:
    """A chequered picture, redder to the right so that its orientation shows."""
    row, column = np.indices((size, size)) * count // size
    picture = np.where(((row + column) % 2 == 0)[..., None], np.array(first), np.array(second)).astype(np.float64)
    picture[..., 1] *= np.linspace(1.0, 0.4, size)[None]
    return picture.astype(np.uint8)


def waves(size: int = 64) -> NDArray[np.uint8]:
    """A normal map of slanted waves."""
    y, x = np.indices((size, size)) / size
    slope = 0.5 * np.cos(2 * np.pi * (4 * x + 2 * y))
    normal = np.stack([-slope, 0.5 * slope, np.ones_like(slope)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.round(255 * (0.5 * normal + 0.5)).astype(np.uint8)


def moved(turn_deg: float = 0.0, scale: tuple[float, ...] = (1, 1, 1), to: tuple[float, ...] = (0, 0, 0)) -> NDArray:
    """A scale, a turn about z and a shift."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.diag(scale)
    matrix[:3, 3] = to
    return matrix


def write_model(folder: Path, name: str, model: Model) -> Path:
    """Writes a glTF file that holds its buffers and pictures."""
    file: dict[str, Any] = {"asset": {"version": "2.0"}, "buffers": [], "bufferViews": [], "accessors": [],
                            "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}  # fmt: skip

    def accessor(values: NDArray) -> int:
        kinds = {"f4": 5126, "u2": 5123}
        number, content = len(file["buffers"]), base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()
        file["buffers"].append({"byteLength": values.nbytes, "uri": f"data:application/octet-stream;base64,{content}"})
        file["bufferViews"].append({"buffer": number, "byteLength": values.nbytes})
        shape = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[values.shape[1]]
        bounds = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        kind = kinds[values.dtype.str[1:]]
        file["accessors"].append(
            {"bufferView": number, "componentType": kind, "count": len(values), "type": shape, **bounds}
        )
        return number

    def texture(picture: NDArray) -> dict[str, int]:
        buffer = io.BytesIO()
        Image.fromarray(np.ascontiguousarray(picture)).save(buffer, "PNG")
        uri = "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
        file.setdefault("images", []).append({"uri": uri})
        file.setdefault("textures", []).append({"source": len(file["images"]) - 1})
        return {"index": len(file["textures"]) - 1}

    named = {"POSITION": model.positions, "NORMAL": model.normals, "TEXCOORD_0": model.uvs, "COLOR_0": model.colors}
    attributes = {key: accessor(values.astype(np.float32)) for key, values in named.items() if values is not None}
    faces = accessor(model.faces.reshape(-1, 1).astype(np.uint16))
    file["meshes"] = [{"primitives": [{"attributes": attributes, "indices": faces, "material": 0}]}]
    values, pictures = model.values, model.pictures
    parts: dict[str, Any] = {
        "metallicFactor": values.get("metallic", 1.0),
        "roughnessFactor": values.get("roughness", 1.0),
    }
    parts["baseColorFactor"] = [*values.get("base", (1.0, 1.0, 1.0)), 1.0]
    material: dict[str, Any] = {"pbrMetallicRoughness": parts, "doubleSided": True}
    if "cutoff" in values:
        material |= {"alphaMode": "MASK", "alphaCutoff": values["cutoff"]}
    if "blend" in values:
        material["alphaMode"] = "BLEND"
    if "glow" in values:
        material["emissiveFactor"] = list(values["glow"])
    for role, picture in pictures.items():
        at = {"base": (parts, "baseColorTexture"), "parts": (parts, "metallicRoughnessTexture"),
              "normal": (material, "normalTexture"), "glow": (material, "emissiveTexture")}[role]  # fmt: skip
        at[0][at[1]] = texture(picture)
    file["materials"] = [material]
    model.change(file, accessor)
    path = folder / f"{name}.gltf"
    path.write_text(json.dumps(file), encoding="utf-8")
    return path


def sky() -> NDArray[np.float32]:
    """A blue sky with a soft sun over a brown floor, ``(32, 64, 3)``, row 0 at the top."""
    row, column = np.indices((32, 64))
    up = np.cos(np.pi * (row + 0.5) / 32)[..., None]
    found = np.where(up > 0, np.array([0.3, 0.5, 0.9]) * (0.5 + up), np.array([0.3, 0.25, 0.2]))
    sun = np.exp(-(((row - 9) / 2.5) ** 2) - ((column - 22) / 2.5) ** 2)[..., None]
    return (found + 12.0 * sun * np.array([1.0, 0.9, 0.7])).astype(np.float32)
