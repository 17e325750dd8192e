"""The work for a shape or a transform does not depend on how many there are."""

from __future__ import annotations

import gc
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from scenes import arithmetic
from scenes.canonical import ConstantTexture, Instance, Matte, PerspectiveCamera, Scene, Sphere
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.geometry import recognition, transform_stack
from scenes.formats.geometry.orientation import scales_evenly
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
