"""Mitsuba 3 and LuxCore as renderers of scene files, each in a process of its own.

Their libraries cannot be loaded together, and a scene that one cannot load may crash it. Both use a box filter of one
pixel, whatever filter a file asks for, so that pictures differ by the scene alone.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenes.formats.mitsuba.write_materials import BLUNT

# A file of Mitsuba 0.5 is upgraded to Mitsuba 3 by editing its tree, without this project's importer, so that its
# picture is an independent reference. Version 3 renames most properties itself, but moves texture coordinates before it
# scales them, which 0.5 does after. Its blend with a perfect mirror or glass loses light, which that of 0.5 does not:
# there both get facets of a small alpha.
_MITSUBA = (
    f"BLUNT = {BLUNT}"
    + """
import os, sys, numpy as np, mitsuba as mi, xml.etree.ElementTree as E
file, out, width, height, samples, seed = sys.argv[1], sys.argv[2], *map(int, sys.argv[3:])
mi.set_variant("scalar_rgb")
root = E.parse(file).getroot()
old = root.get("version", "").startswith("0.")

def linear(text):
    if text.startswith("#"):
        values = [int(text[n:n + 2], 16) / 255 for n in (1, 3, 5)]
    else:
        values = [float(part) for part in text.replace(",", " ").split()]
    return ", ".join(repr(v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4) for v in values)

for blend in root.iter("bsdf"):
    for node in blend.iter("bsdf") if old and blend.get("type") == "blendbsdf" else ():
        if node.get("type") in ("conductor", "dielectric"):
            node.set("type", "rough" + node.get("type"))
            node.append(E.Element("float", name="alpha", value=str(BLUNT)))

for texture in root.iter("texture") if old else ():
    given = {part.get("name"): part for part in texture if part.tag == "float"}
    sizes = [given.get(name, given.get("uvscale")) for name in ("uscale", "vscale")]
    moves = [given.get(name) for name in ("uoffset", "voffset")]
    if any(part is not None for part in sizes + moves):
        for name in {"uscale", "vscale", "uvscale", "uoffset", "voffset"} & set(given):
            texture.remove(given[name])
        placing = E.SubElement(texture, "transform", name="to_uv")
        for kind, parts, none in (("scale", sizes, "1"), ("translate", moves, "0")):
            x, y = (none if part is None else part.get("value") for part in parts)
            E.SubElement(placing, kind, x=x, y=y)

for parent in list(root.iter()):
    for node in list(parent):
        if node.tag == "film":
            names = ("width", "height")
            keep = [part for part in node if part.get("name") in names]
            node[:] = keep + [E.Element("rfilter", type="box")]
            node.set("type", "hdrfilm")
        elif old and node.tag == "sampler":
            node.set("type", "independent")
            node[:] = []
        elif old and node.tag == "integrator":
            node.set("type", "volpath" if node.get("type", "").startswith("volpath") else "path")
            node[:] = [part for part in node if part.get("name") == "maxDepth"]
        elif old and node.tag == "srgb":
            node.tag = "rgb"
            node.set("value", linear(node.get("value")))
        elif old and node.tag in ("lookAt", "lookat"):
            node.tag = "lookat"
            if "up" not in node.attrib:
                target, origin = (np.array(node.get(n).replace(",", " ").split(), float) for n in ("target", "origin"))
                node.set("up", ", ".join(map(str, np.eye(3)[np.abs(target - origin).argmin()])))
        elif old and node.get("name") in ("filterType", "strictNormals", "flipTexCoords", "maxAnisotropy"):
            parent.remove(node)
        elif old and node.tag == "bsdf" and node.get("type") in ("difftrans", "mixturebsdf", "phong", "ward"):
            node.set("type", "diffuse")
            node[:] = []
        elif old and node.tag == "bsdf" and node.get("type") == "roughdiffuse":
            node.set("type", "diffuse")
            node[:] = [part for part in node if part.get("name") == "reflectance"]
mi.file_resolver().prepend(os.path.dirname(os.path.abspath(file)))
config = mi.parser.ParserConfig("scalar_rgb")
config.unused_properties = mi.LogLevel.Debug
state = mi.parser.parse_string(config, E.tostring(root, "unicode"))
mi.parser.transform_all(config, state)
scene = mi.parser.instantiate(config, state)
scene = scene[0] if isinstance(scene, list) else scene
parameters = mi.traverse(scene)
(size,) = [key for key in parameters.keys() if key.endswith("film.size")]
parameters[size] = [width, height]
parameters.update()
np.save(out, np.array(mi.render(scene, spp=samples, seed=seed))[..., :3])
"""
)

# LuxCore's pictures begin with the bottom row, and are one row too low: it takes the ray of row y from
# height - y - 1, not from height - y. The missing row at the bottom repeats the row above it. LuxCore 2.10 knows
# scattering volumes of these files by another spelling than LuxRender, which it then refuses itself, and once scattered
# light alone. File names of LuxCore's own scenes are relative to a folder above theirs. A thread that waits for a core
# may leave its pixels without samples for some passes; the picture is taken after all have some, unless it is cropped.
_LUXCORE = """
import os, sys, time, numpy as np
import pyluxcore as lux  # after NumPy: its allocator stops a later import
file, out = sys.argv[1], os.path.abspath(sys.argv[2])
width, height, samples, seed = map(int, sys.argv[3:])
lux.Init()
os.chdir(os.path.dirname(os.path.abspath(file)))
text = open(os.path.basename(file), encoding="utf-8", errors="replace").read()
kinds = '"homogeneous"', '"homogenous"'
if kinds[0] in text:
    with open(out + ".lxs", "w", encoding="utf-8") as copy:
        copy.write(text.replace(*kinds))
how, what = lux.Properties(), lux.Properties()
if file.endswith((".cfg", ".scn")):
    (how if file.endswith(".cfg") else what).SetFromFile(os.path.basename(file))
    if how.IsDefined("scene.file"):
        while not os.path.exists(how.Get("scene.file").GetString()) and os.getcwd() != "/":
            os.chdir("..")
        what.SetFromFile(how.Get("scene.file").GetString())
        how.Delete("scene.file")
else:
    lux.ParseLXS(out + ".lxs" if kinds[0] in text else os.path.basename(file), how, what)
for name in list(what.GetAllNames()):
    if name.startswith("scene.volumes.") and what.Get(name).GetString() == "homogenous":
        what.Set(lux.Property(name, "homogeneous"))
        what.Set(lux.Property(name.replace(".type", ".multiscattering"), True))
for name in list(how.GetAllNames()):
    if name.startswith("film.imagepipeline"):
        how.Delete(name)
for name, value in {"renderengine.type": "PATHCPU", "sampler.type": "SOBOL", "batch.haltspp": 4 * samples + 64,
                    "film.width": width, "film.height": height, "film.filter.type": "NONE",
                    "film.outputs.1.type": "SAMPLECOUNT", "film.outputs.1.filename": "counts.exr",
                    "renderengine.seed": seed + 1}.items():
    how.Set(lux.Property(name, value))
scene = lux.Scene()
scene.Parse(what)
session = lux.RenderSession(lux.RenderConfig(how, scene))
session.Start()
counts = np.zeros((height, width), np.uint32)
while not session.HasDone() and (counts.mean() < samples or not counts.all()):
    time.sleep(0.02)
    session.UpdateStats()
    session.GetFilm().GetOutputUInt(lux.FilmOutputType.SAMPLECOUNT, counts, 0)
session.Stop()
pixels = np.zeros((height, width, 3), np.float32)
session.GetFilm().GetOutputFloat(lux.FilmOutputType.RGB, pixels, 0)
pixels = pixels[::-1]
np.save(out, np.concatenate([pixels[1:], pixels[-1:]]))
sys.stdout.flush()
os._exit(0)
"""

_PROGRAMS = {"mitsuba": _MITSUBA, "luxcore": _LUXCORE}

_MODULES = {"mitsuba": "mitsuba", "luxcore": "pyluxcore"}

# Imports of renderers are as long as small pictures take: processes of several pictures begin as copies of one, and
# each ends when its time is over.
_SEVERAL = """
import importlib, json, os, signal, sys, numpy
module, program, limit_s, jobs = *sys.argv[1:3], float(sys.argv[3]), json.loads(sys.argv[4])
importlib.import_module(module)
for job in jobs:
    if os.fork() == 0:
        signal.setitimer(signal.ITIMER_REAL, limit_s)
        sys.argv[1:] = job
        try:
            exec(program, {"__name__": "__main__"})
        finally:
            os._exit(0)
    os.wait()
"""

ENGINES = {"mitsuba": "mitsuba", "mitsuba3": "mitsuba", "luxrender": "luxcore", "luxcore": "luxcore"}
"""The renderer of each format that has one."""

RenderedImage = NDArray[np.float32]


def rendered(
    program: str, file: Path, out: Path, size: tuple[int, int], samples: int, limit_s: float, seed: int = 0
) -> RenderedImage | str:
    """The picture of a renderer, or a line that says why it made none.

    Args:
        program: ``mitsuba`` (scenes of version 3, and of 0.5 as far as 3 has their plugins) or ``luxcore``.
        file: the scene.
        out: file for the picture, ``.npy``.
        size: width and height, pixels.
        samples: samples per pixel.
        limit_s: most seconds.
        seed: seed of the noise.

    Returns:
        ``(height, width, 3)`` linear radiance, or the last line that the renderer printed.
    """
    numbers = map(str, (*size, samples, seed))
    out.unlink(missing_ok=True)
    command = [sys.executable, "-c", _PROGRAMS[program], str(file), str(out), *numbers]
    try:
        done = subprocess.run(
            command, capture_output=True, encoding="utf-8", errors="replace", timeout=limit_s, check=False
        )
    except subprocess.TimeoutExpired:
        return f"no picture within {limit_s:g} s"
    if not out.is_file():
        lines = (done.stderr or done.stdout).strip().splitlines() or [f"exit code {done.returncode}"]
        return lines[-1].strip()[:160]
    return np.load(out)


def drawn(
    program: str, files: list[tuple[Path, Path]], size: tuple[int, int], samples: int, limit_s: float
) -> dict[Path, RenderedImage]:
    """The pictures of several files, by the files for the pictures, as :func:`rendered` draws them one by one; those
    that the renderer does not make are missing.

    Args:
        program: ``mitsuba`` or ``luxcore``.
        files: scenes, and files for their pictures.
        size: width and height, pixels.
        samples: samples per pixel.
        limit_s: most seconds for each picture.
    """
    for _, out in files:
        out.unlink(missing_ok=True)
    jobs = json.dumps([[str(file), str(out), *map(str, (*size, samples, 0))] for file, out in files])
    command = [sys.executable, "-c", _SEVERAL, _MODULES[program], _PROGRAMS[program], str(limit_s), jobs]
    subprocess.run(command, capture_output=True, check=False)
    return {out: np.load(out) for _, out in files if out.is_file()}
