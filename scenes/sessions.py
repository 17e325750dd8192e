"""Sessions: recordings of a camera's drive through a scene and of the time of its animation, stored in files.

A session file can be used as a scene with that motion, so that the views of a session can be rendered again and
measured.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64
from numpy.typing import NDArray

from scenes.canonical import Scene, SceneError
from scenes.loading import one_line
from scenes.retiming import retimed

ENDING = ".session"
"""Ending of the names of session files."""
KIND = "tsar session 1"
"""Value of the field ``kind`` of such a file."""
KEYS_MOST = 1_000_000


@dataclass(frozen=True, eq=False)
class Session:
    """A camera's drive through a scene.

    Attributes:
        scene: name of the scene, or of its file.
        phase, camera_path: as for :func:`scenes.catalog.load_any`.
        interval_s: interval between keys, seconds; the first key is at 0.
        animation_s: the scene's own time at each key, seconds.
        translation, rotation: rigid motion of the camera at each key, which is applied outside its ``to_world``;
            quaternions ``(x, y, z, w)``.
        seen: options of the display during the session, by name, for information.
    """

    scene: str
    phase: float
    camera_path: str
    interval_s: float
    animation_s: Float64[NDArray, " keys"]
    translation: Float64[NDArray, "keys 3"]
    rotation: Float64[NDArray, "keys 4"]
    seen: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count = len(self.animation_s)
        if not 1 <= count <= KEYS_MOST:
            raise SceneError(f"session: expected 1 to {KEYS_MOST} keys, got {count}")
        shapes = self.animation_s.shape, self.translation.shape, self.rotation.shape
        if shapes != ((count,), (count, 3), (count, 4)):
            raise SceneError(f"session: expected animation_s (k,), translation (k, 3), rotation (k, 4), got {shapes}")
        if not (self.interval_s > 0.0 and np.isfinite(self.interval_s * count)):
            raise SceneError(f"session: interval_s: expected a positive time, got {self.interval_s}")
        if not np.isfinite(self.animation_s).all():
            raise SceneError("session: animation_s holds non-finite values")

    @property
    def seconds(self) -> float:
        """Time from the first key to the last, seconds."""
        return self.interval_s * (len(self.animation_s) - 1)

    def facts(self, scene: str = "") -> dict[str, Any]:
        """The content of its file; ``scene`` replaces the name of the scene, if given."""
        return {
            "kind": KIND,
            "scene": scene or self.scene,
            "phase": self.phase,
            "camera_path": self.camera_path,
            "interval_s": self.interval_s,
            "seen": dict(self.seen),
            "animation_s": self.animation_s.tolist(),
            "translation": self.translation.tolist(),
            "rotation": self.rotation.tolist(),
        }


def read_session(path: Path) -> Session:
    """A session from its file.

    Raises:
        SceneError: the file cannot be read; the message names it.
    """
    try:
        facts = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(facts, dict) or facts.get("kind") != KIND:
            raise SceneError(f"expected a session of the kind {KIND!r}")
        keys = (np.array(facts[name], np.float64) for name in ("animation_s", "translation", "rotation"))
        named = str(facts["scene"]), float(facts["phase"]), str(facts["camera_path"]), float(facts["interval_s"])
        return Session(*named, *keys, seen=dict(facts.get("seen", {})))
    except (OSError, ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        missing = f"expected a field {error}" if isinstance(error, KeyError) else one_line(error)
        raise SceneError(f"session {path}: cannot be read: {missing[:200]}") from error


def load_session(path: Path, **how: Any) -> tuple[Scene, tuple[str, ...]]:
    """The scene of a session with its recorded motion, and the losses of reading its file.

    Args:
        path: file of the session; the file of its scene is searched beside it.
        how: further arguments of :func:`scenes.catalog.load_any`.

    Raises:
        SceneError, ConfigError: the session or its scene cannot be read.
    """
    from scenes import catalog

    session = read_session(path)
    if Path(session.scene).suffix.lower() == ENDING:
        raise SceneError(f"session {path}: expected a scene, got another session, {session.scene}")
    file = session.scene not in catalog.SCENES and bool(Path(session.scene).suffix)
    named = path.parent / session.scene if file else session.scene
    scene, losses = catalog.load_any(named, session.phase, session.camera_path, **how)
    camera = session.translation, session.rotation
    try:
        return retimed(scene, session.interval_s, session.animation_s, camera), losses
    except SceneError as error:
        raise SceneError(f"session {path}: {error}") from error
