"""Built-in scenes by name."""

from __future__ import annotations

from pathlib import Path

from scenes.canonical import Scene, SceneError
from scenes.driving.animations import ANIMATIONS
from scenes.driving.animations import load as load_driving
from scenes.effects import report_images as report
from scenes.effects import scenes as effects
from scenes.loading import asset

NAMES: tuple[str, ...] = tuple(ANIMATIONS)
"""Names of the driving scenes, the inputs of experiments; they also go by their number."""

BLUR_SCENES = {"planescene": "plane/planescene.txt", "spheresscene": "spheres/spheresscene.txt"}
"""The two scenes of the motion-blur perception study, and their files among the assets."""


FILE_ENDINGS = (".pbrt", ".lxs", ".xml")
"""Of scene files of other renderers."""


def all_names() -> tuple[str, ...]:
    """Names of all built-in scenes."""
    return (*NAMES, *BLUR_SCENES, *effects.EFFECTS, *report.IMAGES)


def blur_scene_file(name: str) -> Path:
    """The block file of a scene of the study."""
    return asset(BLUR_SCENES[name])


def is_scene_file(name: str) -> bool:
    """Whether a name is that of a scene file of another renderer."""
    return Path(name).suffix.lower() in FILE_ENDINGS


def load_file(name: str, camera_path: str = "") -> tuple[Scene, tuple[str, ...]]:
    """A scene file of another renderer, as this one can draw it, and what was lost on the way.

    Args:
        name: of the file.
        camera_path: ``turntable`` or ``fly-through`` for motion where the file has none; empty for none.

    Raises:
        SceneError: it cannot be read.
    """
    from scenes.camera_paths import on_a_path
    from scenes.formats.conversion import load_scene_file
    from scenes.formats.drawable import drawable
    from scenes.formats.losses import LossReport

    losses = LossReport()
    scene = drawable(load_scene_file(Path(name), None, losses), losses)
    if camera_path:
        scene = on_a_path(scene, camera_path)  # type: ignore[arg-type]
    return scene, tuple(str(loss) for loss in losses.losses)


def load_any(name: str, phase: float = 0.0, camera_path: str = "") -> tuple[Scene, tuple[str, ...]]:
    """A built-in scene or that of a file, and what was lost; a camera path is for files alone."""
    if is_scene_file(name):
        return load_file(name, camera_path)
    if camera_path:
        raise SceneError(f"camera_path: expected none for a built-in scene, got {camera_path}")
    return load(name, phase), ()


def load(name: str, phase: float = 0.0) -> Scene:
    """A built-in scene.

    Args:
        name: one of :func:`all_names`, or the place of a driving scene among :data:`NAMES`.
        phase: of the animation of a driving scene, for repetitions; see :func:`scenes.driving.animations.load`.

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
        from scenes.formats.blocks.read import load_blocks

        return load_blocks(blur_scene_file(found))[0]
    return report.load(found) if found in report.IMAGES else effects.load(found)
