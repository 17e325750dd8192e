"""Shared parts are visited once, depth is bounded, and losses are of two classes."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenes.canonical import ConstantTexture, MixMaterial, SceneError, Texture
from scenes.formats.appearance.folding import folded, greatest_of, mean_of, product_of
from scenes.formats.appearance.graphs import once_a_node, parts_of
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.drawable import drawable
from scenes.formats.geometry.meshed import depends_on_uv
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import HEAD, mitsuba, pbrt

LEVELS = 40  # 2^40 parts, were shared ones counted anew


def doubled(kind: str) -> str:
    """Textures that each name the one before it twice."""
    lines = ['Texture "t0" "color" "checkerboard" "rgb tex1" [0.9 0.9 0.9] "rgb tex2" [0.8 0.8 0.8]']
    lines += [
        f'Texture "t{n}" "color" "{kind}" "texture tex1" "t{n - 1}" "texture tex2" "t{n - 1}"' for n in range(1, LEVELS)
    ]
    return "\n".join([*lines, f'Material "matte" "texture Kd" "t{LEVELS - 1}"', 'Shape "sphere"'])


@pytest.mark.parametrize("kind", ["scale", "mix", "checkerboard"])
def test_textures_that_name_each_other_twice_a_level(kind: str, tmp_path: Path) -> None:
    scene, _ = pbrt(tmp_path, doubled(kind))
    texture = scene.instances[0].material.reflectance  # type: ignore[union-attr]
    seen: list[Texture] = []
    once_a_node(lambda node, again: (seen.append(node), [again(part) for part in parts_of(node)]), texture)
    assert len(seen) <= 3 * LEVELS
    assert 0.0 <= mean_of(texture)[0] <= greatest_of(texture) <= 1.0 and depends_on_uv(scene.instances[0].material)
    folded(product_of(texture, ConstantTexture((0.5, 0.5, 0.5))))
    drawable(scene, LossReport())
    for ending in (".pbrt", ".lxs", ".xml"):
        save_scene_file(scene, tmp_path / f"b{ending}")
        again = load_scene_file(tmp_path / f"b{ending}")
        if ending == ".pbrt":
            assert difference(scene.instances, again.instances) is None


def test_materials_that_name_each_other_twice_a_level(tmp_path: Path) -> None:
    lines = ['MakeNamedMaterial "m0" "string type" "mirror"']
    lines += [
        f'MakeNamedMaterial "m{n}" "string type" "mix" "string namedmaterial1" "m{n - 1}" '
        f'"string namedmaterial2" "m{n - 1}"'
        for n in range(1, 31)
    ]
    scene, _ = pbrt(tmp_path, "\n".join([*lines, 'NamedMaterial "m30"', 'Shape "sphere"']))
    for ending in (".pbrt", ".lxs", ".xml"):
        save_scene_file(scene, tmp_path / f"b{ending}")
        assert (tmp_path / f"b{ending}").stat().st_size < 50_000
        found = load_scene_file(tmp_path / f"b{ending}").instances[0].material
        assert isinstance(found, MixMaterial)


@pytest.mark.parametrize(
    "body",
    [
        "\n".join(
            [
                'Texture "t" "color" "checkerboard"',
                *['Texture "t" "color" "scale" "texture tex1" "t" "texture tex2" "t"'] * 400,
            ]
        ),
        "\n".join(
            ['MakeNamedMaterial "m" "string type" "mirror"']
            + ['MakeNamedMaterial "m" "string type" "mix" "string namedmaterial1" "m" "string namedmaterial2" "m"']
            * 400
        ),
    ],
    ids=["textures", "materials"],
)
def test_400_inside_each_other_are_one_clear_line(body: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"a\.pbrt:\d+:1: expected at most 64 textures or materials inside each other"):
        pbrt(tmp_path, body)


def test_textures_of_mitsuba_that_refer_to_themselves_are_one_clear_line(tmp_path: Path) -> None:
    body = '<texture type="scale" id="t"><ref id="t"/></texture>'
    with pytest.raises(SceneError, match="expected at most 64 textures inside each other"):
        mitsuba(tmp_path, body)


def test_groups_inside_groups_do_not_multiply(tmp_path: Path) -> None:
    groups = ['<shape type="shapegroup" id="g0"><shape type="sphere"/></shape>']
    groups += [
        f'<shape type="shapegroup" id="g{n}">' + f'<shape type="instance"><ref id="g{n - 1}"/></shape>' * 2 + "</shape>"
        for n in range(1, 30)
    ]
    scene, lost = mitsuba(tmp_path, "".join(groups) + '<shape type="instance"><ref id="g29"/></shape>')
    assert scene.instances == ()
    assert sum("instance inside a shapegroup" in loss for loss in lost) == 58


def test_overflowing_transforms_are_one_clear_line(tmp_path: Path) -> None:
    body = "Scale 1e30 1e30 1e30\n" * 12 + 'Shape "sphere"\n'
    with pytest.raises(SceneError) as error:
        pbrt(tmp_path, body)
    assert "\n" not in str(error.value)


def test_hints_are_no_reason_to_refuse(tmp_path: Path) -> None:
    """A sampler and the samples of a light do not change the picture; a shape that is left out does."""
    head = (
        'Sampler "stratified"\nIntegrator "path" "float rrthreshold" 2\n'
        + HEAD
        + 'LightSource "infinite" "integer nsamples" 4\n'
    )
    shape = 'Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 0]'
    (tmp_path / "a.pbrt").write_text(f'{head}Material "matte"\n{shape}\n')
    report = LossReport()
    scene = load_scene_file(tmp_path / "a.pbrt", None, report)
    save_scene_file(scene, tmp_path / "b.lxs", None, report, strict=True)
    assert [loss.picture for loss in report.losses] == [False] * 3 and len(report.lines()) == 4
    report.add("a", "b")
    report.add("c", "b")
    assert report.lines()[:2] == ["changes the picture:", "  a (and 1 more): b: left out"]
    assert [row["picture"] for row in report.rows()] == [False, False, False, True, True]
    with pytest.raises(SceneError, match=r"got a: b: left out \(and 1 more\)"):
        report.refuse_any()


def test_which_side_of_a_shared_mixture_is_black_is_asked_once_a_part(tmp_path: Path) -> None:
    """30 levels of mixtures, each of which names the one before twice."""
    levels = "".join(f'<bsdf type="blendbsdf" id="m{n + 1}"><ref id="m{n}"/><ref id="m{n}"/></bsdf>' for n in range(30))
    shape = '<shape type="sphere"><ref id="m30"/></shape>'
    text = f'<scene version="0.5.0"><bsdf type="diffuse" id="m0"/>{levels}{shape}</scene>'
    (tmp_path / "a.xml").write_text(text)
    assert load_scene_file(tmp_path / "a.xml").instances[0].one_sided


def test_blank_lines_and_long_strings_before_the_world(tmp_path: Path) -> None:
    """Looking for the version, and reading a string, are linear in the text."""
    head = " \n" * 200_000 + f'Film "image" "string filename" "{"a" * 500_000}"\n'
    (tmp_path / "a.pbrt").write_text(head + HEAD)
    assert len(load_scene_file(tmp_path / "a.pbrt").film.filename) == 500_000


def test_parameters_that_name_parameters(tmp_path: Path) -> None:
    """The longest name counts; what stands in its place may name others; many of them cost no more each."""
    names = "".join(f'<default name="a{n}" value="{n}"/>' for n in range(5000))
    names += '<default name="far" value="$near"/><default name="near" value="$a4999"/>'
    (tmp_path / "a.xml").write_text(
        f'<scene version="0.5.0">{names}<shape type="sphere"><float name="radius" value="$far"/></shape>'
        '<shape type="sphere"><float name="radius" value="$a12"/></shape></scene>'
    )
    radii = [one.shape.radius for one in load_scene_file(tmp_path / "a.xml").instances]  # type: ignore[union-attr]
    assert radii == [4999.0, 12.0]
