"""The scene of a run and its renderers, checked before the run starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analysis.command.cli import bad_input, require_memory
from analysis.command.ownership import writable_folder
from analysis.command.start import first_imports
from analysis.comparison.options import RunOptions
from analysis.comparison.stored import names_of
from analysis.storage.results import own_results

if TYPE_CHECKING:
    from renderer.posed import PosedRenderer
    from renderer.trace import Renderer
    from scenes.canonical import Scene

_BYTES_PER_PIXEL = 260  # bytes a pixel: images, age fields and samples of a run
_BYTES_PER_PIXEL_SCORED = 6  # bytes a pixel and image: codes of a display and of the reference, kept for jod
_BYTES_PER_CACHED_SAMPLE = 20  # bytes a sample of the cache: colours and wavelet coefficients


@dataclass(frozen=True)
class Setup:
    """Inputs of a run before it starts."""

    scene: Scene
    renderer_of: Callable[[float], Renderer | PosedRenderer]
    """Makes a renderer that filters textures for a given number of samples along a pixel's side."""
    losses: tuple[str, ...] = ()


def prepare(options: RunOptions, scene: Scene | None = None) -> Setup:
    """Checks the machine, loads the scene unless one is given, and builds the renderer of the adaptive run.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    with bad_input():
        kept = _BYTES_PER_PIXEL_SCORED * options.images_scored if "jod" in options.further_metrics else 0
        require_memory(options.pixels_held * (_BYTES_PER_PIXEL + kept), options.size)
        slots = options.tsar.cache_slots
        require_memory(slots * options.tsar.samples * _BYTES_PER_CACHED_SAMPLE, f"cache_size: {slots} framelets")
    with first_imports():
        from renderer.posed import STANDING_STILL
        from scenes import catalog

    with bad_input():
        given = scene
        scene, losses = catalog.load_seen(given or options.input, options.look, options.phase, options.camera_path)
        how = options.look, options.phase, options.camera_path
        scene_at = None if given else catalog.poses_of(options.input, *how, scene)
        renderer_of = _renderers(options, scene, scene_at)
        own_results(options.out, names_of(options))
        writable_folder(options.references, "references")
        renderer_of(1)  # an error of the scene's loader is bad input
    for loss in (*losses, *([STANDING_STILL] if scene_at else [])):
        print(loss)
    return Setup(scene, renderer_of, losses)


def _renderers(
    options: RunOptions, scene: Scene, scene_at: Callable[[float], Scene] | None
) -> Callable[[float], Renderer | PosedRenderer]:
    """Makes renderers that filter textures for a number of samples along a pixel's side."""
    with first_imports():
        from renderer.posed import renderers
        from renderer.stages.control import expect_stages
        from renderer.trace import Renderer

    expect_stages(options.stages)
    made = renderers(
        scene,
        scene_at,
        lambda one, px, origin: Renderer(one, options.device, options.threads or None, px, origin=origin),
    )
    return lambda axis: made(min(options.tsar.shape) * axis)
