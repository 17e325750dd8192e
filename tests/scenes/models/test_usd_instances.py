"""Instances of USD files: what they share, what they inherit, and how many there may be."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenes.canonical import SceneError
from scenes.formats.losses import LossReport
from scenes.models import read_model
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
