"""Instances of USD files: what they share, what they inherit, and how many there may be."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenes.canonical import SceneError
from scenes.formats.losses import LossReport
from scenes.models import read_model, read_whole, usd_files
from tests.scenes.models.usd import material, mesh, written

BALL = 'def Sphere "ball" { }'


def test_instances_inherit_materials_and_colours_of_their_own(tmp_path: Path) -> None:
    inherited = ("rel material:binding = </Mat>", "rel material:binding = </Blue>",
                 "color3f[] primvars:displayColor = [(0, 1, 0)]",
                 "color3f[] primvars:displayColor = [(1, 1, 0)]", "rel material:binding = </Mat>")  # fmt: skip
    body = f'class Xform "P" {{ {BALL} }}\n' + "".join(
        f"""def Xform "i{number}" (instanceable = true
        inherits = </P>
        prepend apiSchemas = ["MaterialBindingAPI"]) {{ {inside} }}
        """
        for number, inside in enumerate(inherited)
    )
    body += material("color3f inputs:diffuseColor = (1, 0, 0)")
    body += material("color3f inputs:diffuseColor = (0, 0, 1)", name="Blue")
    parts = read_model(written(tmp_path, body))
    colors = [(1, 0, 0), (0, 0, 1), (0, 1, 0), (1, 1, 0), (1, 0, 0)]
    assert [part.material.diffuse.value for part in parts] == colors


@pytest.mark.parametrize("kind", ["over", "class"])
def test_prototypes_that_are_not_defined_are_drawn_by_their_instances_alone(kind: str, tmp_path: Path) -> None:
    body = f"""{kind} "Hidden" {{ {BALL} }}
    def PointInstancer "many" {{
        int[] protoIndices = [0, 0]
        point3f[] positions = [(1, 0, 0), (5, 0, 0)]
        rel prototypes = [</Hidden/ball>]
    }}
    """
    assert [part.to_world[0, 3] for part in read_model(written(tmp_path, body))] == [1.0, 5.0]


@pytest.mark.parametrize("leaf", ['def Xform "p3" { }', 'def SphereLight "p3" { }', 'def Camera "p3" { }'])
def test_nested_instances_are_counted_whatever_they_hold(
    leaf: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("scenes.models.usd_instances.INSTANCES_MOST", 20)
    body = "".join(
        f"""def PointInstancer "p{depth}" {{
        int[] protoIndices = [0, 0, 0, 0]
        point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)]
        rel prototypes = [</p{depth + 1}>]
    }}
    """
        for depth in range(3)
    )
    with pytest.raises(SceneError, match="expected at most 20 instances"):
        read_model(written(tmp_path, mesh() + body + leaf))


def test_losses_of_composition_are_the_same_each_time(tmp_path: Path) -> None:
    body = mesh() + "".join(
        f'def Xform "{name}" (references = </{other}>) {{ }}\n' for name, other in (("a", "b"), ("b", "a"))
    )
    path, report = written(tmp_path, body), LossReport()
    read_model(path, report)
    assert "Cycle detected" in report.text() and "0x" not in report.text()


def test_like_instances_are_read_once_and_placed_each(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those with a material, a primvar or a visibility of their own, or with a lamp within, are not alike."""
    calls = []
    shapes = usd_files._Reader._shapes
    monkeypatch.setattr(usd_files._Reader, "_shapes", lambda self, prim: calls.append(prim) or shapes(self, prim))
    ball = """def Xform "arm" { double3 xformOp:translate = (0, 2, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Sphere "ball" { double radius = 0.5 } }"""
    own = {
        5: "rel material:binding = </Mat>", 6: "color3f[] primvars:displayColor = [(0, 1, 0)]",
        7: 'token visibility = "invisible"', 8: "rel material:binding = </Mat>",
        9: 'uniform token purpose = "guide"',
    }  # fmt: skip
    body = f'class Xform "P" {{ {ball} }}\n' + "".join(
        f"""def Xform "i{number}" (instanceable = true
        inherits = </P>
        prepend apiSchemas = ["MaterialBindingAPI"]) {{
        double3 xformOp:translate = ({number}, 0, 0)
        float xformOp:rotateZ = 90
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]
        {own.get(number, "")} }}
        """
        for number in range(40)
    )
    parts = read_model(written(tmp_path, body + material("color3f inputs:diffuseColor = (1, 0, 0)")))
    assert [round(part.to_world[0, 3]) for part in parts] == [
        number - 2 for number in range(40) if number not in (7, 9)
    ]
    assert all(part.to_world[:3, 0] == pytest.approx((0.0, 1.0, 0.0)) for part in parts)
    assert all(part.shape.radius == 0.5 and part.name == "in/ball" for part in parts)
    colors = [part.material.diffuse.value for part in parts]
    assert colors[5] == colors[7] == (1.0, 0.0, 0.0) and colors[6] == (0.0, 1.0, 0.0)
    assert len({*colors}) == 3 and len(calls) < 10


def test_what_is_no_shape_is_read_in_every_instance(tmp_path: Path) -> None:
    inside = f'{BALL}\ndef SphereLight "lamp" {{ bool treatAsPoint = 1 }}'
    body = f'class Xform "P" {{ {inside} }}\n' + "".join(
        f'def Xform "i{number}" (instanceable = true\ninherits = </P>) {{'
        f' double3 xformOp:translate = ({number}, 0, 0)\n uniform token[] xformOpOrder = ["xformOp:translate"] }}\n'
        for number in range(3)
    )
    whole = read_whole(written(tmp_path, body))
    assert [light.position[0] for light in whole.lights] == [part.to_world[0, 3] for part in whole.parts] == [0, 1, 2]
