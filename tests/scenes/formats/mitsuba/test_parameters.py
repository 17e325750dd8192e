"""No property that the reader of Mitsuba files asks for is lost silently: each is changed in turn, in every version.

A change shows in the scene, in the report, or as an error; or the property is on the list of those without effect.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.formats.mitsuba.properties import Properties
from tests.scenes.formats.directives.test_parameters import made, shows

PICTURE = '<texture type="bitmap" name="{}"><string name="filename" value="a.png"/></texture>'
INNER = '<bsdf type="diffuse"/>'
PLAIN = {
    "integrator": "path direct volpath bdpt pssmlt ptracer",
    "sampler": "independent stratified ldsampler",
    "sensor": "perspective thinlens orthographic spherical",
    "emitter": "point spot directional constant sun sky sunsky",
    "shape": "sphere rectangle cube disk cylinder",
}
MATERIALS = (
    "diffuse roughdiffuse dielectric thindielectric roughdielectric conductor roughconductor plastic roughplastic "
    "phong ward difftrans principled"
).split()
AROUND = {"twosided": INNER, "mask": INNER, "coating": INNER, "blendbsdf": 2 * INNER,
          "bump": PICTURE.format("map") + INNER,
          "mixturebsdf": '<string name="weights" value="0.5, 0.5"/>' + 2 * INNER}  # fmt: skip
NOTHING = {
    "filename", "id",  # names
    "maxAnisotropy", "useFastApprox",  # how a picture is filtered, and how closely a formula is followed
    "ward: variant", "constant: toWorld",  # of what is reported as a whole, and of what is the same all around
}  # fmt: skip
CANDIDATES = (
    '<float name="{}" value="0.37"/>', '<float name="{}" value="3"/>', '<float name="{}" value="40"/>',
    '<integer name="{}" value="7"/>', '<boolean name="{}" value="true"/>', '<boolean name="{}" value="false"/>',
    '<rgb name="{}" value=".11 .22 .33"/>', '<vector name="{}" x=".3" y=".4" z=".5"/>',
    *(f'<string name="{{}}" value="{word}"/>' for word in ("nosuch", "ggx", "clamp", "nearest", "y", "Au", "30mm")),
    '<transform name="{}"><rotate x="1" y="1" angle="30"/><translate x="1"/><scale value="2"/></transform>', PICTURE,
)  # fmt: skip


def texts(version: str) -> Iterator[tuple[str, str]]:
    """Kinds of elements, and scenes with one of them in which another property can be put."""
    ball = '<shape type="sphere">{}</shape>'
    for tag, kinds in PLAIN.items():
        for kind in kinds.split():
            yield kind, f'<{tag} type="{kind}">{{}}</{tag}>' + ("" if tag == "shape" else ball.format(""))
    yield "envmap", '<emitter type="envmap"><string name="filename" value="a.png"/>{}</emitter>'
    yield "area", ball.format('<emitter type="area">{}</emitter>')
    medium = '<integrator type="volpath"/>' + ball.format('<medium type="homogeneous" name="interior">{}</medium>')
    yield "homogeneous", medium
    yield "hg", medium.format('<phase type="hg">{}</phase>')
    film = '<sensor type="perspective"><film type="hdrfilm">{}</film></sensor>'
    yield "hdrfilm", film
    for kind in ("box", "tent", "gaussian", "mitchell", "lanczos"):
        yield kind, film.format(f'<rfilter type="{kind}">{{}}</rfilter>')
    for kind in MATERIALS:
        yield kind, ball.format(f'<bsdf type="{kind}">{{}}</bsdf>')
    for kind, inside in AROUND.items():
        yield kind, ball.format(f'<bsdf type="{kind}">{inside}{{}}</bsdf>')
    inside = {"checkerboard": "", "scale": PICTURE.format("a"), "bitmap": '<string name="filename" value="a.png"/>'}
    for kind, first in inside.items():
        texture = f'<texture type="{kind}" name="reflectance">{first}{{}}</texture>'
        yield kind, ball.format(f'<bsdf type="diffuse">{texture}</bsdf>')
    for kind in ("hair",) if version.startswith("0") else ("bsplinecurve", "linearcurve"):
        yield kind, f'<shape type="{kind}"><string name="filename" value="{kind}.txt"/>{{}}</shape>'
    mesh = "ply" if version.startswith("0") else "obj"
    yield mesh, f'<shape type="{mesh}"><string name="filename" value="a.{mesh}"/>{{}}</shape>'


def files(folder: Path) -> None:
    """A picture, and a square as a mesh with normals and texture coordinates."""
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (4, 4, 3), np.uint8)).save(folder / "a.png")
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0.2), (0, 1, 0)]
    lines = [f"v {x} {y} {z}\nvt {x} {0.9 * y}\nvn 0 0.1 1" for x, y, z in corners]
    for kind, width in (("hair", 3), ("bsplinecurve", 4), ("linearcurve", 4)):
        (folder / f"{kind}.txt").write_text("".join(f"{' '.join([str(n + 1)] * width)}\n" for n in range(4)))
    (folder / "a.obj").write_text("\n".join([*lines, "f 1/1/1 2/2/2 3/3/3", "f 1/1/1 3/3/3 4/4/4", ""]))
    names = "".join(f"property float {name}\n" for name in "x y z nx ny nz u v".split())
    rows = "".join(f"{x} {y} {z} 0 0.1 1 {x} {0.9 * y}\n" for x, y, z in corners)
    (folder / "a.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex 4\n{names}element face 2\nproperty list uchar int vertex_index\n"
        f"end_header\n{rows}3 0 1 2\n3 0 2 3\n"
    )


def modern(name: str) -> str:
    """The name of a property in Mitsuba 3."""
    return {"intIOR": "int_ior", "extIOR": "ext_ior"}.get(name) or re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def silent(version: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Elements and properties whose change has no effect."""
    names: set[tuple[str, str]] = set()
    for method in "number text truth vector color motion __contains__".split():
        real = getattr(Properties, method)

        def asked(self: Properties, name: str = "toWorld", *rest: object, real=real) -> object:
            names.add((self.node.get("type"), name))
            return real(self, name, *rest)

        monkeypatch.setattr(Properties, method, asked)
    files(folder)
    file, found = folder / "a.xml", []
    for kind, body in texts(version):
        text = f'<scene version="{version}">{body}</scene>'
        names.clear()
        before = made(text.replace("{}", ""), file)
        assert before is not None, text
        for name in sorted(name for of, name in names if of == kind):
            written = name if version.startswith("0") else modern(name)
            if f'name="{name}"' in text:
                continue
            if not {name, f"{kind}: {name}"} & NOTHING and not any(
                shows(before, made(text.replace("{}", one.format(written)), file)) for one in CANDIDATES
            ):
                found.append(f"{kind}: {name}")
    return found


@pytest.mark.parametrize("version", ["0.5.0", "2.0.0", "3.0.0"])
def test_no_property_is_lost_in_silence(version: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert silent(version, tmp_path, monkeypatch) == []
