"""The renderer of each time of a sequence, for models whose parts do not move rigidly."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

from analysis.tracer.render_options import RenderOptions
from renderer.trace import Renderer
from scenes import catalog
from scenes.canonical import Scene
from scenes.models.scenes_of_models import content_of, is_posed

ANEW = (
    "poses that are named are those of the first frame: "
    "what does not move rigidly is read anew for each frame, and stands still while the shutter is open"
)


class Posing:
    """Renderers of a scene: one for all times, or one for each where a model is posed.

    Attributes:
        anew: whether the scene is read for each time.
        later_losses: losses at other times that were asked for, each once; those of the first are left out.
    """

    def __init__(self, options: RenderOptions, scene: Scene, losses: Iterable[str]) -> None:
        """Builds the renderer of the first time.

        Args:
            options: of the command.
            scene: scene as at the first time.
            losses: those of the first time.
        """
        self._options, self._scene = options, scene
        self._facets = options.integrator == "path"  # so that a model is read once
        self.anew = is_posed(options.scene, self._facets)
        self._time_s, self._renderer = options.time_s, self._of(scene)
        self.later_losses: list[str] = []
        self._told = set(map(_part_of, losses))

    def at(self, time_s: float) -> Renderer:
        """The renderer of a time in seconds; the last one is kept."""
        if self.anew and time_s != self._time_s:
            look = dataclasses.replace(self._options.look, pose_s=time_s)
            scene, losses = catalog.load_seen(self._options.scene, look, self._options.phase)
            self._time_s, self._renderer = time_s, self._of(scene)
            self.later_losses += [loss for loss in losses if _part_of(loss) not in self._told]
            self._told.update(map(_part_of, losses))
        return self._renderer

    def _of(self, scene: Scene) -> Renderer:
        return Renderer(scene, self._options.device, self._options.threads or None, seed=self._options.seed)

    @property
    def content(self) -> Any:
        """Everything in the input that decides the pictures: the scene, and the files of a model that is posed."""
        return content_of(self._options.scene, self._scene, self._facets)


def _part_of(loss: str) -> str:
    """The part that is lost, without what it became, which may name the time."""
    return loss.rpartition(": ")[0]
