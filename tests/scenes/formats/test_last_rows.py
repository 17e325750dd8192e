"""Last rows of transforms that are off by rounding, have another scale, or make a perspective."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scenes.arithmetic import affine
from scenes.canonical import Scene, SceneError
from scenes.formats.conversion import load_scene_file, save_scene_file
from tests.scenes.formats.files import HEAD, SENSOR

PLACE = (1.0, 2.0, 3.0)
SPHERE = f'{HEAD}Transform [ROWS]\nShape "sphere"\nWorldEnd\n'
TEXTS = {
    "a.pbrt": SPHERE,
    "a.lxs": SPHERE,
    "a.xml": f'<scene version="0.5.0">{SENSOR}<shape type="sphere"><transform name="toWorld">'
    '<matrix value="ROWS"/></transform></shape></scene>',
}


def placed(name: str, row: tuple[float, ...], folder: Path) -> Scene:
    """The scene of a sphere whose transform has this last row, and translates by :data:`PLACE`."""
    matrix = np.eye(4) * row[3]
    matrix[:3, 3] = np.array(PLACE) * row[3]
    matrix[3] = row
    if name.endswith(".gltf"):
        mesh = {"primitives": [{"attributes": {"POSITION": 0}}]}
        data = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
        (folder / "a.bin").write_bytes(data)
        tree = {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "meshes": [mesh],
                "nodes": [{"mesh": 0, "matrix": matrix.T.ravel().tolist()}],
                "buffers": [{"uri": "a.bin", "byteLength": 36}], "bufferViews": [{"buffer": 0, "byteLength": 36}],
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}]}  # fmt: skip
        (folder / name).write_text(json.dumps(tree))
    elif name.endswith(".usda"):
        pytest.importorskip("pxr")
        rows = ", ".join(str(tuple(column)) for column in matrix.T.tolist())
        ops = f'matrix4d xformOp:transform = ( {rows} )\nuniform token[] xformOpOrder = ["xformOp:transform"]'
        (folder / name).write_text(f'#usda 1.0\ndef Sphere "ball"\n{{\n{ops}\n}}\n')
    else:
        numbers = matrix if name.endswith(".xml") else matrix.T
        (folder / name).write_text(TEXTS[name].replace("ROWS", " ".join(map(repr, numbers.ravel().tolist()))))
    return load_scene_file(folder / name)


@pytest.mark.parametrize("row", [(0.0, 0.0, 0.0, 0.9999999999999999), (1e-17, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 2.0)])
@pytest.mark.parametrize("name", [*TEXTS, "a.gltf", "a.usda"])
def test_last_rows_become_exact_and_files_can_be_read_again(name: str, row: tuple[float, ...], tmp_path: Path) -> None:
    scene = placed(name, row, tmp_path)
    (one,) = scene.instances
    assert one.to_world[3].tolist() == [0.0, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(one.to_world[:3, 3], PLACE, rtol=1e-12)
    for ending in (".pbrt", ".lxs", ".xml", ".usda", ".gltf"):
        save_scene_file(scene, tmp_path / f"again{ending}")
        load_scene_file(tmp_path / f"again{ending}")


@pytest.mark.parametrize("name", [*TEXTS, "a.gltf", "a.usda"])
def test_a_perspective_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="last row|perspective"):
        placed(name, (0.0, 0.1, 0.0, 1.0), tmp_path)


def test_no_last_row_of_zeros() -> None:
    assert affine(np.diag([1.0, 1.0, 1.0, 0.0])) is None
