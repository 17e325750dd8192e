"""Models from files, with their materials, as instances of a scene."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np

from scenes.arithmetic import power, product
from scenes.canonical import (
    ConstantTexture,
    ImageTexture,
    Instance,
    Material,
    Matrix,
    Mesh,
    Phong,
    RigidTrack,
    SceneError,
    Texture,
)
from scenes.canonical.values import vertices_of
from scenes.loading import FileState, decode_srgb, one_line, state_of

MODEL_ENDINGS = (".obj", ".ply", ".stl", ".glb", ".gltf")
_DEFAULT = Phong(ConstantTexture((0.5, 0.5, 0.5)))
_EXPONENT_MAX = 1.0e4


_KEPT_MAX = 32
_kept: dict[Path, tuple[dict[Path, FileState | None], tuple[Instance, ...]]] = {}
"""Models that were read, and the files that each was made of."""


def read_model(path: Path) -> tuple[Instance, ...]:
    """Parts of a model, each with its own material, in the file's frame.

    OBJ materials (MTL) become Phong: ``Kd`` or ``map_Kd`` diffuse, ``Ks`` and ``Ns`` the highlight, dimmed so that no
    more is reflected than arrives. Metallic–roughness materials of glTF become Phong as well: of the base colour the
    non-metallic part is diffuse; the highlight is 4 % of white, or the base colour for metal, with the exponent
    ``2 / roughness⁴ - 2``; below a roughness of 0.2 metal mirrors. Vertex colours are averaged over a part. Files
    without materials (STL, most PLY) are grey.

    Args:
        path: OBJ, PLY, STL, GLB or glTF.

    Returns:
        Instances whose transforms are those of the file's nodes.

    Raises:
        SceneError: the file is missing, of another kind, cannot be read, has no faces, vertices that are not finite, or
            a texture or material file that is not there.
    """
    path = Path(path)
    files, kept = _kept.pop(path, ({}, ()))
    if not files or any(state_of(file) != state for file, state in files.items()):
        files = {path: state_of(path)}
        kept = _read(path, files)
    _kept[path] = files, kept
    if len(_kept) > _KEPT_MAX:
        del _kept[next(iter(_kept))]
    return kept


def _read(path: Path, files: dict[Path, FileState | None]) -> tuple[Instance, ...]:
    """The parts of a model; enters all other files that it asks for into ``files``, also those that are not there."""
    if path.suffix.lower() not in MODEL_ENDINGS:
        raise SceneError(f"model {path}: expected a file that ends in {', '.join(MODEL_ENDINGS)}")
    if not path.is_file():
        raise SceneError(f"model {path}: expected a file, found none")
    if path.suffix.lower() == ".obj":
        _check_obj(path)
    import trimesh  # slow, and most scenes read no model
    from trimesh.resolvers import FilePathResolver

    class Resolver(FilePathResolver):
        def absolute(self, name: str) -> Path:
            file = super().absolute(name)
            files.setdefault(file, state_of(file))
            return file

    try:
        loaded = trimesh.load_scene(path, process=False, resolver=Resolver(str(path)))
        nodes = [(str(node), *loaded.graph[node]) for node in loaded.graph.nodes_geometry]
        parts = [(node, np.asarray(matrix, np.float64), loaded.geometry[key]) for node, matrix, key in nodes]
    except Exception as error:  # parsers raise what they like on broken files
        raise SceneError(f"model {path}: cannot be read: {one_line(error)}") from error
    parts = [part for part in parts if len(getattr(part[2], "faces", ())) > 0]
    if not parts:
        raise SceneError(f"model {path}: expected at least one face, found none")
    # nodes that share a geometry share its mesh and material
    meshes = {id(geometry): _mesh(geometry, path) for _, _, geometry in parts}
    materials = {id(geometry): _material(geometry.visual, path) for _, _, geometry in parts}
    return tuple(
        Instance(meshes[id(geometry)], materials[id(geometry)], matrix, name=f"{path.stem}/{node}")
        for node, matrix, geometry in parts
    )


def place_model(
    path: Path,
    to_world: Matrix,
    track: RigidTrack | None = None,
    material: Material | None = None,
    name: str = "",
) -> tuple[Instance, ...]:
    """A model's parts moved into the world.

    Args:
        path: see :func:`read_model`.
        to_world: applied outside the transforms of the file.
        track: rigid motion of all parts.
        material: of all parts, instead of the file's.
        name: of the instances, instead of the file's.
    """
    return tuple(
        dataclasses.replace(
            part,
            to_world=product(to_world, part.to_world),
            track=track,
            material=material or part.material,
            name=name or part.name,
        )
        for part in read_model(path)
    )


def _check_obj(path: Path) -> None:
    """What the parser passes over in silence: other encodings, and material files that are not there."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise SceneError(f"model {path}: expected UTF-8 text, byte {error.start} is none") from None
    for name in re.findall(r"^mtllib[ \t]+(.+?)[ \t]*$", text, re.MULTILINE):
        library = path.parent / name
        if not library.is_file():
            raise SceneError(f"model {path}: expected its materials in {library}, found no file")
        for line in library.read_text(encoding="utf-8", errors="replace").splitlines():
            words = line.split(maxsplit=1)
            if len(words) == 2 and words[0].lower() == "map_kd" and not (library.parent / words[1].strip()).is_file():
                missing = library.parent / words[1].strip()
                raise SceneError(f"model {path}: expected a texture at {missing}, found no file")


def _mesh(geometry: Any, path: Path) -> Mesh:
    vertices = vertices_of(np.array(geometry.vertices))
    if not np.isfinite(vertices).all():
        raise SceneError(f"model {path}: vertices hold non-finite values")
    normals = np.array(geometry.vertex_normals, np.float32)
    lengths = np.linalg.norm(normals, axis=1)
    normals[lengths < 1e-6] = (0.0, 0.0, 1.0)  # vertices of no triangle
    uvs = getattr(geometry.visual, "uv", None)
    return Mesh(
        vertices,
        np.array(geometry.faces, np.int32),
        normals / np.linalg.norm(normals, axis=1, keepdims=True),
        None if uvs is None or len(uvs) != len(vertices) else np.array(uvs, np.float32),
        str(path),
    )


def _material(visual: Any, path: Path) -> Material:
    material = getattr(visual, "material", None)
    if material is not None and hasattr(material, "baseColorFactor"):
        return _metallic_roughness(material, path)
    if material is not None:
        return _mtl(material, path)
    if getattr(visual, "kind", None) in ("vertex", "face"):
        colors = visual.vertex_colors if visual.kind == "vertex" else visual.face_colors
        mean = decode_srgb(np.asarray(colors, np.uint8)[:, :3]).mean(axis=0)
        return Phong(ConstantTexture(_rgb(mean)))
    return _DEFAULT


def _rgb(values: Any) -> tuple[float, float, float]:
    red, green, blue = (float(value) for value in np.asarray(values).reshape(-1)[:3])
    return red, green, blue


def _picture(image: Any, path: Path) -> np.ndarray:
    pixels = np.array(image.convert("RGB"))
    if min(pixels.shape[:2]) < 1:
        raise SceneError(f"model {path}: expected a texture with at least one texel, got {pixels.shape[:2]}")
    return decode_srgb(pixels)


def _mtl(material: Any, path: Path) -> Phong:
    given = {name.lower(): value for name, value in getattr(material, "kwargs", {}).items()}
    diffuse = np.clip(_rgb(given.get("kd", np.asarray(material.diffuse)[:3] / 255.0)), 0.0, 1.0)
    texture: Texture = ConstantTexture(_rgb(diffuse))
    if getattr(material, "image", None) is not None:
        # its texels are the diffuse colour; exporters leave Kd at whatever grey it was
        texture = ImageTexture(_picture(material.image, path), source=str(path))
        diffuse = texture.image.mean(axis=(0, 1))
    exponent = float(np.asarray(given.get("ns", 0.0)).reshape(-1)[0])
    specular = np.minimum(np.clip(_rgb(given.get("ks", (0.0, 0.0, 0.0))), 0.0, 1.0), 1.0 - diffuse)
    if exponent < 1.0:  # a highlight this wide is not visible as one
        return Phong(texture)
    return Phong(texture, _rgb(specular), min(exponent, _EXPONENT_MAX))


def _metallic_roughness(material: Any, path: Path) -> Phong:
    metallic = 1.0 if material.metallicFactor is None else float(material.metallicFactor)
    roughness = 1.0 if material.roughnessFactor is None else float(material.roughnessFactor)
    factor = np.ones(3) if material.baseColorFactor is None else np.asarray(material.baseColorFactor, np.float64)[:3]
    factor = factor / 255.0 if factor.max() > 1.0 else factor
    base, texture = factor, None
    if material.baseColorTexture is not None:
        picture = _picture(material.baseColorTexture, path) * factor.astype(np.float32)
        base = picture.mean(axis=(0, 1))
        texture = ImageTexture(picture * np.float32(1.0 - metallic), source=str(path))
    mirror = metallic if roughness < 0.2 else 0.0
    return Phong(
        texture or ConstantTexture(_rgb(base * (1.0 - metallic))),
        specular=_rgb((0.04 * (1.0 - metallic) + base * metallic) * (1.0 - mirror)),
        exponent=float(np.clip(2.0 / float(power(max(roughness, 1e-3), 4)) - 2.0, 1.0, _EXPONENT_MAX)),
        fresnel_min=mirror,
        fresnel_max=mirror,
        mirror_tint=_rgb(base),
    )
