"""Files that are not to be trusted: each makes a scene or one clear line."""

from __future__ import annotations

import gzip
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes.canonical import (
    Mesh,
    SceneError,
)
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.geometry.ply_files import ply_bytes
from scenes.formats.losses import LossReport
from scenes.formats.text.scene_files import SceneFiles
from tests.scenes.formats.files import DATA, DELIVERED, HEAD, MITSUBA, REAL, SENSOR, pbrt


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
        ('NamedMaterial "x"', "expected a material made before, got 'x'"),
        ('Shape "sphere" [' + "1 " * 90 + "]", "expected a parameter such as .float fov., got .1. 1. 1."),
        ('ObjectInstance "x"', "expected an object made before, got 'x'"),
        ('Shape "sphere" "float radius" 0', "radius: expected a positive number, got 0"),
        (
            'Shape "trianglemesh" "integer indices" [0 1 5] "point P" [0 0 0 1 0 0 0 1 0]',
            "expected indices below 3, got 5",
        ),
        ('Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1]', "expected points P and indices"),
        ('Texture "t" "color" "imagemap" "string filename" "none.png"', "expected a file at .*none.png, found none"),
        ('Include "none.pbrt"', "expected a file at .*none.pbrt, found none"),
    ],
)
def test_faults_of_scenes(body: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=message) as error:
        pbrt(tmp_path, body)
    assert "\n" not in str(error.value)


def test_a_loss_is_an_error_where_none_is_wanted_and_nothing_is_left(tmp_path: Path) -> None:
    report = LossReport()
    (tmp_path / "a.pbrt").write_text(HEAD + 'Shape "cone"\n')
    scene = load_scene_file(tmp_path / "a.pbrt", None, report)
    with pytest.raises(SceneError, match="expected a conversion without losses, got .*shape 'cone'"):
        save_scene_file(scene, tmp_path / "out" / "b.pbrt", None, report, strict=True)
    assert list((tmp_path / "out").iterdir()) == []


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


def fuzz(count: int, folder: Path) -> dict[str, int]:
    """How many changed files made a scene, and how many a clear error; anything else is raised."""
    shutil.copytree(DATA if REAL else DELIVERED, folder, dirs_exist_ok=True, copy_function=shutil.copyfile)
    for path in [folder, *folder.rglob("*/")]:
        path.chmod(0o755)
    files = [folder / name for name in (*REAL, *MITSUBA)] or sorted(folder.glob("cornell-box.*[blts]"))
    sources = [(file, file.read_bytes()) for file in files]
    outcome = {"scene": 0, "error": 0}
    for number in range(count):
        rng = np.random.default_rng([7, number])
        file, content = sources[rng.integers(0, len(sources))]
        changed = file.with_name(f"changed{file.suffix}")
        changed.write_bytes(mutated(content, rng))
        try:
            load_scene_file(changed, folder)
            outcome["scene"] += 1
        except SceneError as error:
            assert "\n" not in str(error) and len(str(error)) < 1000
            outcome["error"] += 1
    return outcome


def test_changed_files_make_a_scene_or_a_clear_error(tmp_path: Path) -> None:
    outcome = fuzz(300, tmp_path / "files")
    assert outcome["scene"] > 10 and outcome["error"] > 50


@pytest.mark.slow
def test_many_changed_files(tmp_path: Path) -> None:
    outcome = fuzz(10_000, tmp_path / "files")
    assert outcome["scene"] + outcome["error"] == 10_000


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
