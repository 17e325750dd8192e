"""No parameter that a reader of directives asks for is lost silently: each is changed in turn.

A change shows in the scene, in the report, or as an error; or the parameter is on the list of those without effect.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from scenes.canonical import Scene, SceneError
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file
from scenes.formats.directives.syntax import Parameters
from scenes.formats.losses import LossReport

MAPS = 'Texture "tt" "float" "checkerboard"\nTexture "tt" "{color}" "checkerboard" "rgb tex1" [ .9 .1 .2 ]\n'
HEADS = {"Camera": ("perspective", "orthographic", "environment"), "Sampler": ("stratified", "halton"),
         "PixelFilter": ("gaussian", "mitchell", "box", "triangle")}  # fmt: skip
TEXTURES = ("constant", "scale", "mix", "checkerboard")
SHAPES = ("sphere", "disk", "cylinder", "cone", "paraboloid", "hyperboloid")
LIGHTS = ("point", "spot", "distant", "infinite")
DIALECTS = {
    "pbrt": (".pbrt", 'Film "image"', "spectrum", "path bdpt directlighting whitted",
             "matte mirror glass metal substrate plastic translucent uber mix", "Kd"),
    "pbrt4": (".pbrt", 'Film "rgb"', "spectrum", "volpath bdpt mlt",
              "diffuse coateddiffuse conductor coatedconductor dielectric thindielectric diffusetransmission",
              "reflectance"),
}  # fmt: skip
NOTHING = {
    "filename", "type",  # names
    "maxanisotropy", "trilinear",  # how a texture is filtered, of one that is no picture
    "diagonal",  # of a film, which lens systems alone ask for
    "thickness",  # between layers that nothing fills
    "environment: screenwindow", "infinite: from", "infinite: to", "hyperboloid: radius",  # what these do not have
    "coatedconductor: interface.eta", "coatedconductor: remaproughness",  # its coat is reported as a whole
    "translucent: Ks", "translucent: remaproughness",  # its glossy part is reported whenever there is one
}  # fmt: skip
CANDIDATES = (
    '"float {}" 0.37', '"float {}" 3', '"float {}" 40', '"rgb {}" [ .11 .22 .33 ]', '"texture {}" "tt"',
    '"bool {}" "true"', '"bool {}" "false"', '"string {}" "nosuch"', '"point {}" [ .3 .4 .5 ]',
    '"float {}" [ -1 3 -2 2 ]',
)  # fmt: skip


def texts(dialect: str) -> Iterator[str]:
    """Scenes of one directive each, which ends in the place of another parameter."""
    _, film, color, integrators, materials, base = DIALECTS[dialect]
    world = "WorldBegin\n" + MAPS.format(color=color)
    bare = f"{film}\n{world}"
    for name, kinds in {**HEADS, "Integrator": integrators.split()}.items():
        yield from (f'{film}\n{name} "{kind}" {{}}\n{world}' for kind in kinds)
    yield f"{film} {{}}\n{world}"
    yield from (f'{bare}LightSource "{kind}" {{}}\n' for kind in LIGHTS)
    yield f'{bare}AreaLightSource "diffuse" {{}}\nShape "sphere"\n'
    yield from (f'{bare}Material "{kind}" "float roughness" .2 {{}}\nShape "sphere"\n' for kind in materials.split())
    yield from (f'{bare}Shape "{kind}" {{}}\n' for kind in SHAPES)
    for kind in TEXTURES:
        use = f'Material "{materials.split()[0]}" "texture {base}" "t"\nShape "sphere"\n'
        yield f'{bare}Texture "t" "{color}" "{kind}" {{}}\n{use}'


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
    file, found = folder / f"a{DIALECTS[dialect][0]}", []
    for text in texts(dialect):
        names.clear()
        before = made(text.replace("{}", ""), file)
        assert before is not None, text
        line = next(line for line in text.splitlines() if "{}" in line)
        kind = line.split('"')[5 if line.startswith("Texture") else 1]
        for name in sorted(name for name in names - {""} if not {name, f"{kind}: {name}"} & NOTHING):
            if f'"float {name}" ' not in text and not any(
                shows(before, made(text.replace("{}", one.format(name)), file)) for one in CANDIDATES
            ):
                found.append(f"{kind}: {name}")
    return found


def shows(before: tuple[Scene, list[str]], after: tuple[Scene, list[str]] | None) -> bool:
    """Whether a file that can be read made another scene or report."""
    return after is not None and (before[1] != after[1] or difference(before[0], after[0]) is not None)


@pytest.mark.parametrize("dialect", [pytest.param("pbrt", marks=pytest.mark.slow), "pbrt4"])
def test_no_parameter_is_lost_in_silence(dialect: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert silent(dialect, tmp_path, monkeypatch) == []
