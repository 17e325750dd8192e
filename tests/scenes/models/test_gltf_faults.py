"""Broken glTF files: each is a scene, or one line with the JSON path of the fault, what was expected and what came."""

from __future__ import annotations

import base64
import copy
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from scenes.canonical import SceneError
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file
from scenes.formats.losses import LossReport
from scenes.models import read_model
from tests.scenes.models.files import QUAD_UVS, Gltf
from tests.scenes.models.test_gltf_views import with_skin

SAID = re.compile(
    r"(model )?\S+: (cannot be read: [\w.\[\]]+: expected .+, got .+"
    r"|cannot be read: [\w.\[\]]+: expected (data in base64|nodes at most 256 deep)"
    r"|expected (a texture|an image|a buffer) at .+, found no file"
    r"|expected at least one face, found none"
    r"|cannot be read: asset.version: expected glTF 2, got version .+"
    r"|requires the extension .+)"
)
HOSTILE = ("VEC9", "", -1, 0, 7, 1.5, 1e300, 10**400, True, None, [], {}, [[]], ["x"], [1e300] * 16)


def whole_file(folder: Path) -> Gltf:
    """A file with a part of each kind that is read."""
    file = with_skin(folder)
    content = io.BytesIO()
    Image.new("RGB", (2, 2), (9, 99, 199)).save(content, "PNG")
    file.attribute("TEXCOORD_0", np.array(QUAD_UVS, np.float32))
    file.attribute("COLOR_0", np.full((4, 4), 128, np.uint8), normalized=True)
    change = {"KHR_texture_transform": {"offset": [0, 1], "rotation": 0.5, "scale": [1, 2], "texCoord": 0}}
    look = {"index": file.texture(f"data:image/png;base64,{base64.b64encode(content.getvalue()).decode()}",
                                  {"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}),
            "texCoord": 0, "extensions": change}  # fmt: skip
    file.material(
        name="paint", alphaMode="MASK", alphaCutoff=0.5, doubleSided=True, emissiveFactor=[1, 1, 0],
        emissiveTexture=look, normalTexture={**look, "scale": 1.0},
        pbrMetallicRoughness={
            "baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0.5, "roughnessFactor": 0.5,
            "baseColorTexture": look, "metallicRoughnessTexture": look,
        },
        extensions={
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.1},
            "KHR_materials_emissive_strength": {"emissiveStrength": 2}, "KHR_materials_ior": {"ior": 1.4},
            "KHR_materials_specular": {"specularFactor": 0.5},
            "KHR_materials_transmission": {"transmissionFactor": 0.2},
            "KHR_materials_volume": {
                "thicknessFactor": 1.0, "attenuationColor": [0.9, 0.8, 0.7], "attenuationDistance": 2.0,
            },
        },
    )  # fmt: skip
    keys, values = file.accessor(np.array([0, 1], np.float32)), file.accessor(np.eye(4, dtype=np.float32)[:2])
    places, one = file.accessor(np.array([1], np.uint16)), file.accessor(np.array([[1.0, -1, 0]], np.float32))
    views = [file.json["accessors"][number]["bufferView"] for number in (places, one)]
    file.json["accessors"][0]["sparse"] = {
        "count": 1, "indices": {"bufferView": views[0], "componentType": 5123}, "values": {"bufferView": views[1]},
    }  # fmt: skip
    lights = [{"type": "spot", "color": [1, 1, 1], "intensity": 3, "spot": {"innerConeAngle": 0, "outerConeAngle": 1}}]
    file.json |= {
        "scene": 0, "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1.5}},
                                {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1}}],
        "animations": [{"samplers": [{"input": keys, "output": values, "interpolation": "LINEAR"}],
                        "channels": [{"sampler": 0, "target": {"node": 3, "path": "rotation"}}]}],
        "extensions": {"KHR_lights_punctual": {"lights": lights}}, "extensionsUsed": ["KHR_lights_punctual"],
        "extensionsRequired": ["KHR_lights_punctual"],
    }  # fmt: skip
    file.primitive["targets"] = [{"POSITION": 0}]
    file.json["meshes"][0]["weights"] = [0.5]
    file.json["nodes"] += [
        {"mesh": 0, "camera": 0, "weights": [0.2], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1], "children": [4]},
        {"camera": 1, "matrix": np.eye(4).ravel().tolist(), "extensions": {"KHR_lights_punctual": {"light": 0}}},
    ]
    file.json["scenes"][0]["nodes"] += [3]
    return file


def places(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """The paths of all values within a JSON value; of long lists, those of the first."""
    parts = value.items() if isinstance(value, dict) else enumerate(value[:5]) if isinstance(value, list) else ()
    for name, part in parts:
        yield (*path, name)
        yield from places(part, (*path, name))


def changed(json: dict[str, Any], path: tuple[str | int, ...], value: Any) -> dict[str, Any]:
    made = copy.deepcopy(json)
    holder = made
    for name in path[:-1]:
        holder = holder[name]  # type: ignore[index]
    holder[path[-1]] = value  # type: ignore[index]
    return made


@pytest.mark.parametrize("part", [
    "asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers", "materials", "textures",
    "images", "samplers", "cameras", "skins", "animations", "extensions", "extensionsUsed", "extensionsRequired",
])  # fmt: skip
def test_each_value_of_a_file_replaced_gives_a_scene_or_one_line(part: str, tmp_path: Path) -> None:
    file = whole_file(tmp_path)
    good, outcomes = file.json, set()
    assert read_model(file.written()), "the file itself is read"
    for path in [(part,), *((part, *path) for path in places(good[part]))]:
        for value in HOSTILE:
            file.json = changed(good, path, value)
            file.written()
            for read in (read_model, load_scene_file):
                try:
                    read(file.path)
                    outcomes.add("scene")
                except SceneError as error:
                    assert SAID.fullmatch(str(error)), (path, value, str(error))
                    assert len(str(error)) < 500 + len(str(tmp_path))
                    outcomes.add("line")
    assert "line" in outcomes


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("accessors 3 type", "VEC9", "accessors[3].type: expected one of SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3, MAT4, "
         "got 'VEC9'"),
        ("accessors 0 count", [4], "accessors[0].count: expected a whole number of at least 0, got a list of 1"),
        ("accessors 0 count", 1 << 27, "accessors[0]: expected 134217728 elements of 12 bytes at 0, got 48 bytes"),
        ("accessors 1 componentType", 5125, "accessors[1]: expected 6 elements of 4 bytes at 0, got 12 bytes"),
        ("bufferViews 0 byteLength", 99, "bufferViews[0]: expected 99 bytes of buffer 0 at 0, got 48"),
        ("bufferViews 0 byteStride", 4, "accessors[0]: expected 4 elements of 12 bytes every 4 at 0, got 48 bytes"),
        ("buffers 0 uri", "data:;base64,A", "buffers[0].uri: expected data in base64"),
        ("meshes 0 primitives 0 attributes NORMAL", 1, "accessors[1].type: expected VEC3 for NORMAL, got SCALAR"),
        ("meshes 0 primitives 0 indices", 0, "accessors[0].componentType: expected 5121, 5123 or 5125 for indices, "
         "got 5126"),
        ("meshes 0 primitives 0 mode", 9, "meshes[0].primitives[0].mode: expected a whole number from 0 to 6, got 9"),
        ("materials 0 pbrMetallicRoughness", [], "materials[0].pbrMetallicRoughness: expected an object, "
         "got a list of 0"),
        ("materials 0 emissiveFactor", [1, 1], "materials[0].emissiveFactor: expected a list of 3 numbers, "
         "got a list of 2"),
        ("materials 0 alphaMode", {}, "materials[0].alphaMode: expected a string, got an object"),
        ("nodes 4 extensions KHR_lights_punctual light", 7, "nodes[4].extensions.KHR_lights_punctual.light: "
         "expected an index of lights below 1, got 7"),
        ("extensions KHR_lights_punctual lights 0 intensity", "x", "extensions.KHR_lights_punctual.lights[0]."
         "intensity: expected a number, got 'x'"),
        ("textures 0", {}, "textures[0].source: expected an index of images, got none"),
        ("images 0", {}, "images[0]: expected a uri or a bufferView, got none"),
        ("images 0 uri", "data:;base64,AAAA", "images[0]: expected an image, got embedded data that is none"),
        ("nodes 3 rotation", "xyzw", "nodes[3].rotation: expected a list of 4 numbers, got 'xyzw'"),
        ("nodes 4 camera", {}, "nodes[4].camera: expected an index of cameras below 2, got an object"),
        ("nodes 4 matrix 3", float("nan"), "nodes[4].matrix[3]: expected a number from -3.4e+38 to 3.4e+38, got nan"),
        ("cameras 0 perspective yfov", 4, "cameras[0].perspective.yfov: expected an angle in (0, π), got 4"),
        ("animations 0 channels 0 sampler", 1, "animations[0].channels[0].sampler: expected an index of samplers "
         "below 1, got 1"),
        ("scenes", 3, "scenes: expected a list, got 3"),
    ],
)  # fmt: skip
def test_a_fault_is_named_with_its_place(path: str, value: Any, said: str, tmp_path: Path) -> None:
    file = whole_file(tmp_path)
    keys = tuple(int(name) if name.isdigit() else name for name in path.split())
    file.json = changed(file.json, keys, value)
    for read in (read_model, load_scene_file):
        with pytest.raises(SceneError) as caught:
            read(file.written())
        assert str(caught.value) == f"model {file.path}: cannot be read: {said}"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b'{"asset": {"version": "2.0"},\n "nodes": [}', "line 2, column 12: expected JSON (Expecting value)"),
        (b'{"asset": "\xff"}', "byte 11: expected JSON in UTF-8"),
        (b"[" * 100_000, "expected JSON, got too many lists or objects within each other"),
        (b'{"asset": {"version": ' + b"1" * 5000 + b"}}", "expected JSON with numbers of less than 4300 digits"),
        (b"[]", "asset.version: expected glTF 2, got version none"),
        (b'{"asset": {"version": []}}', "asset.version: expected glTF 2, got version a list of 0"),
        (b"glTF" + bytes(4), "expected GLB of version 2"),
    ],
)
def test_what_is_no_json_is_named_with_its_place(content: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "in.gltf"
    path.write_bytes(content)
    with pytest.raises(SceneError) as caught:
        read_model(path)
    assert str(caught.value) == f"model {path}: cannot be read: {said}"


def test_an_animation_without_times_is_named(tmp_path: Path) -> None:
    file = whole_file(tmp_path)
    number = file.json["animations"][0]["samplers"][0]["input"]
    file.json["accessors"][number]["count"] = 0
    with pytest.raises(
        SceneError, match=r"animations\[0\]\.samplers\[0\]\.input: expected at least one time, got none"
    ):
        read_model(file.written())


def test_splines_of_quaternions_through_zero_are_named(tmp_path: Path) -> None:
    """Both keys are opposite, so that the spline is zero in the middle; the motion has a key there."""
    file = whole_file(tmp_path)
    sampler = file.json["animations"][0]["samplers"][0]
    turns = np.zeros((6, 4), np.float32)
    turns[1, 0], turns[4, 0] = 1.0, -1.0
    sampler |= {"interpolation": "CUBICSPLINE", "output": file.accessor(turns)}
    said = r"animations\[0\]\.samplers\[0\]\.output: expected a spline of quaternions other than zero, got one through"
    with pytest.raises(SceneError, match=said):
        read_model(file.written())


def with_odd_parts(file: Gltf) -> None:
    """Adds parts that no picture needs, with values of later versions."""
    json = file.json
    json["accessors"].append({"componentType": 5130, "count": -1, "type": "VEC9"})
    json["animations"].append({"samplers": [{"input": 99, "output": 0, "interpolation": "BEZIER"}], "channels": 3})
    json["animations"][0]["samplers"].append({"input": 0, "output": 0, "interpolation": "BEZIER"})
    json["animations"][0]["channels"].append({"sampler": 1, "target": {"path": "pointer"}})
    json["materials"].append({"alphaMode": "DITHER", "emissiveFactor": "red"})
    json["meshes"].append({"primitives": [{"mode": 9}]})
    json["nodes"].append({"mesh": 1, "rotation": "none"})
    json["cameras"][0]["orthographic"] = {"xmag": "wide"}
    json["extensions"]["KHR_lights_punctual"]["lights"].append({"type": 9})
    for name in ("images", "samplers", "textures", "skins", "buffers", "bufferViews"):
        json[name].append({"odd": True, "source": [], "uri": 5, "joints": {}, "byteLength": "x", "wrapS": "x"})
    json["meshes"][0]["primitives"][0]["attributes"]["_CUSTOM"] = "x"


def test_odd_values_of_parts_that_are_not_used_are_no_fault(tmp_path: Path) -> None:
    file = whole_file(tmp_path)
    before = load_scene_file(file.written())
    with_odd_parts(file)
    report = LossReport()
    after = load_scene_file(file.written(), None, report)
    assert difference(before, after) is None
    assert {"animations after the first (1)", "an animation of pointer"} <= {loss.what for loss in report.losses}


def test_an_unknown_mode_of_opacity_is_a_loss(tmp_path: Path) -> None:
    file = whole_file(tmp_path)
    file.json["materials"][0]["alphaMode"] = "DITHER"
    for read in (read_model, lambda path, report: load_scene_file(path, None, report)):
        report = LossReport()
        read(file.written(), report)
        assert "an opacity of mode 'DITHER'" in [loss.what for loss in report.losses]


def test_whole_numbers_may_have_a_point_and_names_may_be_null(tmp_path: Path) -> None:
    file = whole_file(tmp_path)
    file.json["meshes"][0]["primitives"][0]["mode"] = 4
    before = load_scene_file(file.written())

    def pointed(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: pointed(part) for name, part in value.items()}
        if isinstance(value, list):
            return [pointed(part) for part in value]
        return float(value) if isinstance(value, int) and not isinstance(value, bool) else value

    file.json = pointed(file.json)
    for node in file.json["nodes"]:
        node.setdefault("name", None)
    file.json["meshes"][0] |= {"name": None, "extras": None}
    assert difference(before, load_scene_file(file.written())) is None
