"""Files that are changed at random or made up: each makes a scene or one clear line."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.command.progress import Task
from analysis.conversion import mutations
from analysis.conversion.mutations import Mutations, outcome_of, sources_in, summed
from scenes.canonical import SceneError
from scenes.formats.conversion import load_scene_file, save_scene_file
from tests.scenes.formats.files import DATA, DELIVERED, HEAD, MITSUBA, REAL, SENSOR


def changed(count: int, folder: Path) -> dict[str, float]:
    """What changed files came to; those beside this project are changed where they are, else the delivered ones."""
    pytest.importorskip("pxr")
    names = [f"{DATA}/{name}" for name in (*REAL, *MITSUBA)]
    delivered = [DELIVERED / f"cornell-box{ending}" for ending in (".pbrt", ".lxs", ".xml")]
    sources = sources_in(folder, tuple(map(Path, names)) or tuple(delivered), DATA if names else DELIVERED)
    return summed(Mutations(sources, folder, folder / "mutations.journal", 7).rows(count, Task()))


def test_changed_files_make_a_scene_or_a_clear_error(tmp_path: Path) -> None:
    found = changed(300, tmp_path)
    assert found["traceback"] == 0 and found["scene"] > 10 and found["line"] > 50
    assert found["scene"] + found["line"] == found["files"] == 300


@pytest.mark.slow
def test_many_changed_files(tmp_path: Path) -> None:
    found = changed(20_000, tmp_path)
    assert found["scene"] + found["line"] == found["files"] == 20_000


def test_tracebacks_hangs_and_memory_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter([("line", "a", "f", 0.1, 9.0), ("traceback", "b", "f", 0.2, 9.0), ("scene", "", "f", 9.0, 9.0),
                    None, ("scene", "", "f", 0.1, 5000.0)])  # fmt: skip
    monkeypatch.setattr(mutations, "_Reader", lambda *given: SimpleNamespace(answer=lambda n: next(answers),
                                                                             end=lambda: None))  # fmt: skip
    rows = Mutations([], tmp_path, tmp_path / "a.journal").rows(5, Task())
    found = summed(rows)
    assert (found["line"], found["traceback"], found["scene"], found["slow"], found["large"]) == (1, 1, 2, 2, 1)
    assert [fault.split(":")[0] for fault in rows[0]["faults"]] == ["1, f", "2, f", "3", "4, f"]
    again = Mutations([], tmp_path, tmp_path / "a.journal").rows(5, Task())
    assert again == rows  # from the journal: there are no more answers
    monkeypatch.setattr(mutations, "code_hash", lambda *makers: "of other code")
    with pytest.raises(StopIteration):
        Mutations([], tmp_path, tmp_path / "a.journal").rows(5, Task())


def test_other_errors_than_lines_are_tracebacks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*given: object) -> None:
        raise KeyError("x")

    (tmp_path / "a.pbrt").write_text("Nonsense")
    assert outcome_of(tmp_path / "a.pbrt", tmp_path) == ("line", "a.pbrt:1:1: expected a directive, got 'Nonsense'")
    monkeypatch.setattr("scenes.formats.conversion.load_scene_file", broken)
    assert outcome_of(tmp_path / "a.pbrt", tmp_path) == ("traceback", "KeyError: 'x'")


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
