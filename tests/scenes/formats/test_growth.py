"""The work for a shape or a transform does not depend on how many there are."""

from __future__ import annotations

import dataclasses
import gc
import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from scenes import arithmetic
from scenes.arithmetic import product
from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    Disk,
    Instance,
    Matte,
    Mesh,
    PerspectiveCamera,
    RigidTrack,
    Scene,
    Sphere,
)
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.geometry import recognition, transform_stack
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.geometry.orientation import FLIPPED, scales_evenly
from scenes.formats.geometry.placing import placed
from scenes.formats.geometry.transform_stack import TransformStack, rotation, translation
from scenes.formats.mitsuba import read as mitsuba_read
from scenes.formats.text.xml_tree import xml_text
from tests.scenes.formats.files import HEAD, SENSOR


def test_keys_without_motion_share_one_product(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    monkeypatch.setattr(transform_stack, "product", lambda *pair: made.append(pair) or arithmetic.product(*pair))
    stack = TransformStack()
    for number in range(100):
        stack.push()
        stack.apply(rotation(number, 0.0, 1.0, 0.0))
        stack.apply(translation(1.0, 0.0, 0.0))
        stack.pop()
    assert len(made) == 200 and not stack.moves
    stack.active = (False, True)
    stack.apply(translation(1.0, 0.0, 0.0))
    stack.active = (True, True)
    stack.apply(translation(0.0, 1.0, 0.0))
    assert stack.moves and len(made) == 203
    np.testing.assert_array_equal([key[:3, 3] for key in stack.current], [[0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])


def test_documents_are_those_of_the_library() -> None:
    root = ElementTree.Element("scene", {"version": "3.0.0"})
    inner = ElementTree.SubElement(root, "shape", {"id": 'a "b" <c> & d'})
    ElementTree.SubElement(inner, "ref", {"id": "é"})
    ElementTree.SubElement(root, "float", {"name": "x", "value": "1"})
    text = xml_text(root)
    ElementTree.indent(root, "\t")
    assert text.partition("\n")[2].rstrip("\n") == ElementTree.tostring(root, "unicode")
    assert text.startswith("<?xml version='1.0' encoding='utf-8'?>\n")


@pytest.mark.parametrize(
    ("matrix", "even"),
    [
        (np.diag([2.0, -2.0, 2.0]), True),
        (3.0 * rotation(30.0, 1.0, 2.0, 3.0)[:3, :3], True),
        (np.diag([1.0, 1.0, 1.01]), False),
        (np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), False),
    ],
)
def test_even_scales_are_told_from_stretches_and_shears(matrix: np.ndarray, even: bool) -> None:
    assert scales_evenly(matrix) is even


def test_cycles_are_not_searched_while_a_file_is_read_and_are_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.xml").write_text(f'<scene version="0.5.0">{SENSOR}</scene>')
    seen = []
    parse = mitsuba_read.parse_xml
    monkeypatch.setattr(mitsuba_read, "parse_xml", lambda *given: seen.append(gc.isenabled()) or parse(*given))
    scene = load_scene_file(tmp_path / "a.xml")
    save_scene_file(scene, tmp_path / "b.pbrt")
    assert seen == [False] and gc.isenabled()


def test_a_directive_after_many_lines_has_its_place(tmp_path: Path) -> None:
    (tmp_path / "a.pbrt").write_text(
        HEAD + "# a comment\n" + 'Shape "sphere" "float radius" [\n1 # one\n]\n' * 2 + "  Strange\n"
    )
    with pytest.raises(ValueError, match=r"a\.pbrt:11:3: expected a directive, got 'Strange'"):
        load_scene_file(tmp_path / "a.pbrt")


def _balls(kind: str) -> tuple[Instance, ...]:
    """Shapes of 20 sizes."""
    grey = ConstantTexture((0.5, 0.5, 0.5))
    checks = CheckerboardTexture(grey, ConstantTexture((0.1, 0.1, 0.1)))
    place = translation(1.0, 2.0, 3.0)
    one = Instance(Sphere(), Matte(checks if kind.startswith("textured") else grey), place)
    if kind == "moving":
        one = dataclasses.replace(one, track=RigidTrack(0.0, 1.0, np.eye(3)[:2], np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))))
    elif kind == "lamps":
        one = dataclasses.replace(one, emission=(1.0, 2.0, 3.0))
    elif kind == "mirrored":
        one = dataclasses.replace(one, to_world=product(place, FLIPPED))
    disk = kind.endswith("disks")
    return tuple(dataclasses.replace(one, shape=(Disk if disk else Sphere)(0.5 + 0.1 * size)) for size in range(20))


@pytest.mark.parametrize("kind", ["still", "moving", "lamps", "mirrored", "disks", "textured", "textured disks"])
@pytest.mark.parametrize("name", ["a.lxs", "a.gltf", "a.usda", "a.xml"])
def test_shapes_of_all_sizes_share_a_mesh(kind: str, name: str, tmp_path: Path) -> None:
    balls = _balls(kind)
    save_scene_file(Scene(PerspectiveCamera(), balls), tmp_path / name)
    if name == "a.gltf":
        assert len(json.loads((tmp_path / name).read_text())["meshes"]) == 1
    elif name == "a.usda":
        assert (tmp_path / name).read_text().count("point3f[] points") <= 1
    else:
        assert len(list(tmp_path.rglob("*.ply"))) <= 1
    found = load_scene_file(tmp_path / name).instances
    for wanted, one in zip(balls, found, strict=True):
        np.testing.assert_allclose(_ends(one), _ends(wanted), atol=0.04)


def _ends(instance: Instance) -> np.ndarray:
    """Corners ``(2, 3)`` of the box about a shape at the start of its motion."""
    points = product(as_mesh(instance.shape).vertices.astype(np.float64), instance.to_world[:3, :3].T)
    moved = placed(instance.track, instance.to_world)[:3, 3]
    return np.stack([points.min(axis=0), points.max(axis=0)]) + moved


@pytest.mark.parametrize("reverse", ["", "ReverseOrientation\n"])
def test_a_mesh_file_of_many_shapes_is_recognised_once(
    reverse: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Spheres are meshes in LuxRender, which are looked at when they are read."""
    ball = Instance(Sphere(), Matte(ConstantTexture((0.5, 0.5, 0.5))))
    save_scene_file(Scene(PerspectiveCamera(), (ball,)), tmp_path / "a.lxs")
    text = (tmp_path / "a.lxs").read_text().replace("\tAttributeBegin\n", f"\tAttributeBegin\n{reverse}")
    start, end = text.index("\tAttributeBegin"), text.index("WorldEnd")
    (tmp_path / "a.lxs").write_text(text[:start] + 20 * text[start:end] + text[end:])
    made = []
    recognised = recognition.recognised
    monkeypatch.setattr(recognition, "recognised", lambda mesh: made.append(mesh) or recognised(mesh))
    read = load_scene_file(tmp_path / "a.lxs")
    assert len(read.instances) == 20 and 1 <= len(made) <= 2  # with and without its texture coordinates


@pytest.mark.parametrize("name", ["a.pbrt", "a.xml"])
def test_spheres_inside_out_of_all_sizes_share_a_mesh(name: str, tmp_path: Path) -> None:
    if name == "a.pbrt":
        balls = (f'Shape "sphere" "float radius" {0.5 + 0.1 * size}\n' for size in range(20))
        text = f"{HEAD}ReverseOrientation\n{''.join(balls)}WorldEnd\n"
    else:
        flipped = '<boolean name="flipNormals" value="true"/>'
        balls = (
            f'<shape type="sphere"><float name="radius" value="{0.5 + 0.1 * size}"/>{flipped}</shape>'
            for size in range(20)
        )
        text = f'<scene version="0.5.0">{SENSOR}{"".join(balls)}</scene>'
    (tmp_path / name).write_text(text)
    found = load_scene_file(tmp_path / name).instances
    assert len({id(one.shape) for one in found}) == 1
    wide = [np.ptp(_ends(one), axis=0) for one in found]
    np.testing.assert_allclose(wide, np.repeat(1.0 + 0.2 * np.arange(20)[:, None], 3, axis=1), rtol=1e-4)
    shape = found[0].shape
    assert isinstance(shape, Mesh) and shape.normals is not None
    assert ((shape.normals * shape.vertices).sum(axis=1) < -0.9).all()
