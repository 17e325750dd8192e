"""Writes the files of docs/guides/tasks.md: models that each show one feature of glTF, a sky, keys of a camera, an OBJ
with materials, the same far from the origin, a large mesh, a model in USD and the answers of a study.

Usage: python docs/example_files.py [FOLDER]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

from docs.example_gltf import sky, write_model
from docs.example_models import models

KEYS = """time_s,eye_x,eye_y,eye_z,target_x,target_y,target_z
0.0,3.0,1.5,3.0,0,0,0
0.5,0.5,2.0,4.0,0,0,0
1.0,-3.0,1.0,3.0,0,0.2,0
"""
QUADS_MTL = """newmtl red
Kd 0.7 0.1 0.1
newmtl mirror
Kd 0.1 0.1 0.1
Ks 0.8 0.8 0.8
Ns 500
illum 3
newmtl glow
Kd 0 0 0
Ke 2 2 1
"""


def _quads(offset: float) -> str:
    """A cube of six quads with three materials."""
    points = 0.7 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) + offset
    lines = ["mtllib quads.mtl", *(f"v {x:.3f} {y:.3f} {z:.3f}" for x, y, z in points)]
    sides = {"red": ((1, 2, 4, 3), (5, 7, 8, 6)), "mirror": ((1, 5, 6, 2), (1, 3, 7, 5))}
    sides["glow"] = (3, 4, 8, 7), (2, 6, 8, 4)
    for name, faces in sides.items():
        lines += [f"usemtl {name}", *(f"f {a} {b} {c} {d}" for a, b, c, d in faces)]
    return "\n".join(lines) + "\n"


ROUNDED = """#usda 1.0
(
    defaultPrim = "Model"
    upAxis = "Y"
    metersPerUnit = 0.01
)
def Xform "Model" {
    def Mesh "body" {
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
        point3f[] points = [(-1,-1,-1), (-1,-1,1), (-1,1,-1), (-1,1,1), (1,-1,-1), (1,-1,1), (1,1,-1), (1,1,1)]
        uniform token subdivisionScheme = "catmullClark"
        int[] creaseIndices = [2, 3, 7, 6, 2]
        int[] creaseLengths = [5]
        float[] creaseSharpnesses = [10]
        rel material:binding = </Model/Red>
    }
    def Material "Red" {
        token outputs:surface.connect = </Model/Red/Surface.outputs:surface>
        def Shader "Surface" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.7, 0.1, 0.1)
            float inputs:roughness = 0.3
            token outputs:surface
        }
    }
}
"""


def _large(side: int = 502) -> bytes:
    """A bumpy sphere of about half a million triangles, as binary PLY."""
    v, u = (part.ravel() / (side - 1) for part in np.indices((side, side)))
    radius = 1.0 + 0.05 * np.sin(40 * np.pi * u) * np.sin(20 * np.pi * v)
    ring = np.sin(np.pi * v)
    turn = 2 * np.pi * u
    points = radius[:, None] * np.stack([ring * np.cos(turn), ring * np.sin(turn), np.cos(np.pi * v)], 1)
    at = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([at, at + side, at + side + 1], 1), np.stack([at, at + side + 1, at + 1], 1)])
    records = np.zeros(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    records["count"], records["corners"] = 3, faces
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + f"element face {len(faces)}\n"
    head += "property list uchar int vertex_indices\nend_header\n"
    return head.encode() + points.astype("<f4").tobytes() + records.tobytes()


def _trials() -> str:
    """Answers of four observers to one of four alternatives, right more often where there are few samples."""
    rng, rows = np.random.default_rng(1), ["observer,samples,correct"]
    for observer in "ABCD":
        for samples in (1, 4, 16, 64, 256):
            share = 0.25 + 0.75 / (1.0 + (samples / 24.0) ** 1.5)
            rows += [f"{observer},{samples},{'yes' if right else 'no'}" for right in rng.random(20) < share]
    return "\n".join(rows) + "\n"


def main(folder: Path) -> None:
    """Writes everything."""
    import OpenImageIO as oiio

    folder.mkdir(parents=True, exist_ok=True)
    for name, model in models().items():
        write_model(folder, name, model)
    picture = sky()
    output = oiio.ImageOutput.create(str(folder / "sky.hdr"))
    output.open(str(folder / "sky.hdr"), oiio.ImageSpec(picture.shape[1], picture.shape[0], 3, oiio.FLOAT))
    output.write_image(picture)
    output.close()
    (folder / "keys.csv").write_text(KEYS, encoding="utf-8")
    (folder / "quads.mtl").write_text(QUADS_MTL, encoding="utf-8")
    (folder / "quads.obj").write_text(_quads(0.0), encoding="utf-8")
    (folder / "far.obj").write_text(_quads(4_500_000.0), encoding="utf-8")
    (folder / "large.ply").write_bytes(_large())
    (folder / "rounded.usda").write_text(ROUNDED, encoding="utf-8")
    (folder / "trials.csv").write_text(_trials(), encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("out/models"), help="destination")
    main(parser.parse_args().folder)
