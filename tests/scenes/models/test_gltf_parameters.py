"""No property of glTF that the reader knows is lost in silence: each is changed in turn, in a file of nearly all."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from scenes.canonical import SceneError
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file
from scenes.formats.losses import LossReport
from scenes.models import gltf_records, json_records
from scenes.models.json_records import Check
from tests.scenes.models.files import Gltf
from tests.scenes.models.test_gltf_faults import changed, places, whole_file

NOTHING = {
    "buffers.byteLength",  # of the content, which is there
    "accessors.normalized",  # of floating-point numbers
    "extensionsRequired", "extensionsUsed",  # of extensions that are read
    "textures.extensions", "textures.extensions.EXT_texture_webp", "textures.extensions.EXT_texture_webp.source",
    "images.bufferView",  # another place of the same picture
    "materials.extensions.KHR_materials_transmission",  # its factor counts
    "samplers.minFilter",  # pictures are filtered by levels wherever they are not nearest
}  # fmt: skip
VALUES = (0, 1, 2, 3, 0.3, 0.7, True, False, "x", "BLEND", "STEP", "translation", "orthographic", "point",
          [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0, 3, 4, 5, 1],
          [0.1, 0.2, 0.3], [0.9, 0.4], [0.2, 0.3, 0.4, 0.5], 5121, 5123, 33648, 9729, 10497)  # fmt: skip
LOOKS = ("materials", "samplers", "cameras", "nodes", "animations")
"""Lists whose properties must change the scene or the report; changes of others may be refused, which is not silent."""

INDICES = {
    "animations.channels.sampler", "animations.samplers.input", "animations.samplers.output",
    "nodes.extensions.KHR_lights_punctual.light",
}  # fmt: skip
"""Properties of these whose other values are refused: what they would name is not there, or does not fit."""

ABSENT = object()


def variants(folder: Path) -> Iterator[Gltf]:
    """Files that have each part where it counts."""
    Image.new("RGB", (2, 2), (77, 33, 11)).save(folder / "other.png")
    file = whole_file(folder)
    del file.json["materials"][0]["extensions"]["KHR_materials_transmission"]
    file.texture("other.png")
    one, two = file.json["cameras"]
    file.json["cameras"] = [{**one, **two, "type": kind["type"]} for kind in (one, two)]
    file.json["meshes"][0]["primitives"][0]["mode"] = 4
    file.json["bufferViews"][0] |= {"byteOffset": 0, "byteStride": 12}
    file.json["accessors"][0]["byteOffset"] = 0
    yield file
    file.json["nodes"][3]["camera"] = 1
    material = file.json["materials"][0]
    for info in (
        material["normalTexture"],
        material["emissiveTexture"],
        *(part for part in material["pbrMetallicRoughness"].values() if isinstance(part, dict)),
    ):
        info.pop("extensions", None)
    yield file
    file = whole_file(folder)
    del file.json["materials"][0]["extensions"]["KHR_materials_specular"]
    part = {"index": file.texture("other.png")}
    absorbs = {"attenuationColor": [0.9, 0.8, 0.7], "attenuationDistance": 2.0}
    through = {"KHR_materials_transmission": {"transmissionFactor": 1.0, "transmissionTexture": part},
               "KHR_materials_volume": {"thicknessFactor": 1.0, **absorbs}}  # fmt: skip
    file.json["materials"][0]["extensions"] |= through
    yield file
    file = whole_file(folder)
    file.json["materials"][0]["extensions"] = {"KHR_materials_unlit": {}}
    file.json["extensions"]["KHR_lights_punctual"]["lights"][0]["range"] = 3.0
    file.json["nodes"][3] = {"mesh": 0, "translation": [1, 2, 3], "children": [4]}
    file.json["animations"][0]["channels"][0]["target"]["node"] = 1
    yield file


def known(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """The names of all properties in the records."""
    names: set[str] = set()
    real = json_records.record

    def noted(required: Mapping[str, Check] | None = None, /, **optional: Check) -> Check:
        names.update(required or {}, optional)
        return real(required, **optional)

    monkeypatch.setattr(json_records, "record", noted)
    importlib.reload(gltf_records).Records({})
    monkeypatch.undo()
    importlib.reload(gltf_records)
    further = {f"{name}_{place}" for name in ("TEXCOORD", "JOINTS", "WEIGHTS") for place in (1, 2, 3)}
    return names - further  # as the first of them


def made(file: Gltf) -> tuple[Any, list[str]] | None:
    report = LossReport()
    try:
        return load_scene_file(file.written(), None, report), [str(loss) for loss in report.losses]
    except SceneError:
        return None


def shows(before: tuple[Any, list[str]], after: tuple[Any, list[str]] | None) -> bool:
    return after is not None and (before[1] != after[1] or difference(before[0], after[0]) is not None)


def test_no_property_is_lost_in_silence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    met, shown, wholes = set[str](), set[str](), set[str]()
    for file in variants(tmp_path):
        good = json.loads(json.dumps(file.json))
        before = made(file)
        assert before is not None
        for path in places(good):
            name = ".".join(part for part in path if isinstance(part, str))
            met.add(name)
            if path[0] == "asset" or name in shown or name in NOTHING or isinstance(path[-1], int):
                continue
            value = part_at(good, path)
            if isinstance(value, dict) or (isinstance(value, list) and isinstance(value[0], dict)):
                wholes.add(name)  # of other properties
                continue
            for value in (*VALUES, ABSENT):
                file.json = without(good, path) if value is ABSENT else changed(good, path, value)
                after = made(file)
                must_show = (path[0] in LOOKS or "lights" in path) and name not in INDICES
                if shows(before, after) or (after is None and not must_show):
                    shown.add(name)
                    break
        file.json = good
    named = {name.rpartition(".")[2] for name in met}
    untouched = known(monkeypatch) - named - {name.rpartition(".")[2] for name in NOTHING}
    assert untouched == set()
    silent = {name for name in met - wholes - shown - NOTHING if not name.startswith("asset")}
    assert silent == set()


def without(good: dict[str, Any], path: tuple[str | int, ...]) -> dict[str, Any]:
    made = changed(good, path, None)
    holder: Any = made
    for name in path[:-1]:
        holder = holder[name]
    del holder[path[-1]]
    return made


def part_at(good: Any, path: tuple[str | int, ...]) -> Any:
    for name in path:
        good = good[name]
    return good


def test_values_that_differ_are_seen(tmp_path: Path) -> None:
    file = whole_file(tmp_path)
    before = made(file)
    assert before is not None and not shows(before, made(file))
    file.json["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = np.pi / 4.0
    assert shows(before, made(file))
