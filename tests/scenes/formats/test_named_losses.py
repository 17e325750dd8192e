"""Losses of what no format or no reader here holds, and how a report lists many equal ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenes.canonical import Glass, Instance, Integrator, Medium, PerspectiveCamera, Scene, Sphere
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import HEAD

V4 = 'Camera "perspective"\nWorldBegin\nMakeNamedMedium "m" "string type" "{}"\nMediumInterface "m" ""\n'
HELD = {
    "a.lxs": (f'{HEAD}Shape "hairfile" "string filename" ["a.hair"]\nWorldEnd\n', "hair (hairfile)"),
    "b.lxs": (
        f'{HEAD}MakeNamedVolume "v" "heterogeneous"\nInterior "v"\nShape "sphere"\nWorldEnd\n',
        "the volume 'v' of the type 'heterogeneous' (participating medium)",
    ),
    **{
        f"{kind}.pbrt": (
            V4.format(kind) + 'Material "interface"\nShape "sphere"\n',
            f"the medium 'm' of the type '{kind}' (participating medium)",
        )
        for kind in ("uniformgrid", "rgbgrid", "cloud", "nanovdb")
    },
    "a.pbrt": (
        f'Integrator "volpath"\n{HEAD}MakeNamedMedium "m" "string type" "heterogeneous"\nMediumInterface "m" ""\n'
        'Shape "sphere"\nWorldEnd\n',
        "the medium 'm' of the type 'heterogeneous' (participating medium)",
    ),
    "a.xml": (
        '<scene version="3.0.0"><sensor type="perspective"/><shape type="sphere">'
        '<medium type="heterogeneous" name="interior"/><bsdf type="null"/></shape></scene>',
        "the medium of the type 'heterogeneous' (participating medium)",
    ),
    "a.scn": (
        "scene.camera.type = perspective\nscene.volumes.v.type = heterogeneous\nscene.materials.m.type = glass\n"
        "scene.materials.m.volume.interior = v\nscene.objects.o.material = m\n"
        "scene.objects.o.vertices = 0 0 0 1 0 0 0 1 0\nscene.objects.o.faces = 0 1 2\n",
        "the volume 'v' of the type 'heterogeneous' (participating medium)",
    ),
}


@pytest.mark.parametrize("name", HELD)
def test_hair_files_and_uneven_media_are_named(name: str, tmp_path: Path) -> None:
    text, what = HELD[name]
    (tmp_path / name).write_text(text)
    report = LossReport()
    load_scene_file(tmp_path / name, None, report)
    assert [(loss.became, loss.picture) for loss in report.losses if loss.what == what] == [("left out", True)]


@pytest.mark.parametrize("name", ["a.usda", "a.usdz"])
def test_usd_has_no_absorption(name: str, tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    ball = Instance(Sphere(), Glass(), interior=Medium(absorption=(1.0, 2.0, 3.0)))
    report = LossReport()
    save_scene_file(Scene(PerspectiveCamera(), (ball,), integrator=Integrator("path")), tmp_path / name, None, report)
    assert "a medium inside a surface (absorbing)" in [loss.what for loss in report.losses if loss.picture]


def test_a_report_lists_ten_places_of_equal_losses() -> None:
    report = LossReport()
    for number in range(25):
        report.add(f"ball{number}", "a sphere", "a mesh")
    report.add("light", "a sky")
    rows = report.rows()
    assert [row["where"] for row in rows] == [*(f"ball{number}" for number in range(10)), "light"]
    assert [row.get("more") for row in rows] == [*[None] * 9, 15, None]
    assert len(report.losses) == 26 and report.lines()[1] == "  ball0 (and 24 more): a sphere: a mesh"
