"""Configuration of a rendering by LuxCore: film, sampler and engine.

Source: LuxCore SDK reference manual (wiki of LuxCoreRender), sections on the film, samplers and render engines.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from scenes.formats.directives.syntax import Directive, Values
from scenes.formats.losses import LossReport
from scenes.formats.luxcore.directives import directive, numbers
from scenes.formats.luxcore.syntax import Block, Property

_ENGINES = {
    "PATHCPU": "path", "PATHOCL": "path", "TILEPATHCPU": "path", "TILEPATHOCL": "path", "RTPATHCPU": "path",
    "RTPATHOCL": "path", "BIDIRCPU": "bidirectional", "BIDIRVMCPU": "bidirectional",
}  # fmt: skip
_SAMPLERS = {"SOBOL": "sobol", "RANDOM": "random", "METROPOLIS": "metropolis", "TILEPATHSAMPLER": "random",
             "RTPATHCPUSAMPLER": "random"}  # fmt: skip
_FILTERS = {"NONE": "box", "BOX": "box", "GAUSSIAN": "gaussian", "MITCHELL": "mitchell", "MITCHELL_SS": "mitchell",
            "SINC": "sinc", "CATMULLROM": "mitchell", "BLACKMANHARRIS": "gaussian"}  # fmt: skip
_REPLACED = ("MITCHELL_SS", "CATMULLROM", "BLACKMANHARRIS")
_DEPTH, _WIDTH_PX, _HEIGHT_PX = 6, 640, 480

_SAME_PICTURE = tuple(
    "film. renderengine. sampler. batch. periodicsave. opencl. cuda. context. native. accelerator. screen. tile. "
    "tilepath. rtpath. lightstrategy. path.photongi. path.hybridbackward. path.russianroulette. scene.epsilon. "
    "path.albedospecular. light.russianroulette. compile.".split()
)
"""Beginnings of keys that affect how LuxCore computes and stores its picture."""


def settings(found: Block, place_of: Property, file: Path, report: LossReport) -> Iterator[Directive]:
    """The directives of a configuration; its properties are taken out of ``found``.

    Args:
        found: properties by key.
        place_of: first property of the file, whose place stands for defaults.
        file: file of the scene.
        report: receives the losses.
    """

    def made(name: str, key: str, kind: str, values: list[Values]) -> Directive:
        return directive(name, (kind,), values, found.get(key, place_of).place, file)

    def one(key: str, default: float) -> float:
        return float(found[key].numbers(1)[0]) if key in found else default

    size = one("film.width", _WIDTH_PX), one("film.height", _HEIGHT_PX)
    film = [*numbers("xresolution", size[0]), *numbers("yresolution", size[1])]
    if one("batch.haltspp", 0.0):
        film += numbers("haltspp", one("batch.haltspp", 0.0))
    yield made("Film", "film.width", "fleximage", film)
    if "film.filter.type" in found:
        yield from _filter(found, file, report)
    if "sampler.type" in found:
        yield made("Sampler", "sampler.type", _kind(found, "sampler.type", _SAMPLERS, report), [])
    engine = _kind(found, "renderengine.type", _ENGINES, report) if "renderengine.type" in found else "path"
    total = next((key for key in ("path.pathdepth.total", "path.maxdepth") if key in found), "")
    depth = one(total, _DEPTH)
    values = numbers("maxdepth", depth)
    if engine == "bidirectional":
        values = numbers("eyedepth", depth) + numbers("lightdepth", one("light.maxdepth", depth))
    yield made("SurfaceIntegrator", total, engine, values)
    for kind in ("diffuse", "glossy", "specular"):
        key = f"path.pathdepth.{kind}"
        if key in found and one(key, depth) >= depth - 1.0:
            del found[key]
    for key in ("film.width", "film.height", "batch.haltspp", "sampler.type", "renderengine.type", total,
                "light.maxdepth"):  # fmt: skip
        found.pop(key, None)
    for key, left in list(found.items()):
        if key.startswith(_SAME_PICTURE):
            report.hint(str(left.place), f"property {key!r}")
            del found[key]


def _kind(found: Block, key: str, kinds: dict[str, str], report: LossReport) -> str:
    wanted = found[key].word()
    if wanted not in kinds:
        report.unknown(found[key].place, key, wanted, next(iter(kinds.values())))
    return kinds.get(wanted, next(iter(kinds.values())))


def _filter(found: Block, file: Path, report: LossReport) -> Iterator[Directive]:
    kind = found.pop("film.filter.type")
    wanted, name = kind.word(), _FILTERS.get(kind.word(), "gaussian")
    if wanted not in _FILTERS:
        report.unknown(kind.place, "filter", wanted, name)
    elif wanted in _REPLACED:
        report.add(str(kind.place), f"filter {wanted!r}", name)
    values: list[Values] = []
    for axis in ("x", "y"):
        for key in (f"film.filter.{axis}width", "film.filter.width"):
            if key in found and wanted != "NONE":
                values += numbers(f"{axis}width", *found[key].numbers(1).tolist())
                break
    for key in ("film.filter.xwidth", "film.filter.ywidth", "film.filter.width"):
        found.pop(key, None)
    yield directive("PixelFilter", (name,), values, kind.place, file)
