"""Meshes with several materials: parts with one name and place are one mesh in the formats that have such."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    ConstantTexture,
    ImageTexture,
    Instance,
    Matte,
    Mesh,
    PerspectiveCamera,
    PointLight,
    Scene,
)
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]], np.float32)
FACE = np.array([[0, 1, 2]], np.int32)
PLAIN = Mesh(CORNERS[[0, 1, 2]], FACE)
WITH_UVS = Mesh(CORNERS[[1, 2, 3]], FACE, None, np.array([[0, 0], [1, 0], [0, 1]], np.float32))
SMOOTH = dataclasses.replace(PLAIN, normals=np.tile(np.array([0, 0, 1], np.float32), (3, 1)))
RED = Matte(ConstantTexture((0.5, 0.25, 0.125)))
CHECKED = Matte(ImageTexture(np.array([[[1, 0, 0], [0, 1, 0]]], np.float32)))


def at(x: float) -> np.ndarray:
    place = np.eye(4)
    place[0, 3] = x
    return place


def scene(*parts: Instance) -> Scene:
    return Scene(PerspectiveCamera(at(0.0)), parts, (PointLight((0.0, 0.0, 5.0), (1.0, 1.0, 1.0)),))


def body(x: float, name: str, **more: object) -> tuple[Instance, Instance]:
    first, second = Instance(PLAIN, RED, at(x), name=name), Instance(WITH_UVS, CHECKED, at(x), name=name)
    return first, dataclasses.replace(second, **more)


def read_back(folder: Path, wanted: Scene, name: str) -> tuple[Instance, ...]:
    report = LossReport()
    save_scene_file(wanted, folder / name, None, report)
    assert not [loss for loss in report.losses if loss.picture]
    return load_scene_file(folder / name).instances


def apart(wanted: Scene) -> Scene:
    """The same with a name for each part, so that each is a mesh."""
    named = [dataclasses.replace(one, name=f"part{number}") for number, one in enumerate(wanted.instances)]
    return dataclasses.replace(wanted, instances=tuple(named))


def test_parts_are_primitives_of_one_mesh_of_glTF(tmp_path: Path) -> None:
    wanted = scene(*body(0.0, "a/body"), *body(2.0, "a/body"), Instance(PLAIN, RED, at(4.0), name="a/one"))
    found = read_back(tmp_path, wanted, "a.gltf")
    tree = json.loads((tmp_path / "a.gltf").read_text())
    assert [len(mesh["primitives"]) for mesh in tree["meshes"]] == [2, 1]
    assert [node["mesh"] for node in tree["nodes"] if "mesh" in node] == [0, 0, 1]
    assert tree["meshes"][0]["primitives"][0]["attributes"] == tree["meshes"][1]["primitives"][0]["attributes"]
    assert difference(wanted.instances, found) is None
    assert found[0].shape is found[2].shape and found[1].material is found[3].material


@pytest.mark.parametrize("name", ["a.usda", "a.usdc", "a.usdz"])
def test_parts_are_subsets_of_one_mesh_of_USD(name: str, tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdShade  # type: ignore[import-not-found]

    wanted = scene(*body(0.0, "a/body"), *body(2.0, "a/body"), *body(4.0, "a/once"), Instance(SMOOTH, RED, at(5.0)))
    found = read_back(tmp_path, wanted, name)
    stage = Usd.Stage.Open(str(tmp_path / name))
    meshes = [prim for prim in stage.Traverse(Usd.TraverseInstanceProxies()) if prim.IsA(UsdGeom.Mesh)]
    subsets = [UsdGeom.Subset.GetGeomSubsets(UsdGeom.Mesh(prim)) for prim in meshes]
    assert [len(one) for one in subsets] == [2, 2, 2, 0]
    assert len(stage.GetPrototypes()) == 1
    for prim, parts in zip(meshes[:3], subsets, strict=False):
        assert UsdGeom.Subset.ValidateFamily(UsdGeom.Mesh(prim), UsdGeom.Tokens.face, "materialBind") == (True, "")
        bound = [UsdShade.MaterialBindingAPI(part).ComputeBoundMaterial()[0].GetPath() for part in parts]
        assert bound[0] != bound[1]
    (tmp_path / "apart").mkdir()
    assert difference(read_back(tmp_path / "apart", apart(wanted), name), found) is None


@pytest.mark.parametrize("name", ["a.gltf", "a.usda"])
def test_lamps_and_parts_with_other_normals_come_back(name: str, tmp_path: Path) -> None:
    """In USD a mesh is a light as a whole, and has normals everywhere or nowhere."""
    if name.endswith("usda"):
        pytest.importorskip("pxr")
    lamp = body(0.0, "a/body", emission=(3.0, 2.0, 1.0), emission_twosided=True)
    wanted = scene(*lamp, Instance(SMOOTH, RED, at(0.0), name="a/body"), Instance(PLAIN, RED, at(0.0), name="a/body"))
    found = read_back(tmp_path, wanted, name)
    (tmp_path / "apart").mkdir()
    assert difference(read_back(tmp_path / "apart", apart(wanted), name), found) is None
    assert [one.emission for one in found] == [None, (3.0, 2.0, 1.0), None, None]
