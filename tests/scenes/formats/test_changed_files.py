"""Files that are changed at random or made up: each makes a scene or one clear line."""

from __future__ import annotations

import json
import resource
import shutil
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes.canonical import (
    SceneError,
)
from scenes.formats.conversion import load_scene_file, save_scene_file
from tests.scenes.formats.files import DATA, DELIVERED, HEAD, MITSUBA, REAL, SENSOR


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """A real file with some of it changed, cut, doubled or swapped."""
    found = bytearray(content)
    for _ in range(rng.integers(1, 4)):
        at, size = int(rng.integers(0, len(found) + 1)), int(rng.integers(1, 40))
        what = rng.integers(0, 5)
        if what == 0:
            found[at : at + size] = b""
        elif what == 1:
            found[at:at] = found[at : at + size]
        elif what == 2:
            found[at : at + 1] = bytes([int(rng.integers(0, 256))])
        elif what == 3:
            words = [b" nan ", b" 1e308 ", b" -1 ", b' "', b" [ ", b" ] ", b" 0 ", b"AttributeBegin ", b"AttributeEnd "]
            found[at:at] = words[rng.integers(0, len(words))]
        else:
            found[at:] = found[at:][: int(rng.integers(0, max(1, len(found) - at)))]
    return bytes(found)


def newer(files: list[Path]) -> list[Path]:
    """The same scenes in the newest formats, beside the files."""
    made = []
    for file in files:
        scene = load_scene_file(file, file.parents[1])
        for to, ending in (("pbrt4", "-4.pbrt"), ("mitsuba3", "-3.xml")):
            made.append(file.with_name(f"newer-{file.stem}{ending}"))
            save_scene_file(scene, made[-1], to)
    tree = {"type": "scene", "sensor": {"type": "perspective"}, "ball": {"type": "sphere", "radius": 2.0}}
    tree["floor"] = {"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}}
    made.append(files[0].with_name("newer.json"))
    made[-1].write_text(json.dumps(tree))
    return made


def fuzz(count: int, folder: Path) -> dict[str, int]:
    """How many changed files made a scene, and how many a clear error; anything else is raised.

    It prints the longest that a file took, and the most memory that the process had.
    """
    shutil.copytree(DATA if REAL else DELIVERED, folder, dirs_exist_ok=True, copy_function=shutil.copyfile)
    for path in [folder, *folder.rglob("*/")]:
        path.chmod(0o755)
    files = [folder / name for name in (*REAL, *MITSUBA)] or sorted(folder.glob("cornell-box.*[blts]"))
    sources = [(file, file.read_bytes()) for file in (*files, *newer(files))]
    longest_s, slowest = 0.0, ""
    outcome = {"scene": 0, "error": 0}
    for number in range(count):
        rng = np.random.default_rng([7, number])
        file, content = sources[rng.integers(0, len(sources))]
        changed = file.with_name(f"changed{file.suffix}")
        changed.write_bytes(mutated(content, rng))
        begun_s = time.perf_counter()
        try:
            load_scene_file(changed, folder)
            outcome["scene"] += 1
        except SceneError as error:
            assert "\n" not in str(error) and len(str(error)) < 1000
            outcome["error"] += 1
        if time.perf_counter() - begun_s > longest_s:
            longest_s, slowest = time.perf_counter() - begun_s, f"{file.name}, change {number}"
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{count} files: {outcome}; longest {longest_s:.2f} s ({slowest}), at most {peak_mb:.0f} MB")
    return outcome


def test_changed_files_make_a_scene_or_a_clear_error(tmp_path: Path) -> None:
    outcome = fuzz(300, tmp_path / "files")
    assert outcome["scene"] > 10 and outcome["error"] > 50


@pytest.mark.slow
def test_many_changed_files(tmp_path: Path) -> None:
    outcome = fuzz(20_000, tmp_path / "files")
    assert outcome["scene"] + outcome["error"] == 20_000


WORDS = (
    "LookAt Camera Film Sampler Integrator SurfaceIntegrator WorldBegin WorldEnd AttributeBegin AttributeEnd "
    "TransformBegin TransformEnd ObjectBegin ObjectEnd ObjectInstance Identity Translate Scale Rotate Transform "
    "ConcatTransform CoordinateSystem CoordSysTransform ActiveTransform StartTime EndTime All TransformTimes "
    "MotionBegin MotionEnd ReverseOrientation Material MakeNamedMaterial NamedMaterial Texture Shape LightSource "
    "AreaLightSource Include MakeNamedMedium MediumInterface PixelFilter true false"
).split()
NAMES = (
    "perspective|orthographic|sphere|disk|trianglemesh|plymesh|matte|metal|mix|glass|infinite|distant|spot|imagemap|"
    "checkerboard|color|float|a|camera|string type|float radius|integer indices|point P|normal N|float uv|rgb Kd|"
    "texture Kd|rgb L|spectrum eta|blackbody L|string filename|string namedmaterial1|float screenwindow|float fov|"
    "point from|float sigma|../x|"
).split("|")
tokens = st.one_of(
    st.sampled_from(WORDS),
    st.sampled_from(NAMES).map(lambda name: f'"{name}"'),
    st.sampled_from(["0", "1", "-1", "2.5", "1e30", "1e308", "nan", "-0", "90"]),
    st.lists(st.integers(-2, 9), max_size=16).map(lambda values: f"[{' '.join(map(str, values))}]"),
    st.sampled_from(NAMES).map(lambda name: f'["{name}"]'),
    st.sampled_from(["[", "]", '"', "#", "\n", "}", "\u00e9"]),
)


@settings(max_examples=300, deadline=None)
@given(words=st.lists(tokens, max_size=40), ending=st.sampled_from([".pbrt", ".lxs"]), head=st.booleans())
def test_made_up_directives_make_a_scene_or_a_clear_error(words: list[str], ending: str, head: bool) -> None:
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"a{ending}"
        file.write_text((HEAD if head else "") + " ".join(words), encoding="utf-8")
        opened(file)


TAGS = (
    "scene shape bsdf emitter sensor film sampler integrator texture transform ref include default float integer "
    "string boolean rgb srgb spectrum blackbody point vector translate scale rotate matrix lookat animation medium "
    "alias xyz rfilter"
).split()
VALUES = (
    "sphere|rectangle|cube|ply|shapegroup|instance|perspective|thinlens|diffuse|twosided|mask|blendbsdf|area|envmap|"
    "sunsky|bitmap|toWorld|reflectance|radiance|fov|radius|a|$a|1|0|-1|1e308|nan|1, 2, 3|#ffffff|true|400:1 700:2|"
    "../x|smaller|"
).split("|")
KEYS = "type name value id x y z origin target up angle filename version time as".split()
attributes = st.dictionaries(st.sampled_from(KEYS), st.sampled_from(VALUES), max_size=4)
elements = st.recursive(
    st.tuples(st.sampled_from(TAGS), attributes, st.just([])),
    lambda inner: st.tuples(st.sampled_from(TAGS), attributes, st.lists(inner, max_size=4)),
    max_leaves=20,
)


def written(element) -> str:
    tag, given, inside = element
    pairs = "".join(f' {key}="{value}"' for key, value in given.items())
    return f"<{tag}{pairs}>{''.join(map(written, inside))}</{tag}>"


@settings(max_examples=300, deadline=None)
@given(found=st.lists(elements, max_size=6), sensor=st.booleans())
def test_made_up_elements_make_a_scene_or_a_clear_error(found: list, sensor: bool) -> None:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "a.xml"
        body = "".join(map(written, found))
        file.write_text(f'<scene version="0.5.0">{SENSOR if sensor else ""}{body}</scene>')
        opened(file)


def opened(file: Path) -> None:
    """Reads a file; what it makes can be written, and a fault is one line."""
    try:
        scene = load_scene_file(file)
    except SceneError as error:
        assert "\n" not in str(error) and len(str(error)) < 1000
        return
    save_scene_file(scene, file.with_name("again.pbrt"))
