"""Scenes by name: the project's own, those of installed packages, those added from Python, and scene files.

A package provides scenes through entry points of the group ``tsar.scenes``; ``SCENES.add(name, make)`` adds one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from scenes.canonical import PerspectiveCamera, Scene, SceneError
from scenes.driving import animations
from scenes.effects import report_images as report
from scenes.effects import scenes as effects
from scenes.loading import asset
from scenes.sessions import ENDING as SESSION_ENDING
from tsar.named import Named

if TYPE_CHECKING:
    from scenes.viewing import Up

IntegratorName = Literal["whitted", "path"]
"""Integrator of a scene: direct light, mirrors and glass; or path tracing with light between all surfaces."""

MakeScene = Callable[[float], Scene]
"""Creates a scene from its phase, a fraction in [0, 1) by which a repetition of an animation is shifted."""

NAMES: tuple[str, ...] = tuple(animations.ANIMATIONS)
"""Names of the driving scenes, the inputs of experiments; their indices are accepted as names too."""

BLUR_SCENES = {"planescene": "plane/planescene.txt", "spheresscene": "spheres/spheresscene.txt"}
"""The two scenes of the motion-blur perception study, and their files among the assets."""


def blur_scene_file(name: str) -> Path:
    """The block file of a scene of that study."""
    return asset(BLUR_SCENES[name])


def _blurred(name: str) -> Scene:
    from scenes.formats.blocks.read import load_blocks

    return load_blocks(blur_scene_file(name))[0]


def _driving(name: str) -> MakeScene:
    return lambda phase: animations.load(name, phase)


def _without_phases(name: str, load: Callable[[str], Scene]) -> MakeScene:
    def make(phase: float) -> Scene:
        if phase != 0.0:
            raise SceneError(f"phase: expected 0 for the scene {name}, which has no phases, got {phase}")
        return load(name)

    return make


SCENES: Named[MakeScene] = Named(
    "scene",
    "tsar.scenes",
    {
        **{name: _driving(name) for name in (*NAMES, animations.CUTS, animations.STILL)},
        **{name: _without_phases(name, _blurred) for name in BLUR_SCENES},
        **{name: _without_phases(name, effects.load) for name in effects.EFFECTS},
        **{name: _without_phases(name, report.load) for name in report.IMAGES},
    },
)


def load(scene: str | Scene, phase: float = 0.0) -> Scene:
    """A scene by its name, or the scene itself.

    Args:
        scene: a name in :data:`SCENES`, the number of a driving scene in :data:`NAMES`, or a scene.
        phase: fraction of a wheel's turn by which the car of a driving scene is ahead, in [0, 1); it distinguishes
            repetitions. Other scenes accept only 0.

    Raises:
        ConfigError: no scene has this name; the message lists the known names and the nearest of them.
        SceneError: the scene does not have this phase.
    """
    if not 0.0 <= phase < 1.0:
        raise SceneError(f"phase: expected a fraction of a wheel's turn in [0, 1), got {phase}")
    if isinstance(scene, Scene):
        return _without_phases(scene.name or "given", lambda name: scene)(phase)
    numbered = scene.isdecimal() and int(scene) < len(NAMES)
    return SCENES[NAMES[int(scene)] if numbered else scene](phase)


def require_known(scene: str) -> None:
    """Rejects what is neither the name or number of a scene nor a file that is there, without loading anything.

    Raises:
        ConfigError: the name is rejected; the message lists the known names and the nearest of them.
        SceneError: it has the ending of a file, and there is none.
    """
    if scene in SCENES or (scene.isdecimal() and int(scene) < len(NAMES)):
        return
    if not Path(scene).suffix:
        SCENES.require(scene, "scene")
    if not Path(scene).is_file():
        raise SceneError(f"{scene}: expected a scene file or a model, found none")


def load_file(
    name: str,
    camera_path: str = "",
    integrator: IntegratorName = "whitted",
    up: Up | None = None,
    camera: str = "",
    pose_s: float = 0.0,
) -> tuple[Scene, tuple[str, ...]]:
    """The scene of a file, converted to what this project's renderer supports, and the losses.

    Args:
        name: name of the file, whose ending determines the format.
        camera_path: ``turntable`` or ``fly-through`` to move the camera of a static file; empty for none.
        integrator: integrator for the scene; path tracing supports more materials.
        up: upward axis of a model, in place of that of its file.
        camera: name of a camera of a model; the first one if empty.
        pose_s: as in :class:`Look`.

    Raises:
        SceneError: the file cannot be read, or has no camera of this name.
    """
    from scenes.camera_paths import on_a_path
    from scenes.formats.conversion import load_scene_file
    from scenes.formats.drawable import drawable
    from scenes.formats.losses import LossReport
    from scenes.models import MODEL_ENDINGS
    from scenes.models.scenes_of_models import model_scene

    losses = LossReport()
    if Path(name).suffix.lower() in MODEL_ENDINGS:
        found = model_scene(Path(name), losses, up, integrator == "path", camera, pose_s)
    elif camera:
        raise SceneError(f"camera: expected six numbers, since {name} has no cameras by name, got {camera!r}")
    else:
        found = load_scene_file(Path(name), None, losses)
    scene = drawable(found, losses, integrator)
    if camera_path:
        scene = on_a_path(scene, camera_path)  # type: ignore[arg-type]
    return scene, tuple(str(loss) for loss in losses.losses)


@dataclass(frozen=True)
class Look:
    """Changes of the view and the lighting of a scene.

    Attributes:
        up: upward axis of the world; None for that of a model's file, or the one nearer to the camera's.
        smooth_deg: greatest angle between faces, degrees, at which edges of meshes without normals are smooth.
        camera: eye and target of a static camera, six numbers; or the name of a camera of a model.
        fov_deg: full angle of the camera along the shorter image axis; None for that of the scene.
        environment: environment map that lights the scene, see :func:`scenes.viewing.with_environment`.
        integrator: integrator for the scene.
        bounces: greatest number of bounces; None for that of the scene.
        lens_radius: radius of the aperture, scene units; None for that of the scene.
        focal_distance: distance to the plane in focus, scene units; None for that of ``camera``'s target if
            ``lens_radius`` is given, else for that of the scene.
        camera_keys: file with keys of a moving camera (:mod:`scenes.camera_keys`).
        pose_s: time since the start of the animation of a model at which parts are shown that do not move rigidly, such
            as skins and morph targets, seconds.
    """

    up: Up | None = None
    smooth_deg: float = 0.0
    camera: tuple[float, ...] | str | None = None
    fov_deg: float | None = None
    environment: Path | None = None
    integrator: IntegratorName = "whitted"
    bounces: int | None = None
    lens_radius: float | None = None
    focal_distance: float | None = None
    camera_keys: Path | None = None
    pose_s: float = 0.0


def load_seen(
    scene: str | Path | Scene, look: Look, phase: float = 0.0, camera_path: str = ""
) -> tuple[Scene, tuple[str, ...]]:
    """A scene as :func:`load_any` loads it, with changes of its view and lighting.

    Raises:
        SceneError: as :func:`load_any`; or the environment map or the keys of the camera cannot be read, eye and target
            of the camera coincide, or the camera is given twice or does not support what is asked of it.
    """
    from scenes.camera_keys import with_keys_of
    from scenes.camera_paths import on_a_path
    from scenes.loading import read_image
    from scenes.models import MODEL_ENDINGS
    from scenes.models.scenes_of_models import model_up
    from scenes.models.smoothing import smoothed
    from scenes.viewing import up_of, with_camera, with_environment, with_lens

    moved = [name for name in ("camera", "camera_keys") if getattr(look, name) is not None]
    if look.camera_keys is not None and (camera_path or len(moved) > 1):
        raise SceneError("camera_keys: expected neither a camera nor a camera_path beside them")
    ending = "" if isinstance(scene, Scene) or str(scene) in SCENES else Path(scene).suffix.lower()
    later = camera_path if ending not in ("", SESSION_ENDING) and look != Look() else ""
    name, place = (look.camera, None) if isinstance(look.camera, str) else ("", look.camera)
    if ending in MODEL_ENDINGS:
        path = "" if later else camera_path
        found, losses = load_file(str(scene), path, look.integrator, look.up, name, look.pose_s)
    elif name:
        raise SceneError(f"camera: expected six numbers, since only models have cameras by name, got {name!r}")
    else:
        found, losses = load_any(scene, phase, "" if later else camera_path, look.integrator)
    if look.bounces is not None:
        found = dataclasses.replace(found, integrator=dataclasses.replace(found.integrator, depth=look.bounces))
    if look.smooth_deg > 0.0:
        found = dataclasses.replace(found, instances=smoothed(found.instances, look.smooth_deg))
    up = look.up
    if up is None:
        up = model_up(Path(str(scene)), look.integrator == "path") if ending in MODEL_ENDINGS else up_of(found)
    if look.environment is not None:
        found = with_environment(found, read_image(look.environment), up, str(look.environment))
    if place is not None:
        found = with_camera(found, place[:3], place[3:], up, look.fov_deg)
    elif look.camera_keys is not None:
        found = with_keys_of(found, look.camera_keys, up, look.fov_deg)
    elif look.fov_deg is not None:
        if not isinstance(found.camera, PerspectiveCamera):
            raise SceneError(f"fov_deg: expected a perspective camera, got {type(found.camera).__name__}")
        found = dataclasses.replace(found, camera=dataclasses.replace(found.camera, fov_deg=look.fov_deg))
    if look.lens_radius is not None or look.focal_distance is not None:
        found = with_lens(found, look.lens_radius, look.focal_distance, place)
    return (on_a_path(found, later) if later else found), losses  # type: ignore[arg-type]


def poses_of(
    scene: str | Path, look: Look, phase: float, camera_path: str, loaded: Scene
) -> Callable[[float], Scene] | None:
    """The scene as at a time in seconds, where parts of a model do not move rigidly; None where all do.

    Args:
        scene, look, phase, camera_path: as of :func:`load_seen`.
        loaded: what it loaded.
    """
    from scenes.models.scenes_of_models import is_posed

    if str(scene) in SCENES or not is_posed(scene, look.integrator == "path"):
        return None

    def at(time_s: float) -> Scene:
        found, _ = load_seen(scene, dataclasses.replace(look, pose_s=time_s), phase, camera_path)
        return dataclasses.replace(found, camera=loaded.camera) if camera_path else found

    return at


def load_any(
    scene: str | Path | Scene, phase: float = 0.0, camera_path: str = "", integrator: IntegratorName = "whitted"
) -> tuple[Scene, tuple[str, ...]]:
    """A scene by its name, that of a file, or the scene itself; and the losses.

    Args:
        scene: as in :func:`load`, or a file whose name has an ending; a session file stands for its scene as it was
            driven through (:mod:`scenes.sessions`).
        phase: as in :func:`load`; files have none.
        camera_path: as in :func:`load_file`, for files only.
        integrator: as in :func:`load_file`; a given scene keeps its own unless path tracing is requested.

    Raises:
        ConfigError: no scene has this name.
        SceneError: the file cannot be read, or the scene does not have the phase or does not support a camera path.
    """
    if not isinstance(scene, Scene) and str(scene) not in SCENES and Path(scene).suffix.lower() == SESSION_ENDING:
        from scenes.sessions import load_session

        if phase or camera_path:
            raise SceneError(f"{scene}: expected no phase and no camera_path of a session, which has its own")
        return load_session(Path(scene), integrator=integrator)
    if not isinstance(scene, Scene) and str(scene) not in SCENES and Path(scene).suffix:
        return load_file(str(scene), camera_path, integrator)
    if camera_path:
        what = "a scene that is given" if isinstance(scene, Scene) else "a built-in scene"
        raise SceneError(f"camera_path: expected none for {what}, got {camera_path}")
    found = load(scene if isinstance(scene, Scene) else str(scene), phase)
    if integrator == "path":
        found = dataclasses.replace(found, integrator=dataclasses.replace(found.integrator, kind="path"))
    return found, ()
