"""Converted scenes, rendered by their target renderers and compared."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.command.progress import Task
from analysis.conversion.options import CheckOptions
from analysis.conversion.peers import ENGINES, RenderedImage, rendered

if TYPE_CHECKING:
    from scenes.canonical import Instance, Scene


def flip(first: RenderedImage, second: RenderedImage) -> float:
    """Mean FLIP of two pictures, encoded for a display."""
    import flip_evaluator

    shown = [one.astype(np.float32) / 255.0 for one in (shown_as(first), shown_as(second))]
    return float(flip_evaluator.evaluate(shown[0], shown[1], "LDR")[1])


def shown_as(picture: RenderedImage) -> np.ndarray:
    """A picture encoded for a display, 8 bits."""
    import torch

    from renderer.film.files import encode_srgb

    return encode_srgb(torch.as_tensor(np.ascontiguousarray(picture)))


def checked(options: CheckOptions, task: Task) -> list[dict[str, Any]]:
    """A row for each pair of pictures of each scene, with the rendering of the source file first if there is one."""
    rows: list[dict[str, Any]] = []
    shown: list[tuple[str, RenderedImage]] = []
    for number, source in enumerate(options.scenes):
        name = f"{source.parent.name}/{source.name}"
        folder = options.out / f"{number:02d}-{source.parent.name}-{source.stem}"
        scene, pictures, again, lost = _pictures(options, source, folder)
        first = next(iter(pictures))
        for other in [other for other in pictures if other != first]:
            rows.append(_row(name, (first, other), pictures, again, lost))
        if options.plain:
            rows.append(_plain_row(options, name, scene, folder))
        shown += [(f"{name}: {what}", one) for what, one in pictures.items() if not isinstance(one, str)]
        task.advance()
    if shown:
        _sheet(options.out / "pictures.jpg", shown)
    return rows


def _pictures(
    options: CheckOptions, source: Path, folder: Path
) -> tuple[Scene, dict[str, RenderedImage | str], RenderedImage | str, dict[str, list[str]]]:
    """A scene, its pictures by renderer, the first picture again with other noise, and the losses for each."""
    from scenes.formats.conversion import format_of, load_scene_file, save_scene_file
    from scenes.formats.losses import LossReport

    read = LossReport()
    scene = load_scene_file(source, options.root, read)
    size = _size(options, scene)
    targets = {"mitsuba": ("mitsuba3", folder / "mitsuba3.xml"), "luxcore": ("luxrender", folder / "luxrender.lxs")}
    own = ENGINES.get(format_of(source))
    jobs = [(f"{own}, as it is", own, source)] if own else []
    lost = {"": [str(loss) for loss in read.losses]}
    for program, (kind, file) in targets.items():
        report = LossReport()
        save_scene_file(scene, file, kind, report)  # type: ignore[arg-type]
        lost[program] = [str(loss) for loss in report.losses]
        jobs.append((program, program, file))

    def picture(name: str, program: str, file: Path, seed: int) -> RenderedImage | str:
        out = folder / f"{name.replace(', ', '-').replace(' ', '-')}-{seed}.npy"
        return rendered(program, file, out, size, options.samples, options.limit_s, seed)

    return scene, {job[0]: picture(*job, 0) for job in jobs}, picture(*jobs[0], 1), lost


def _size(options: CheckOptions, scene: Scene) -> tuple[int, int]:
    return options.width_px, max(1, round(options.width_px * scene.film.height_px / scene.film.width_px))


def plain(scene: Scene) -> Scene:
    """The scene with every surface matte, in its dominant colour."""
    from scenes.canonical import ConstantTexture, Matte
    from scenes.formats.appearance.folding import mean_of

    def matte(instance: Instance) -> Instance:
        material: Any = instance.material
        while hasattr(material, "base"):
            material = material.base
        texture = getattr(material, "reflectance", None) or getattr(material, "diffuse", None)
        color = (0.5, 0.5, 0.5) if texture is None else mean_of(texture)
        return dataclasses.replace(instance, material=Matte(ConstantTexture(color)))

    return dataclasses.replace(scene, instances=tuple(matte(one) for one in scene.instances), materials={})


def _plain_row(options: CheckOptions, name: str, scene: Scene, folder: Path) -> dict[str, Any]:
    from scenes.formats.conversion import save_scene_file

    made, size = plain(scene), _size(options, scene)
    pictures: dict[str, RenderedImage | str] = {}
    for program, kind, file in (("mitsuba", "mitsuba3", "plain.xml"), ("luxcore", "luxrender", "plain.lxs")):
        save_scene_file(made, folder / file, kind)  # type: ignore[arg-type]
        out = folder / f"plain-{program}.npy"
        pictures[program] = rendered(program, folder / file, out, size, options.samples, options.limit_s)
    again = rendered(
        "mitsuba", folder / "plain.xml", folder / "plain-again.npy", size, options.samples, options.limit_s, 1
    )
    return _row(f"{name}, matte", ("mitsuba", "luxcore"), pictures, again, {"": []})


def _row(
    scene: str,
    names: tuple[str, str],
    pictures: dict[str, RenderedImage | str],
    again: RenderedImage | str,
    lost: dict[str, list[str]],
) -> dict[str, Any]:
    losses = lost[""] + [loss for name in names for loss in lost.get(name, [])]
    row: dict[str, Any] = {"scene": scene, "first": names[0], "second": names[1], "losses": losses}
    first, second = (pictures[name] for name in names)
    for name, one in zip(names, (first, second), strict=True):
        if isinstance(one, str):
            return {**row, "note": f"{name}: {one}"}
    assert not isinstance(first, str) and not isinstance(second, str)
    means = first.mean(axis=(0, 1)), second.mean(axis=(0, 1))
    for name, value in zip("rgb", means[1] / np.maximum(means[0], 1e-9), strict=True):
        row[f"mean_{name}"] = float(value)
    noise = float("nan") if isinstance(again, str) else flip(first, again)
    return {**row, "flip": flip(first, second), "flip_noise": noise, "note": ""}


def _sheet(path: Path, shown: list[tuple[str, RenderedImage]]) -> None:
    from analysis.tracer.gallery import write_sheet

    height = max(one.shape[0] for _, one in shown)
    padded = [np.pad(shown_as(one), ((0, height - one.shape[0]), (0, 0), (0, 0))) for _, one in shown]
    write_sheet(path, padded, [name for name, _ in shown])
