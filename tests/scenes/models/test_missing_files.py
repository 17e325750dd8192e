"""Files that a model names and that are not there are losses; the rest of the model is drawn."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.canonical import ConstantTexture, Glass, MetallicRough, Phong, SceneError
from scenes.formats.appearance.folding import mean_of
from scenes.formats.conversion import load_scene_file
from scenes.formats.losses import LossReport
from scenes.models import read_model
from scenes.models.gltf_data import GltfData
from tests.scenes.models.files import QUAD_UVS, Gltf
from tests.scenes.models.test_obj_files import FACE, SQUARE, model


def test_a_missing_library_leaves_its_materials_grey(tmp_path: Path) -> None:
    (tmp_path / "there.mtl").write_text("newmtl b\nKd 0 0 1\n")
    path = tmp_path / "in.obj"
    path.write_text(f"mtllib gone.mtl there.mtl\n{SQUARE}usemtl a\n{FACE}usemtl b\n{FACE}")
    report = LossReport()
    colors = [part.material.diffuse.value for part in read_model(path, report)]
    assert colors == [(0.5, 0.5, 0.5), (0.0, 0.0, 1.0)]
    assert "in: the materials 'gone.mtl', which is missing: left out" in report.text()
    assert "in/a: a material that no library has: grey" in report.text()


def test_missing_pictures_of_a_library_leave_its_colours(tmp_path: Path) -> None:
    path = model(tmp_path, "newmtl a\nKd 0.5 0.25 0\nmap_Kd -s 2 2 kd.png\nmap_d d.png\nnorm n.png\n")
    report = LossReport()
    (part,) = read_model(path, report, facets=True)
    assert part.material == Phong(ConstantTexture((0.5, 0.25, 0.0)))
    assert report.text().splitlines() == [
        "material a: the picture 'kd.png', which is missing: the colour without it",
        "material a: the picture 'n.png', which is missing: left out",
        "material a: the picture 'd.png', which is missing: left out",
    ]


@pytest.mark.parametrize("facets", [True, False])
def test_missing_pictures_of_gltf_leave_its_factors(facets: bool, tmp_path: Path) -> None:
    file = Gltf(tmp_path)
    file.attribute("TEXCOORD_0", np.array(QUAD_UVS, np.float32))
    names = ("base.png", "rough.png", "glow.png", "normal.png", "through.png")
    base, rough, glow, normal, through = ({"index": file.texture(name)} for name in names)
    factors = {"baseColorFactor": [0.5, 0.25, 0.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.25}
    file.material(
        name="paint", emissiveFactor=[1.0, 1.0, 1.0], emissiveTexture=glow, normalTexture=normal,
        extensions={"KHR_materials_transmission": {"transmissionTexture": through}},
        pbrMetallicRoughness={**factors, "baseColorTexture": base, "metallicRoughnessTexture": rough},
    )  # fmt: skip
    report = LossReport()
    (part,) = read_model(file.written(), report, facets)
    for name in names if facets else names[:3]:
        became = "no emission" if name == "glow.png" else "left out"
        assert f"material paint: the picture {name!r}, which is missing: {became}" in report.text()
    if facets:
        assert isinstance(part.material, MetallicRough) and part.material.emission == (0.0, 0.0, 0.0)
        assert part.material.base == ConstantTexture((0.5, 0.25, 0.0)) and part.material.roughness == 0.25
    else:
        assert isinstance(part.material, Phong) and mean_of(part.material.diffuse)[2] == 0.0


def test_a_missing_picture_of_the_light_that_passes_leaves_its_share(tmp_path: Path) -> None:
    file = Gltf(tmp_path)
    through = {"transmissionFactor": 1.0, "transmissionTexture": {"index": file.texture("gone.png")}}
    file.material(
        name="pane", pbrMetallicRoughness={"metallicFactor": 0.0, "roughnessFactor": 0.0},
        extensions={"KHR_materials_transmission": through},
    )  # fmt: skip
    report = LossReport()
    (part,) = read_model(file.written(), report, facets=True)
    assert isinstance(part.material, Glass) and part.material.thin
    assert report.text().splitlines() == ["material pane: the picture 'gone.png', which is missing: left out"]


def test_embedded_pictures_are_decoded_once_for_all_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, decoded = Gltf(tmp_path), []
    file.attribute("TEXCOORD_0", np.array(QUAD_UVS, np.float32))
    content = io.BytesIO()
    Image.new("RGB", (2, 2), "red").save(content, "PNG")
    picture = file.texture(f"data:image/png;base64,{base64.b64encode(content.getvalue()).decode()}")
    file.material(pbrMetallicRoughness={"baseColorTexture": {"index": picture}})
    file.json["meshes"][0]["primitives"] *= 5
    given = GltfData.image_bytes
    monkeypatch.setattr(GltfData, "image_bytes", lambda *a: decoded.append(a[1]) or given(*a))
    assert len(read_model(file.written(), facets=True)) == 5 and decoded == [0]


def test_a_missing_buffer_ends_the_command_since_it_holds_the_shape(tmp_path: Path) -> None:
    file = Gltf(tmp_path)
    file.json["buffers"][0]["uri"] = "gone.bin"
    with pytest.raises(SceneError, match=r"expected a buffer at .*gone\.bin, found no file"):
        read_model(file.written())


def test_a_strict_conversion_refuses_a_model_whose_picture_is_missing(tmp_path: Path) -> None:
    report = LossReport()
    load_scene_file(model(tmp_path, "newmtl a\nmap_Kd gone.png\n"), None, report)
    with pytest.raises(SceneError, match=r"without losses, got material a: the picture 'gone\.png'"):
        report.refuse_any()
