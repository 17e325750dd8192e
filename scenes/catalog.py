"""Built-in scenes by name."""

from __future__ import annotations

from pathlib import Path

from scenes import effects, report
from scenes.canonical import Scene, SceneError
from scenes.driving import ANIMATIONS
from scenes.driving import load as load_driving
from scenes.formats.blocks import load_blocks
from scenes.loading import asset

NAMES: tuple[str, ...] = tuple(ANIMATIONS)
"""Names of the driving scenes, the inputs of experiments; they also go by their number."""

BLUR_SCENES = {"planescene": "plane/planescene.txt", "spheresscene": "spheres/spheresscene.txt"}
"""The two scenes of the motion-blur perception study, and their files among the assets."""


def all_names() -> tuple[str, ...]:
    """Names of all built-in scenes."""
    return (*NAMES, *BLUR_SCENES, *effects.EFFECTS, *report.IMAGES)


def blur_scene_file(name: str) -> Path:
    """The block file of a scene of the study."""
    return asset(BLUR_SCENES[name])


def load(name: str, phase: float = 0.0) -> Scene:
    """A built-in scene.

    Args:
        name: one of :func:`all_names`, or the place of a driving scene among :data:`NAMES`.
        phase: of the animation of a driving scene, for repetitions; see :func:`scenes.driving.load`.

    Raises:
        SceneError: there is none of that name, or the phase is not in [0, 1) or another than 0 for a scene without.
    """
    found = NAMES[int(name)] if name.isdecimal() and int(name) < len(NAMES) else name
    if found not in all_names():
        raise SceneError(f"scene: expected one of {', '.join(all_names())} or 0 to {len(NAMES) - 1}, got {name!r}")
    if not 0.0 <= phase < 1.0:
        raise SceneError(f"phase: expected a fraction of a wheel's turn in [0, 1), got {phase}")
    if found in NAMES:
        return load_driving(found, phase)
    if phase != 0.0:
        raise SceneError(f"phase: expected 0 for the scene {found}, which has no phases, got {phase}")
    if found in BLUR_SCENES:
        return load_blocks(blur_scene_file(found))[0]
    return report.load(found) if found in report.IMAGES else effects.load(found)
