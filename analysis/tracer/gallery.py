"""One picture for each effect of the ray tracer, and a sheet of them all."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.command.console import Table
from analysis.command.progress import Task
from analysis.storage.files import atomic
from analysis.tracer.options import GalleryOptions
from scenes.effects import scenes as effects
from tsar.config import require

if TYPE_CHECKING:
    from renderer.sampling.plan import SamplePlan

COLUMNS = 4


def render_effect(name: str, plan: SamplePlan, options: GalleryOptions, task: Task) -> tuple[NDArray[np.uint8], dict]:
    """Renders the scene of an effect and writes ``NAME.png`` and ``NAME.exr``.

    Returns:
        The picture in sRGB, and facts about it.
    """
    from renderer.film.files import encode_srgb, write_image
    from renderer.frames import render_image
    from renderer.kernels.entry import compiled_count
    from renderer.layout.features import MEANING, Feature
    from renderer.trace import Renderer

    scene = effects.load(name)
    renderer = Renderer(scene, options.device, options.threads or None, seed=options.seed)
    start = time.perf_counter()
    image = render_image(renderer, plan, options.width_px, options.height_px, 0.0, renderer.shutter_s, done=task.reach)
    wall_s = time.perf_counter() - start
    renderer.close()
    nonfinite = write_image(options.out / f"{name}.png", image)
    write_image(options.out / f"{name}.exr", image)
    return encode_srgb(image), {
        "what": effects.EFFECTS[name].what,
        "features": [MEANING[feature] for feature in Feature if feature in renderer.features],
        "packets": renderer.packets,
        "sets_compiled": compiled_count(),
        "wall_s": wall_s,
        "samples_per_s": options.width_px * options.height_px * options.samples / wall_s,
        "nonfinite": nonfinite,
        "mean_radiance": image.double().mean(dim=(0, 1)).tolist(),
    }


def write_sheet(path: Path, pictures: Sequence[NDArray[np.uint8]], captions: Sequence[str]) -> None:
    """Writes all pictures on one sheet, each with its caption below."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = -(-len(pictures) // COLUMNS)
    height, width = pictures[0].shape[:2]
    inch = 3.2
    figure, axes = plt.subplots(
        rows, COLUMNS, figsize=(inch * COLUMNS, (inch * height / width + 0.32) * rows), squeeze=False, dpi=110
    )
    for axis in axes.flat:
        axis.axis("off")
    for axis, picture, caption in zip(axes.flat, pictures, captions, strict=False):
        axis.imshow(picture, interpolation="antialiased")
        axis.set_title(caption, fontsize=7.5, y=-0.11)
    figure.subplots_adjust(left=0.005, right=0.995, top=0.995, bottom=0.03, wspace=0.02, hspace=0.12)
    with atomic(path) as temporary:
        figure.savefig(temporary, pil_kwargs={"quality": 88})
    plt.close(figure)


def names(options: GalleryOptions) -> tuple[str, ...]:
    """Effects to show.

    Raises:
        ValueError: an effect is unknown.
    """
    for name in options.effects:
        require(name in effects.EFFECTS, "effects", f"one of {', '.join(effects.EFFECTS)}", name)
    return tuple(dict.fromkeys(options.effects)) or tuple(effects.EFFECTS)


def sample_plan(options: GalleryOptions) -> SamplePlan:
    """The sampling of the pixels.

    Raises:
        ValueError: the point set cannot have this number of samples, an effect is unknown, or the pictures do not fit
            into memory.
    """
    names(options)
    from renderer.sampling.plan import SamplePlan
    from renderer.tables.checks import check_frame_size

    check_frame_size(options.width_px, options.height_px, 1)
    return SamplePlan(options.samples, options.point_set, options.seed, options.space_filter)


def effect_table(found: Mapping[str, Mapping[str, Any]]) -> Table:
    """A table of the cost of each picture."""
    rows = [
        (
            name,
            "packets" if each["packets"] else f"{len(each['features'])} features",
            f"{each['wall_s']:.2f}",
            f"{each['samples_per_s'] / 1e6:.2f}",
        )
        for name, each in found.items()
    ]
    return Table("", ("effect", "kernels", "seconds", "M samples/s"), rows, words=2)
