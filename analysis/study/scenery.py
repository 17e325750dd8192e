"""Renderers of the scenes of a study, and their references; a process caches them."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from analysis.metrics.quality import reference_times
from analysis.storage.reference import Reference, ReferenceSpec, content_hash, obtain, renderer_hash
from analysis.storage.source import code_hash
from analysis.study.cases import MovingScene, Scale, Tracing
from tsar.formats import rounded
from tsar.threads import one_thread

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from renderer.posed import PosedRenderer
    from renderer.trace import Renderer
    from scenes.canonical import Scene

_KEPT = 8
_OF_THE_SCENE = ("depth", "light_cells")


def forget() -> None:
    """Drops the scenes that this process caches: a file, or what an installed package makes, may have changed."""
    _scene.cache_clear()
    _renderers.cache_clear()
    _scene_hash.cache_clear()


@lru_cache(maxsize=_KEPT)
def _scene(animation: MovingScene, tracing: Tracing = ()) -> Scene:
    from scenes import catalog

    scene, _ = catalog.load_any(animation.input, animation.phase, animation.camera_path)
    return _changed(scene, tracing)


def _changed(scene: Scene, tracing: Tracing) -> Scene:
    """The scene with the settings of its integrator."""
    changed = dict[str, Any]()
    for name, value in tracing:
        if name == "depth":
            changed["depth"] = int(value)
        elif name == "light_cells":
            changed |= {"shadow_rays": "all", "light_cells": int(value)} if value else {"shadow_rays": "one"}
    return dataclasses.replace(scene, integrator=dataclasses.replace(scene.integrator, **changed)) if changed else scene


def renderer(
    animation: MovingScene, footprint_px: float, threads: int, tracing: Tracing = ()
) -> Renderer | PosedRenderer:
    """A renderer on the CPU that filters textures for ``footprint_px`` pixels along the image's side.

    Raises:
        ConfigError, SceneError: the scene cannot be loaded.
        ValueError: the scene cannot be traced with these settings.
    """
    return _renderers(animation, threads, tracing)(footprint_px)


@lru_cache(maxsize=_KEPT)
def _renderers(animation: MovingScene, threads: int, tracing: Tracing) -> Callable[[float], Renderer | PosedRenderer]:
    from renderer.posed import renderers
    from renderer.trace import Renderer
    from scenes import catalog

    of_the_scene = tuple(one for one in tracing if one[0] in _OF_THE_SCENE)
    how: dict[str, Any] = {name: value for name, value in tracing if name not in _OF_THE_SCENE}
    texels = how.pop("texels", "float32")
    scene = _scene(animation, of_the_scene)
    asked = animation.input, catalog.Look(), animation.phase, animation.camera_path
    at = catalog.poses_of(*asked, scene)

    def make(scene: Scene, footprint_px: float, origin: NDArray[np.float64] | None) -> Renderer:
        made = Renderer(scene, "cpu", threads, footprint_resolution_px=footprint_px, origin=origin, **how)
        if texels != "float32":
            made.change_texels(lambda values: rounded(values, texels))
        return made

    return renderers(scene, at and (lambda time_s: _changed(at(time_s), of_the_scene)), make)


def render_reference(animation: MovingScene, start_s: float, scale: Scale, folder: Path, threads: int) -> Reference:
    """The reference of an animation, from disk or rendered now.

    Args:
        animation: the scene and its motion.
        start_s: time of the first image, seconds.
        scale: sizes of the reference.
        folder: folder of references.
        threads: threads for tracing.
    """
    with one_thread():
        made_by = renderer(animation, scale.reference_px, threads)
        path = f" {animation.camera_path}" if animation.camera_path else ""
        spec = ReferenceSpec(
            scene=f"{animation.input}{path} phase {animation.phase:g}",
            scene_hash=_scene_hash(animation),
            renderer_hash=renderer_hash(made_by, "cpu"),
            start_s=start_s,
            rate_hz=scale.reference_rate_hz,
            count=len(reference_times(start_s, start_s + scale.seconds, scale.reference_rate_hz)),
            width_px=scale.reference_px,
            height_px=scale.reference_px,
            samples_per_axis=scale.reference_samples_per_axis,
        )
        side, axis = scale.reference_px, scale.reference_samples_per_axis
        return obtain(folder, spec, lambda t: made_by.render_frame(t, side, side, axis))


@lru_cache(maxsize=16)
def _scene_hash(animation: MovingScene) -> str:
    return scene_hash(animation.input, _scene(animation))


def scene_hash(name: str, scene: Scene, facets: bool = False) -> str:
    """Hash of a scene at all times: of its content and, where a model is posed, of its files and the code that reads
    them.

    Args:
        name, facets: as of :func:`scenes.models.scenes_of_models.is_posed`.
        scene: the scene as at one time.
    """
    from scenes.models import read_whole
    from scenes.models.scenes_of_models import content_of

    content = content_of(name, scene, facets)
    return content_hash(scene if content is scene else (content, code_hash(read_whole)))
