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
_FILTER, _FILTER_PX = "BLACKMANHARRIS", 2.0
_WIDTH_PX, _HEIGHT_PX = 640, 480
_DEPTHS = {"total": 6, "diffuse": 4, "glossy": 4, "specular": 6}
"""Most bounces of a path: of all kinds, and of each kind of scattering. Those of the kinds end paths earlier."""

_BIDIRECTIONAL_DEPTH = 5

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

    # a scene alone has no configuration whose defaults could be lost
    lost = report if any(not key.startswith("scene.") for key in found) else LossReport()
    size = one("film.width", _WIDTH_PX), one("film.height", _HEIGHT_PX)
    film = [*numbers("xresolution", size[0]), *numbers("yresolution", size[1])]
    if one("batch.haltspp", 0.0):
        film += numbers("haltspp", one("batch.haltspp", 0.0))
    yield made("Film", "film.width", "fleximage", film)
    yield _filter(found, place_of, file, lost)
    if "sampler.type" in found:
        yield made("Sampler", "sampler.type", _kind(found, "sampler.type", _SAMPLERS, report), [])
    engine = _kind(found, "renderengine.type", _ENGINES, report) if "renderengine.type" in found else "path"
    if engine == "bidirectional":
        eye, light = (one(key, _BIDIRECTIONAL_DEPTH) for key in ("path.maxdepth", "light.maxdepth"))
        yield made(
            "SurfaceIntegrator", "path.maxdepth", engine, numbers("eyedepth", eye) + numbers("lightdepth", light)
        )
    else:
        keys = {kind: f"path.pathdepth.{kind}" for kind in _DEPTHS}
        if "path.maxdepth" in found and not any(key in found for key in keys.values()):
            keys = dict.fromkeys(keys, "path.maxdepth")
        depths = {kind: one(keys[kind], most) for kind, most in _DEPTHS.items()}
        for kind, most in depths.items():
            if most < depths["total"]:
                where = str(found.get(keys[kind], place_of).place)
                lost.add(where, f"at most {most:g} {kind} bounces", f"{depths['total']:g}, as of all kinds")
        yield made("SurfaceIntegrator", "path.pathdepth.total", engine, numbers("maxdepth", depths["total"]))
    for key in ("film.width", "film.height", "batch.haltspp", "sampler.type", "renderengine.type", "path.maxdepth",
                "light.maxdepth", *(f"path.pathdepth.{kind}" for kind in _DEPTHS)):  # fmt: skip
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


def _filter(found: Block, place_of: Property, file: Path, report: LossReport) -> Directive:
    kind = found.pop("film.filter.type", None)
    wanted, place = _FILTER if kind is None else kind.word(), (kind or place_of).place
    name = _FILTERS.get(wanted, "gaussian")
    if wanted not in _FILTERS:
        report.unknown(place, "filter", wanted, name)
    elif wanted in _REPLACED:
        report.add(str(place), f"filter {wanted!r}", name)
    both = found.pop("film.filter.width", None)
    values: list[Values] = []
    for axis in ("x", "y"):
        width = found.pop(f"film.filter.{axis}width", both)
        if wanted != "NONE":
            values += numbers(f"{axis}width", _FILTER_PX if width is None else float(width.numbers(1)[0]))
    return directive("PixelFilter", (name,), values, place, file)
