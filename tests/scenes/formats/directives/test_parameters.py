"""No parameter that a reader of directives asks for is lost silently: each is changed in turn.

A change shows in the scene, in the report, or as an error; or the parameter is on the list of those without effect.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.canonical import Scene, SceneError
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file
from scenes.formats.directives.syntax import Parameters
from scenes.formats.losses import LossReport

MAPS = 'Texture "tt" "float" "checkerboard"\nTexture "tt" "{color}" "checkerboard" "{rgb} tex1" [ .9 .1 .2 ]\n'
TEXTURES = ("constant", "scale", "mix", "checkerboard")
POINTS = '"point P" [ 0 0 0 1 0 0 0 1 0 ] "integer indices" [ 0 1 2 ]'
SHAPES = ("sphere", "disk", "cylinder", "cone", "paraboloid", "hyperboloid")


@dataclass(frozen=True)
class Dialect:
    """What a dialect calls its parts; the first material has the colour ``base``."""

    ending: str
    film: str
    integrators: str
    materials: str
    base: str
    color: str = "spectrum"
    rgb: str = "rgb"
    lights: str = "point spot distant infinite"
    area: str = "diffuse"
    samplers: str = "stratified halton"
    textures: str = ""
    mesh: str = "trianglemesh"
    media: str = 'MakeNamedMedium "m" "string type" "homogeneous" {}\nMediumInterface "m" ""\n'


DIALECTS = {
    "pbrt": Dialect(".pbrt", "image", "path bdpt directlighting whitted",
                    "matte mirror glass metal substrate plastic translucent uber mix", "Kd"),
    "pbrt4": Dialect(".pbrt", "rgb", "volpath bdpt mlt",
                     "diffuse coateddiffuse conductor coatedconductor dielectric thindielectric diffusetransmission",
                     "reflectance"),
    "luxrender": Dialect(".lxs", "fleximage", "path bidirectional directlighting exphotonmap igi",
                         "matte mirror glass glass2 roughglass metal metal2 glossy shinymetal mix mattetranslucent",
                         "Kd", "color", "color", "point spot distant infinite sun sky sky2 sunsky", "area",
                         "lowdiscrepancy random metropolis sobol", "blackbody equalenergy colordepth", "mesh",
                         'MakeNamedVolume "m" "clear" {}\nInterior "m"\nMaterial "glass2"\n|'
                         'MakeNamedVolume "m" "homogeneous" {}\nInterior "m"\nMaterial "glass2"\n'),
}  # fmt: skip
HEADS = {"Camera": "perspective orthographic environment", "PixelFilter": "gaussian mitchell box triangle"}
NOTHING = {
    "filename", "mapname", "type",  # names
    "maxanisotropy", "trilinear",  # how a texture is filtered, of one that is no picture
    "diagonal",  # of a film, which lens systems alone ask for
    "thickness",  # between layers that nothing fills
    "environment: screenwindow", "infinite: from", "infinite: to",
    "infinite of a map: from", "hyperboloid: radius",  # what these do not have
    "point: to", "point: efficacy", "spot: efficacy", "distant: efficacy",
    "infinite: gamma",  # without a direction, a power or a picture
    "coatedconductor: interface.eta", "coatedconductor: remaproughness",  # its coat is reported as a whole
    "mesh: triindices", "trianglemesh: triindices", "loopsubdiv: triindices",  # beside indices, with the same meaning
    "loopsubdiv: N",  # its surface has normals of its own
    "translucent: Ks", "translucent: remaproughness",  # its glossy part is reported whenever there is one
}  # fmt: skip
CANDIDATES = (
    '"float {}" 0.37', '"float {}" 3', '"float {}" 40', '"rgb {}" [ .11 .22 .33 ]', '"texture {}" "tt"',
    '"bool {}" "true"', '"bool {}" "false"', '"string {}" "nosuch"', '"string {}" "clamp"',
    '"string {}" "bspline"', '"integer {}" 2', '"string {}" "nearest"', '"string {}" "point"',
    '"point {}" [ .3 .4 .5 ]',
    '"float {}" [ -1 3 -2 2 ]', '"float {}" [ 0 0 1 0 0 1 ]', '"float {}" [ 0 0 1 0 0 1 1 1 ]',
    '"normal {}" [ 0 0 1 0 .6 .8 0 0 1 ]', '"normal {}" [ 0 0 1 0 .6 .8 0 0 1 0 0 1 ]', '"integer {}" [ 0 1 2 0 ]',
    '"point {}" [ 0 0 0 2 0 0 0 1 0 ]', '"point {}" [ 0 0 0 2 0 0 0 1 0 3 1 0 ]', '"integer {}" [ 0 2 1 ]',
)  # fmt: skip


def texts(dialect: str) -> Iterator[str]:
    """Scenes of one directive each, which ends in the place of another parameter."""
    found = DIALECTS[dialect]
    film, world = f'Film "{found.film}"', "WorldBegin\n" + MAPS.format(color=found.color, rgb=found.rgb)
    bare = f"{film}\n{world}"
    for name, kinds in {**HEADS, "Sampler": found.samplers, "Integrator": found.integrators}.items():
        yield from (f'{film}\n{name} "{kind}" {{}}\n{world}' for kind in kinds.split())
    yield f"{film} {{}}\n{world}"
    yield from (f'{bare}LightSource "{kind}" {{}}\n' for kind in found.lights.split())
    yield f'{bare}LightSource "infinite" "string mapname" "a.png" {{}}\n'
    yield f'{bare}AreaLightSource "{found.area}" {{}}\nShape "sphere"\n'
    materials = found.materials.split()
    yield from (f'{bare}Material "{kind}" "float roughness" .2 {{}}\nShape "sphere"\n' for kind in materials)
    yield from (f'{bare}Shape "{kind}" {{}}\n' for kind in SHAPES)
    yield from (f'{bare}Shape "{mesh}" {POINTS} {{}}\n' for mesh in (found.mesh, "loopsubdiv"))
    yield from (
        f'{bare}{{}}Integrator "volpath"\n'.replace("{}", f'{one}Shape "sphere"\n') for one in found.media.split("|")
    )
    if dialect != "luxrender":
        yield f'{bare}Shape "curve" "point P" [ 0 0 0 1 1 0 2 0 0 3 1 0 4 0 0 5 1 0 6 0 1 ] {{}}\n'
    if dialect == "pbrt4":
        yield f'{bare}Shape "bilinearmesh" {POINTS.replace("0 1 0 ]", "0 1 0 1 1 0 ]").replace("2 ]", "2 3 ]")} {{}}\n'
    use = f'Material "{materials[0]}" "texture {found.base}" "t"\nShape "sphere"\n'
    yield f'{bare}Texture "t" "{found.color}" "imagemap" "string filename" "a.png" {{}}\n{use}'
    for kind in (*TEXTURES, *found.textures.split()):
        yield f'{bare}Texture "t" "{found.color}" "{kind}" {{}}\n{use}'


def made(text: str, file: Path) -> tuple[Scene, list[str]] | None:
    """The scene and what it lost, None for a file that cannot be read."""
    file.write_text(text)
    report = LossReport()
    try:
        return load_scene_file(file, None, report), [str(loss) for loss in report.losses]
    except SceneError:
        return None


def silent(dialect: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Directives and parameters whose change has no effect."""
    names: set[str] = set()
    for method in ("numbers", "text", "__contains__"):
        real = getattr(Parameters, method)

        def asked(self: Parameters, name: str, *rest: object, real=real) -> object:
            names.add(name)
            return real(self, name, *rest)

        monkeypatch.setattr(Parameters, method, asked)
    file, found = folder / f"a{DIALECTS[dialect].ending}", []
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (4, 4, 3), np.uint8)).save(folder / "a.png")
    candidates = [one.replace("rgb {}", f"{DIALECTS[dialect].rgb} {{}}") for one in CANDIDATES]
    for text in texts(dialect):
        names.clear()
        before = made(text.replace("{}", ""), file)
        assert before is not None, text
        line = next(line for line in text.splitlines() if "{}" in line)
        kind = line.split('"')[5 if line.startswith("Texture") else 1] + (" of a map" if "mapname" in line else "")
        for name in sorted(name for name in names - {""} if not {name, f"{kind}: {name}"} & NOTHING):
            if f'"float {name}" ' not in text and not any(
                shows(before, made(text.replace("{}", one.format(name)), file)) for one in candidates
            ):
                found.append(f"{kind}: {name}")
    return found


def shows(before: tuple[Scene, list[str]], after: tuple[Scene, list[str]] | None) -> bool:
    """Whether a file that can be read made another scene or report."""
    return after is not None and (before[1] != after[1] or difference(before[0], after[0]) is not None)


@pytest.mark.parametrize("dialect", [pytest.param("pbrt", marks=pytest.mark.slow), "pbrt4", "luxrender"])
def test_no_parameter_is_lost_in_silence(dialect: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert silent(dialect, tmp_path, monkeypatch) == []
