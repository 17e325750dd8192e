"""Renders the models of docs/example_models.py by paths here and in Mitsuba 3, and compares them.

Usage: python docs/compare_models.py [FOLDER]

Mitsuba gets each model from its arrays and values, not from the glTF file. Prints a table, and writes both pictures of
each model and models.webp with all. Surfaces of Mitsuba are its ``principled`` material, whose diffuse part darkens
towards its edges as Disney's does.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from analysis.bench import mitsuba_scene
from analysis.bench.mitsuba import VARIANTS, missing, select
from docs.example_files import main as write_files
from docs.example_gltf import TIME_S, Model
from docs.example_models import models
from renderer.film.files import encode_srgb
from renderer.frames import render_image
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes.canonical import EnvironmentLight, Scene
from scenes.catalog import Look, load_seen
from scenes.loading import decode_srgb

SIDE_PX, SAMPLES, BLOCK_PX = 80, 64, 8
CAMERA = (0.6, 0.8, 3.2, 0.0, 0.0, 0.0)


def ours(scene: Scene) -> NDArray[np.float32]:
    """The picture by paths."""
    renderer = Renderer(scene, specialise=False)
    return render_image(renderer, SamplePlan(SAMPLES, "sobol"), SIDE_PX, SIDE_PX, TIME_S).numpy()


def _bitmap(mitsuba: Any, picture: NDArray, values: dict[str, Any], encoded: bool = True) -> dict[str, Any]:
    pixels = decode_srgb(picture[..., :3]) if encoded else picture[..., :3].astype(np.float32) / 255.0
    return {"type": "bitmap", "bitmap": mitsuba.Bitmap(np.ascontiguousarray(pixels)), "raw": True,
            "filter_type": values.get("filter", "bilinear"), "wrap_mode": values.get("wrap", "repeat")}  # fmt: skip


def _one(mitsuba: Any, picture: NDArray, channel: int, cutoff: float | None = None) -> dict[str, Any]:
    """A channel as numbers."""
    numbers = picture[..., channel : channel + 1].astype(np.float32) / 255.0
    numbers = numbers if cutoff is None else (numbers >= cutoff).astype(np.float32)
    return {"type": "bitmap", "bitmap": mitsuba.Bitmap(np.ascontiguousarray(numbers)), "raw": True,
            "filter_type": "bilinear" if cutoff is None else "nearest"}  # fmt: skip


def _surface(mitsuba: Any, model: Model) -> dict[str, Any]:
    values, pictures = model.values, model.pictures
    if "unlit" in values:
        return {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    if "glass" in values:
        return {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}
    factor = np.array(values.get("base", (1.0, 1.0, 1.0)))
    base: dict[str, Any] = {"type": "rgb", "value": factor.tolist()}
    if "base" in pictures:
        shown = values.get("shown", pictures["base"])
        base = _bitmap(mitsuba, shown, values)
        base["bitmap"] = mitsuba.Bitmap((decode_srgb(shown[..., :3]) * factor).astype(np.float32))
    if model.colors is not None:
        base = {"type": "mesh_attribute", "name": "vertex_color"}
    found: dict[str, Any] = {"type": "principled", "base_color": base, "specular": 0.5}
    found |= {"roughness": values.get("roughness", 1.0), "metallic": values.get("metallic", 1.0)}
    if "parts" in pictures:
        found |= {name: _one(mitsuba, pictures["parts"], at) for name, at in (("roughness", 1), ("metallic", 2))}
    if "coat" in values:
        found |= {"clearcoat": 1.0, "clearcoat_gloss": (0.1 - values["coat"] ** 2) / 0.099}
    if "normal" in pictures:
        normals = _bitmap(mitsuba, pictures["normal"], values, encoded=False)
        found = {"type": "normalmap", "normalmap": normals, "nested": found}
    found = {"type": "twosided", "inner": found}
    if "cutoff" in values or "blend" in values:
        opacity = _one(mitsuba, pictures["base"], 3, values.get("cutoff"))
        found = {"type": "mask", "opacity": opacity, "nested": found}
    return found


def _glow(mitsuba: Any, model: Model) -> dict[str, Any]:
    """The emission as an emitter, if there is one."""
    if "unlit" not in model.values and "glow" not in model.values:
        return {}
    picture = decode_srgb(model.pictures["glow" if "glow" in model.values else "base"])
    picture = picture * np.array(model.values.get("glow", (0.5, 0.5, 0.5)), np.float32) * np.float32(2.0)
    return {"emitter": {"type": "area", "radiance": {"type": "bitmap", "bitmap": mitsuba.Bitmap(picture), "raw": True}}}


def theirs(mitsuba: Any, model: Model, scene: Scene) -> NDArray[np.float32]:
    """The picture by Mitsuba's path tracer."""
    properties = mitsuba.Properties()
    for name, value in (("bsdf", _surface(mitsuba, model)), *_glow(mitsuba, model).items()):
        properties[name] = mitsuba.load_dict(value)
    uvs = model.uvs if model.lookup is None else model.lookup
    place = model.place[:3, :3]
    mesh = mitsuba.Mesh(
        "model", len(model.positions), len(model.faces), has_vertex_normals=model.normals is not None,
        has_vertex_texcoords=uvs is not None, props=properties,
    )  # fmt: skip
    if model.colors is not None:
        mesh.add_attribute("vertex_color", 3, model.colors.astype(np.float32).ravel())
    filled = mitsuba.traverse(mesh)
    filled["vertex_positions"] = (model.positions @ place.T + model.place[:3, 3]).astype(np.float32).ravel()
    filled["faces"] = model.faces.astype(np.uint32).ravel()
    if model.normals is not None:
        filled["vertex_normals"] = model.normals.astype(np.float32).ravel()
    if uvs is not None:
        filled["vertex_texcoords"] = uvs.astype(np.float32).ravel()
    filled.update()
    described = mitsuba_scene.translate(mitsuba, dataclasses.replace(scene, instances=()), TIME_S)
    film = {"type": "hdrfilm", "width": SIDE_PX, "height": SIDE_PX, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    described["sensor"] |= {"film": film, "sampler": {"type": "independent"}}
    made = mitsuba.load_dict({"type": "scene", "integrator": {"type": "path"}, **described, "model": mesh})
    return np.array(made.integrator().render(made, seed=0, spp=2 * SAMPLES))


def difference(first: NDArray[np.float32], second: NDArray[np.float32]) -> float:
    """Mean absolute difference of blocks of pixels over the mean of the second picture."""
    count = SIDE_PX // BLOCK_PX
    ours_, theirs_ = (p.reshape(count, BLOCK_PX, count, BLOCK_PX, 3).mean(axis=(1, 3)) for p in (first, second))
    return float(np.abs(ours_ - theirs_).mean() / theirs_.mean())


def compared(folder: Path) -> dict[str, tuple[Model, float, NDArray, NDArray]]:
    """Each model with the difference of both pictures, and the pictures."""
    write_files(folder)
    mitsuba = select(next(variant for variant in VARIANTS if not missing(variant)))
    found = {}
    for name, model in models().items():
        look = Look(camera=CAMERA, fov_deg=40.0, environment=folder / "sky.hdr", integrator="path", bounces=8)
        scene, _ = load_seen(str(folder / f"{name}.gltf"), look)
        assert any(isinstance(light, EnvironmentLight) for light in scene.lights)
        pictures = ours(scene), theirs(mitsuba, model, scene)
        found[name] = model, difference(*pictures), *pictures
    return found


def main(folder: Path) -> None:
    """Renders, prints the table, writes the pictures."""
    found = compared(folder)
    columns = 6
    rows = -(-len(found) // columns)
    sheet = Image.new("RGB", (columns * (2 * SIDE_PX + 8), rows * (SIDE_PX + 18)), "white")
    print("| model | shows | difference |\n|---|---|---|")
    for number, (name, (model, error, first, second)) in enumerate(found.items()):
        print(f"| {name} | {model.feature} | {100.0 * error:.1f} % |")
        x, y = number % columns * (2 * SIDE_PX + 8), number // columns * (SIDE_PX + 18)
        for place, (kind, picture) in enumerate((("ours", first), ("mitsuba", second))):
            shown = Image.fromarray(encode_srgb(torch.from_numpy(picture)))
            shown.save(folder / f"{name}-{kind}.png")
            sheet.paste(shown, (x + place * SIDE_PX, y + 14))
        ImageDraw.Draw(sheet).text((x + 2, y + 1), name, fill="black")
    sheet.save(folder / "models.webp", quality=92)
    sheet.save(folder / "models.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("out/models"), help="destination")
    main(parser.parse_args().folder)
