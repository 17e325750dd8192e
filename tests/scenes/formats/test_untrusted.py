"""Hostile files: each makes a scene or one clear line."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenes.canonical import ConstantTexture, Instance, Matte, Mesh, PerspectiveCamera, Scene, SceneError, Sphere
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.directives.surface_writer import SurfaceWriter
from scenes.formats.geometry.ply_writing import ply_bytes
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.write_elements import ElementWriter
from scenes.formats.text.scene_files import SceneFiles
from tests.scenes.formats.files import HEAD, mitsuba, pbrt


@pytest.mark.parametrize(
    "name", ["/etc/passwd", "../secret.pbrt", "..\\\\secret.pbrt", "C:/x.pbrt", "deep/../../secret.pbrt"]
)
@pytest.mark.parametrize("directive", ['Include "{}"', 'Shape "plymesh" "string filename" "{}"'])
def test_paths_that_lead_out_are_refused(name: str, directive: str, tmp_path: Path) -> None:
    (tmp_path / "secret.pbrt").write_text(HEAD)
    (tmp_path / "scene" / "deep").mkdir(parents=True)
    with pytest.raises(SceneError, match=r"expected a (relative file name|file inside)"):
        pbrt(tmp_path / "scene", directive.format(name))


def test_a_link_that_leads_out_is_refused_and_a_root_allows_it(tmp_path: Path) -> None:
    (tmp_path / "part.pbrt").write_text('Shape "sphere"')
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "link.pbrt").symlink_to(tmp_path / "part.pbrt")
    for name in ("link.pbrt", "../part.pbrt"):
        file = tmp_path / "scene" / "a.pbrt"
        file.write_text(f'{HEAD}Include "{name}"')
        with pytest.raises(SceneError, match="expected a file inside"):
            load_scene_file(file)
        assert len(load_scene_file(file, tmp_path).instances) == 1


def test_loops_and_depth_of_includes(tmp_path: Path) -> None:
    (tmp_path / "b.pbrt").write_text('Include "a.pbrt"')
    with pytest.raises(SceneError, match="do not include themselves"):
        pbrt(tmp_path, 'Include "b.pbrt"')
    for number in range(20):
        (tmp_path / f"n{number}.pbrt").write_text(f'Include "n{number + 1}.pbrt"')
    with pytest.raises(SceneError, match="at most 16 files inside each other"):
        pbrt(tmp_path, 'Include "n0.pbrt"')


def test_compressed_meshes_are_read_and_bombs_are_not(tmp_path: Path) -> None:
    mesh = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    (tmp_path / "m.ply.gz").write_bytes(gzip.compress(ply_bytes(mesh)))
    shape = 'Shape "plymesh" "string filename" "m.ply.gz"'
    assert len(pbrt(tmp_path, shape)[0].instances) == 1
    (tmp_path / "m.ply.gz").write_bytes(gzip.compress(b"ply\n" + bytes(1 << 22)))
    files = SceneFiles(tmp_path / "a.pbrt", None, 1 << 16)
    with pytest.raises(SceneError, match="expected at most 65,536 bytes"):
        files.read(tmp_path / "m.ply.gz", "a.pbrt:1:1")


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("AttributeBegin", "expected every block to end, AttributeBegin does not"),
        ("AttributeEnd", "a.pbrt:4:1: AttributeEnd: expected a AttributeBegin before it, got none"),
        ("TransformBegin AttributeEnd", "expected a AttributeBegin before it, got TransformBegin"),
        ("AttributeBegin\n" * 2000, "expected at most 1024 blocks"),
        ("Strange 1 2", "a.pbrt:4:1: expected a directive, got 'Strange'"),
        ("Translate 1 2", "expected 3 numbers, got 2"),
        ("Scale 1 0 1", "expected a matrix that can be inverted"),
        ("LookAt 0 0 0 0 0 1 0 0 1", "expected an upward direction across the line of sight"),
        ('Shape "sphere" [' + "1 " * 90 + "]", "expected a parameter such as .float fov., got .1. 1. 1."),
        ('ObjectInstance "x"', "expected an object made before, got 'x'"),
        ('Shape "sphere" "float radius" 0', "radius: expected a positive number, got 0"),
        (
            'Shape "trianglemesh" "integer indices" [0 1 5] "point P" [0 0 0 1 0 0 0 1 0]',
            "expected indices from 0 to 2, got 5",
        ),
        ('Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1]', "expected points P and indices"),
        ('Include "none.pbrt"', "expected a file at .*none.pbrt, found none"),
    ],
)
def test_faults_of_directives(body: str, message: str, tmp_path: Path) -> None:
    refused(pbrt, body, message, tmp_path)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("<shape", r"a.xml:3:\d+: expected well-formed XML"),
        ('<shape type="sphere"><float name="radius" value="nan"/></shape>', "radius: expected 1 numbers up to 1e"),
        ('<shape type="sphere"><float name="radius" value="1e308"/></shape>', "radius: expected 1 numbers up to 1e"),
        ('<shape type="obj"><string name="filename" value="../x.obj"/></shape>', "expected a file inside"),
        ('<shape type="obj"><string name="filename" value="/etc/passwd"/></shape>', "expected a relative file name"),
        ('<include filename="a.xml"/>', "do not include themselves"),
        ('<bsdf type="twosided"/>', "expected a bsdf inside, got 0"),
        ('<bsdf type="twosided" id="t"><ref id="t"/></bsdf>', "expected at most 32 materials inside each other"),
        (
            '<integrator type="path"><integer name="maxDepth" value="$d"/></integrator>',
            "expected a parameter with a default",
        ),
        ("<shape>" * 80 + "</shape>" * 80, "expected at most 64 elements inside each other"),
        (
            '<shape type="cube"><transform name="toWorld"><scale value="0"/></transform></shape>',
            "expected one that can be inverted",
        ),
    ],
)
def test_faults_of_elements(body: str, message: str, tmp_path: Path) -> None:
    refused(mitsuba, body, message, tmp_path)


def refused(read: Callable, body: str, message: str, folder: Path) -> None:
    """Reads a text, which ends in one line that says so."""
    with pytest.raises(SceneError, match=message) as error:
        read(folder, body)
    assert "\n" not in str(error.value)


BOMB = """<?xml version="1.0"?><!DOCTYPE scene [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]><scene version="0.5.0">&c;</scene>"""
OUTSIDE = """<?xml version="1.0"?><!DOCTYPE scene [<!ENTITY x SYSTEM "file:///etc/passwd">]><scene>&x;</scene>"""


@pytest.mark.parametrize("text", [BOMB, OUTSIDE])
def test_bombs_and_outside_entities_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(text)
    with pytest.raises(SceneError, match="expected no document type and no entities"):
        load_scene_file(tmp_path / "a.xml")


UNKNOWN = [
    *(
        (pbrt, "a.pbrt:4:1", 'Shape "sphere"', body, loss)
        for body, loss in (
            ('Shape "blob" "float size" 2', "shape 'blob', which is not known: left out"),
            ('Shape "nurbs"', "shape 'nurbs': left out"),
            ('Material "plaster" "rgb c" [1 1 1]', "material 'plaster', which is not known: grey, matte"),
            ('LightSource "bulb" "float watts" 60', "light 'bulb', which is not known: left out"),
            ('Texture "t" "color" "cells" "float size" 2', "texture 'cells', which is not known: the constant 0.5"),
            ('AreaLightSource "glowing"', "area light 'glowing', which is not known: diffuse"),
            (
                'MakeNamedMedium "fog" "string type" "cloud"',
                "the medium 'fog' of the type 'cloud' (participating medium): left out",
            ),
            ('MediumInterface "fog" ""', "the medium 'fog', which is not defined: vacuum"),
        )
    ),
    *(
        (mitsuba, "a.xml:3:1", '<shape type="sphere"/>', body, loss)
        for body, loss in (
            ('<shape type="blob"><float name="size" value="2"/></shape>', "shape 'blob', which is not known: left out"),
            ('<shape type="heightfield"/>', "shape 'heightfield': left out"),
            ('<bsdf type="plaster"/>', "material 'plaster', which is not known: grey, matte"),
            (
                '<emitter type="bulb"><float name="w" value="6"/></emitter>',
                "emitter 'bulb', which is not known: left out",
            ),
            (
                '<medium type="heterogeneous" id="fog"/>',
                "the medium 'fog' of the type 'heterogeneous' (participating medium): left out",
            ),
            ('<integrator type="guess"/>', "integrator 'guess', which is not known: path"),
        )
    ),
]


@pytest.mark.parametrize(("read", "place", "sphere", "body", "loss"), UNKNOWN, ids=[row[-1] for row in UNKNOWN])
def test_what_is_not_known_is_reported_once_and_the_rest_is_read(
    read: Callable, place: str, sphere: str, body: str, loss: str, tmp_path: Path
) -> None:
    scene, lost = read(tmp_path, f"{body}\n{sphere}")
    assert lost == [f"{place}: {loss}"] and len(scene.instances) == 1


def test_settings_that_are_not_known_are_reported(tmp_path: Path) -> None:
    _, lost = pbrt(tmp_path, "", 'Integrator "guess"\nPixelFilter "soft"\nSampler "dice"\n' + HEAD)
    kinds = ("integrator 'guess'", "filter 'soft'", "sampler 'dice'")
    assert [one.split(": ")[1] for one in lost] == [f"{kind}, which is not known" for kind in kinds]


def test_a_loss_is_an_error_where_none_is_wanted_and_nothing_is_left(tmp_path: Path) -> None:
    report = LossReport()
    (tmp_path / "a.pbrt").write_text(HEAD + 'Shape "cone"\n')
    scene = load_scene_file(tmp_path / "a.pbrt", None, report)
    with pytest.raises(SceneError, match="expected a conversion without losses, got .*shape 'cone'"):
        save_scene_file(scene, tmp_path / "out" / "b.pbrt", None, report, strict=True)
    assert list((tmp_path / "out").iterdir()) == []


class Asked(set[str]):
    """A set that counts how often it is asked."""

    times = 0

    def __contains__(self, name: object) -> bool:
        self.times += 1
        return super().__contains__(name)


@pytest.mark.parametrize("target", ["pbrt", "pbrt4", "luxrender", "mitsuba3"])
def test_names_of_many_materials_cost_the_same_each(
    target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = Asked()
    for kind in (SurfaceWriter, ElementWriter):

        def counted(writer: Any, *names: str, label: Callable[..., str] = kind.label) -> str:
            writer._taken = taken
            return label(writer, *names)

        monkeypatch.setattr(kind, "label", counted)
    shapes = (Instance(Sphere(1.0), Matte(ConstantTexture((number / 500.0,) * 3))) for number in range(500))
    save_scene_file(Scene(PerspectiveCamera(), tuple(shapes)), tmp_path / "b", target)
    assert 500 <= len(taken) <= taken.times <= 3 * len(taken)
