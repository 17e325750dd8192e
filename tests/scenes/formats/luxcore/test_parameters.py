"""No property that the reader of LuxCore's files knows is lost silently: each is changed in turn, in every part.

A change shows in the scene, in the report, or as an error; or the property is on the list of those without effect.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from scenes.formats.directives.syntax import Parameters
from scenes.formats.luxcore import read
from scenes.formats.luxcore.defaults import _DEFAULTS  # pyright: ignore[reportPrivateUsage]
from scenes.formats.luxcore.directives import NAMES
from scenes.formats.luxcore.lights import _NAMES  # pyright: ignore[reportPrivateUsage]
from scenes.formats.luxcore.materials import _VOLUME  # pyright: ignore[reportPrivateUsage]
from scenes.formats.luxcore.read import _SHAPES, LuxCoreReader  # pyright: ignore[reportPrivateUsage]
from tests.scenes.formats.directives.test_parameters import made, shows
from tests.scenes.formats.luxcore.test_read import CAMERA

KNOWN = CAMERA + (
    "scene.textures.tt.type = checkerboard2d\nscene.textures.tt.texture1 = .9 .1 .2\n"
    "scene.textures.gg.type = fresnelpreset\nscene.textures.gg.name = gold\n"
    "scene.volumes.vv.type = homogeneous\nscene.volumes.vv.absorption = 1 2 3\nscene.volumes.vv.ior = 1.2\n"
    "scene.materials.aa.type = mirror\nscene.materials.bb.type = matte\nscene.materials.cc.type = null\n"
    "scene.shapes.ss.type = mesh\nscene.shapes.ss.ply = a.ply\n"
)
KINDS = {
    "cameras": "perspective orthographic environment",
    "textures": "imagemap constfloat1 constfloat3 scale mix checkerboard2d checkerboard3d blackbody",
    "indices": "fresnelpreset fresnelcolor fresnelconst",
    "materials": "matte roughmatte mirror glass archglass roughglass metal2 glossy2 mattetranslucent "
                 "roughmattetranslucent mix null disney twosided",
    "volumes": "clear homogeneous",
    "objects": "inlinedmesh",
    "shapes": "mesh inlinedmesh",
    "lights": "point spot distant sharpdistant infinite constantinfinite sun sky2",
}  # fmt: skip
METHODS = {"cameras": "_camera", "textures": "_texture_block", "indices": "_texture_block", "shapes": "_object_block",
           "volumes": "_volume_block", "materials": "_material_block", "objects": "_object_block",
           "lights": "_light_block"}  # fmt: skip
REPORTED = {
    "cameras": "stereo", "textures": "add fbm", "indices": "fresnelsopra fresnelcauchy fresnelabbe",
    "volumes": "heterogeneous",
    "materials": "glossycoating carpaint velvet cloth glossytranslucent", "lights": "projection sphere laser",
}  # fmt: skip
"""Kinds that are reported as a whole."""

NEEDED = {
    "imagemap": ("file = a.png",), "blackbody": ("temperature = 3000",), "fresnelpreset": ("name = Cu",),
    "mix": ("material1 = aa", "material2 = bb"), "twosided": ("frontmaterial = bb",), "glossycoating": ("base = bb",),
    "mesh": ("ply = a.ply",), "inlinedmesh": ("vertices = 0 0 0 1 0 0 0 1 0", "faces = 0 1 2"),
    "homogeneous": ("scattering = 1",), "metal2": ("fresnel = gg",),
    "infinite": ("file = a.png",), "distant": ("direction = 0 1 -1",),
    "sharpdistant": ("direction = 0 1 -1",), "sun": ("dir = 0 1 1",), "orthographic": ("lensradius = 0",),
}  # fmt: skip
LAMP = "emission = 1 0.5 1", "emission.power = 50", "emission.efficency = 17"
NOTHING = {
    "perspective: halffov", "point: efficacy", "spot: efficacy", "distant: efficacy", "sharpdistant: efficacy",
    "inlinedmesh: quadindices",  # of LuxRender
    "lamp: emission.efficiency", "point: efficiency", "spot: efficiency",  # beside the other spelling
    "matte: sigma", "lamp: sigma",  # which roughmatte alone has
    "orthographic: fieldofview", "environment: fieldofview", "environment: screenwindow",
    "point: target", "constantinfinite: gamma", "constantinfinite: transformation",
    "clear: multiscattering",  # of what does not scatter
    "PATHCPU: light.maxdepth", "BIDIRCPU: path.pathdepth.total", "BIDIRCPU: path.pathdepth.diffuse",
    "BIDIRCPU: path.pathdepth.glossy", "BIDIRCPU: path.pathdepth.specular",  # of the other engines
}  # fmt: skip
"""What LuxCore itself ignores, or needs no second time."""

CANDIDATES = (
    "0.37", "3", "40", "0", "1", ".11 .22 .33", "tt", "vv", "aa", "cc", "gg", "ss", "2 -3", "nosuch", "clamp",
    "nearest", "white", "nop", "-1 3 -2 2", "0 1 0 0 0 0 2 0 1 0 0 0 3 4 5 1", "0 0 0 2 0 0 0 1 0", "0 2 1",
    "0 0 1 0 .6 .8 0 0 1", "0 0 1 0 0 1", "b.png", "Cu", "SOBOL", "PATHCPU", "BIDIRCPU", "BOX", "true",
)  # fmt: skip


class Watched(dict[str, Any]):
    """A block of properties that notes which are asked for."""

    def __init__(self, given: dict[str, Any], asked: set[str]) -> None:
        super().__init__(given)
        self.asked = asked

    def pop(self, key: str, *default: Any) -> Any:
        self.asked.add(key)
        return super().pop(key, *default)

    def get(self, key: str, default: Any = None) -> Any:
        self.asked.add(key)
        return super().get(key, default)

    def __contains__(self, key: object) -> bool:
        self.asked.add(str(key))
        return super().__contains__(key)


def files(folder: Path) -> None:
    """Pictures and a mesh."""
    for seed, name in enumerate(("a.png", "b.png")):
        Image.fromarray(np.random.default_rng(seed).integers(0, 256, (4, 4, 3), np.uint8)).save(folder / name)
    (folder / "a.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )


def texts(kinds_of: dict[str, str]) -> Iterator[tuple[str, str, str, str]]:
    """Parts, their kinds, the beginnings of their keys, and scenes in which they count."""
    square = "scene.objects.o.ply = a.ply\nscene.objects.o.material = "
    glass = f"scene.materials.m.type = glass\nscene.materials.m.volume.interior = n\n{square}m\n"
    uses = {"textures": f"scene.materials.m.kd = n\n{square}m\n",
            "indices": f"scene.materials.m.type = metal2\nscene.materials.m.fresnel = n\n{square}m\n",
            "materials": f"{square}n\n", "volumes": glass, "objects": "scene.objects.n.material = bb\n",
            "shapes": "scene.objects.o.shape = n\nscene.objects.o.material = bb\n"}  # fmt: skip
    for part, kinds in kinds_of.items():
        start = "scene.camera." if part == "cameras" else f"scene.{part.replace('indices', 'textures')}.n."
        for kind in kinds.split():
            lines = (*([] if part == "objects" else [f"type = {kind}"]), *NEEDED.get(kind, ()))
            lines = lines[: 1 if part == "textures" and kind == "mix" else None]
            text = "".join(f"{start}{line}\n" for line in lines) + uses.get(part, "")
            yield part, kind, start, text
            if kind in ("point", "spot"):
                yield part, kind, start, f"{text}{start}power = 50\n{start}efficency = 17\n{start}color = 1 .5 1\n"
    yield (
        "materials",
        "lamp",
        "scene.materials.n.",
        uses["materials"] + "".join(f"scene.materials.n.{line}\n" for line in LAMP),
    )


def watch(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], set[str]]:
    """A function that makes the reader note the properties of a part that it asks for; it returns their names."""
    names, looking = set[str](), ["", False]
    tables = NAMES, _NAMES, _VOLUME, _SHAPES
    of_luxcore = {ours: theirs for table in tables for theirs, ours in table.items()}
    for method in ("numbers", "text", "__contains__"):
        real = getattr(Parameters, method)

        def asked(self: Parameters, name: str, *rest: object, real=real) -> object:
            names.update({of_luxcore.get(name, name)} if looking[1] else ())
            return real(self, name, *rest)

        monkeypatch.setattr(Parameters, method, asked)
    for method in set(METHODS.values()):
        real = getattr(LuxCoreReader, method)

        def watched(self: object, *given: Any, real=real, method=method) -> None:
            looking[1] = METHODS.get(str(looking[0])) == method and (given[0] in ("n", "o") or method == "_camera")
            real(self, *(Watched(one, names) if looking[1] and isinstance(one, dict) else one for one in given))
            looking[1] = False

        monkeypatch.setattr(LuxCoreReader, method, watched)
    real_settings = read.settings

    def settings(found: dict[str, Any], *rest: Any) -> Iterator[Any]:
        seen = Watched(found, names if looking[0] == "settings" else set())
        yield from real_settings(seen, *rest)
        found.clear()
        found.update(seen)

    monkeypatch.setattr(read, "settings", settings)

    def at(part: str) -> set[str]:
        names.clear()
        looking[0] = part
        return names

    return at


def silent(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Kinds of parts, and properties of them whose change has no effect."""
    files(folder)
    watched, file, met = watch(monkeypatch), folder / "a.scn", {"", "scene.shapes.n."}
    engines = [("settings", one, "", f"renderengine.type = {one}\n") for one in ("PATHCPU", "BIDIRCPU")]
    known, found = set[str](), set[str]()
    for part, kind, start, text in [*texts(KINDS), *engines]:
        names = watched(part)
        before = made(KNOWN + text, file)
        assert before is not None, text
        parts = set(names) | (set() if start in met else set(_DEFAULTS))
        parts |= {"appliedtransformation"} if part == "shapes" else set()
        watched("")
        met.add(start)
        for name in sorted(parts):
            key, label = f"{start}{name}", f"{kind}: {name}"
            alone = name.startswith("emission.") and f"{start}emission = " not in text
            if label in NOTHING or alone or name == "type":
                continue
            shown = any(shows(before, made(f"{KNOWN}{text}{key} = {one}\n", file)) for one in CANDIDATES)
            (known if shown else found).add(label)
    return sorted(found - known)


def test_no_property_is_lost_in_silence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert silent(tmp_path, monkeypatch) == []


@pytest.mark.parametrize("part", REPORTED)
def test_kinds_without_a_counterpart_are_reported(part: str, tmp_path: Path) -> None:
    files(tmp_path)
    for _, kind, _, text in texts({part: REPORTED[part]}):
        if kind == "lamp":
            continue
        found = made(KNOWN + text, tmp_path / "a.scn")
        assert found is not None and any(kind in loss for loss in found[1]), kind
