"""Whitted's method in formats that do not have it."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenes.canonical import (
    ConstantTexture,
    Glass,
    Instance,
    Integrator,
    Matte,
    Mirror,
    MixMaterial,
    PerspectiveCamera,
    Rectangle,
    Scene,
)
from scenes.formats.conversion import save_scene_file
from scenes.formats.losses import LossReport


@pytest.mark.parametrize(("kind", "ending", "wanted"), [
    ("mitsuba3", ".xml", '<integrator type="direct" />'), ("mitsuba", ".xml", '<integrator type="direct" />'),
    ("pbrt4", ".pbrt", 'Integrator "volpath" "integer maxdepth" [ 1 ]'),
    ("luxrender", ".lxs", 'SurfaceIntegrator "path" "integer maxdepth" [ 2 ]')])  # fmt: skip
def test_whitted_is_direct_light_where_nothing_mirrors(kind: str, ending: str, wanted: str, tmp_path: Path) -> None:
    base = Matte(ConstantTexture((0.5, 0.5, 0.5)))
    for material, same in ((base, True), (MixMaterial(base, Mirror(), base.reflectance), False), (Glass(), False)):
        scene = Scene(PerspectiveCamera(), (Instance(Rectangle(), material),), integrator=Integrator("whitted", 5))
        report = LossReport()
        save_scene_file(scene, tmp_path / f"a{ending}", kind, report)
        assert ("whitted" in report.text()) is not same
        assert (wanted in (tmp_path / f"a{ending}").read_text()) is same


def test_direct_light_of_luxrender_is_what_luxcore_draws(tmp_path: Path) -> None:
    """LuxCore knows paths alone: it draws light of all paths for any other method."""
    base = Matte(ConstantTexture((0.5, 0.5, 0.5)))
    for material, lines in ((base, 'SurfaceIntegrator "path" "integer maxdepth" [ 2 ]'), (Mirror(), "directlighting")):
        scene = Scene(PerspectiveCamera(), (Instance(Rectangle(), material),), integrator=Integrator("direct", 5))
        report = LossReport()
        save_scene_file(scene, tmp_path / "a.lxs", None, report)
        assert lines in (tmp_path / "a.lxs").read_text()
        assert ("light of all paths in LuxCore" in report.text()) is (material is not base)
