"""The live view without its page: a scene that is driven through, and the runs that are seen."""

from __future__ import annotations

import dataclasses
import math
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.live.options import NOTHING, Controls, LiveOptions
from analysis.live.runner import DisplayState, Runner, SessionTime
from analysis.live.timeline import Timeline
from analysis.live.turns import Turns
from analysis.storage.files import write_json
from analysis.study.runs import made
from scenes import catalog
from scenes.animation import pose_at
from scenes.arithmetic import norm, product
from scenes.camera_paths import looked_at_distance
from scenes.canonical import Scene
from scenes.sessions import ENDING, read_session
from tsar.config import require

if TYPE_CHECKING:
    from renderer.trace import Renderer
    from tsar.policy import Policy
    from tsar.types import FrameletBatch, SampleBatch, Trace, Viewpoint

SIDES = ("left", "right")


@dataclass(frozen=True)
class _Sharpened:
    """The one renderer, filtering textures for other pictures than its own."""

    renderer: Renderer
    footprint_px: float

    @property
    def random(self) -> bool:
        return self.renderer.random

    def trace(self, batch: FrameletBatch, aspect: float = 1.0) -> SampleBatch:
        return self.renderer.trace(batch, aspect, self.footprint_px)

    def viewpoint(self, time_s: float, aspect: float = 1.0) -> Viewpoint:
        return self.renderer.viewpoint(time_s, aspect)


@dataclass(frozen=True)
class LiveView:
    """What is seen at one time.

    Attributes:
        time_s: of the live view, seconds.
        sides: what stands on the displays, by side; None before a first picture.
        runs: the run of each side; None where there is none.
    """

    time_s: float
    sides: dict[str, DisplayState | None]
    runs: dict[str, Runner | None]


class Engine:
    """A scene that is driven through. Changes in place; calls from several threads take turns.

    It stands until :meth:`wake` is called.

    Attributes:
        options: it was begun with.
        scene: as it was loaded.
        controls: what is seen now.
        timeline: the camera and the animation.
        losses: what was lost in reading the scene's file, a line each.
        distance: to what the scene's camera looks at, scene units.
    """

    def __init__(
        self, options: LiveOptions, scene: Scene | None = None, now: Callable[[], float] = time.perf_counter
    ) -> None:
        """Loads the scene and builds its renderer.

        Args:
            options: what to show.
            scene: in place of the options' input.
            now: a clock, seconds.

        Raises:
            ValueError: the scene cannot be had, or its camera cannot be driven.
        """
        from renderer.motion import Motion
        from renderer.stages.control import expect_stages
        from renderer.trace import Renderer

        self.options, self.controls = options, options.controls
        given = options.input if scene is None else scene
        self.scene, self.losses = catalog.load_any(given, options.phase, options.camera_path)
        self.timeline = Timeline(self.scene)
        expect_stages("compiled")
        side = float(options.controls.resolution_px)
        self._renderer = Renderer(self.timeline.scene, "cpu", options.threads or None, side)
        self._motion = Motion(self._renderer, self.timeline.scene)
        self._turns, self._time = Turns(now), SessionTime(now)
        self._lock = threading.RLock()
        self._runners: dict[tuple[Any, ...], Runner] = {}
        self._halted, self._begin = False, 0
        self.distance = _distance(self.scene)
        self._halt()
        self._assign()

    @property
    def now_s(self) -> float:
        """Time of the live view, seconds."""
        return self._time.now()

    @property
    def stands(self) -> bool:
        """Whether nothing goes on."""
        return self._halted

    def wake(self) -> None:
        """Goes on."""
        with self._lock:
            if self._halted:
                self._halted = False
                self._time.go()
                self._turns.go_on()

    def rest(self) -> None:
        """Stands, until it is woken: the time of the live view, too."""
        with self._lock:
            self._halt()

    def _halt(self) -> None:
        if not self._halted:
            self._halted = True
            self._turns.halt()
            self._time.stop()

    def change(self, name: str, value: Any) -> None:
        """Sets one of the controls; runs that it concerns begin anew.

        Raises:
            ConfigError: there is no such control, or it cannot have the value. Nothing changes then.
        """
        with self._lock:
            self.controls = self.controls.changed(name, value)
            self._assign()

    def look(self) -> LiveView:
        """What is seen now."""
        with self._lock:
            now_s = self.now_s
            runs = {side: self._run_of(getattr(self.controls, side)) for side in SIDES}
            return LiveView(now_s, {side: run and run.at(now_s) for side, run in runs.items()}, runs)

    def truth(self) -> Any:
        """The picture as it should be at this moment, linear RGB ``(height, width, 3)``; the engine must stand."""
        require(self.stands, "truth", "a live view that stands", "one that goes on")
        height, width = self.controls.config().shape
        self._refresh()
        return self._renderer.render_frame(self.now_s, width, height, self.options.reference_samples_per_axis)

    def record(self) -> None:
        """Keeps what happens from now on."""
        self._begin, self.timeline.recording = self.timeline.count - 1, True

    @property
    def recording(self) -> bool:
        """Whether what happens is kept for a session."""
        return self.timeline.recording

    @property
    def recorded_s(self) -> float:
        """Seconds that would be saved now."""
        return self.timeline.seconds(self._begin if self.recording else 0)

    def save(self, path: Path) -> float:
        """Writes what happened since :meth:`record`, or else since the beginning, to a session file.

        Args:
            path: of the file; a scene's file is named relative to its folder.

        Returns:
            Its seconds.

        Raises:
            OSError: it cannot be written.
            ConfigError: nothing has happened yet.
        """
        options, seen = self.options, dataclasses.asdict(self.controls)
        base, folder = None, Path()
        facts = {"scene": options.input, "phase": options.phase, "camera_path": options.camera_path}
        if Path(options.input).suffix.lower() == ENDING and options.input not in catalog.SCENES:
            base, folder = read_session(Path(options.input)), Path(options.input).parent
            facts = {"scene": base.scene, "phase": base.phase, "camera_path": base.camera_path}
        if facts["scene"] not in catalog.SCENES and Path(facts["scene"]).suffix:
            file = (folder / facts["scene"]).resolve()
            facts["scene"] = _from(path.resolve().parent, file)
        session = self.timeline.session(self._begin if self.recording else 0, seen=seen, **facts)
        if base is not None:  # what its scene's time was at this session's
            times_s = base.interval_s * np.arange(len(base.animation_s))
            session = dataclasses.replace(
                session, animation_s=np.interp(session.animation_s, times_s, base.animation_s)
            )
        require(session.seconds > 0.0, "session", "one of more than a moment", session.seconds)
        write_json(path, session.facts())
        self.timeline.recording = False
        return session.seconds

    def close(self) -> None:
        """Ends all runs."""
        with self._lock:
            for runner in self._runners.values():
                runner.end()
            self.wake()
            for runner in self._runners.values():
                runner.end(wait=True)
            self._runners.clear()

    def _run_of(self, name: str) -> Runner | None:
        return None if name == NOTHING else self._runners.get(self._key(name))

    def _key(self, name: str) -> tuple[Any, ...]:
        """What a run must begin anew for."""
        c = self.controls
        return name, c.config(self.options.seed), c.latency_cycles

    def _assign(self) -> None:
        """Begins the runs that the controls ask for, and ends others."""
        wanted = {self._key(name): name for name in self.controls.sides}
        for key in self._runners.keys() - wanted.keys():
            self._runners.pop(key).end()
        for key, name in wanted.items():
            if key not in self._runners:
                latency = self.controls.latency_cycles
                make = partial(self._made, name, self.controls, latency)
                self._runners[key] = Runner(name, make, self._turns, self._time, self._refresh, latency)

    def _made(self, name: str, controls: Controls, latency: int) -> tuple[Policy[Any], Trace]:
        config = controls.config(self.options.seed)
        parts = {"latency_cycles": latency} if latency and name == "tsar" else None

        def renderer_of(axis: float) -> _Sharpened:
            return _Sharpened(self._renderer, min(config.shape) * axis)

        return made(name, config, renderer_of, threads=self._renderer.threads, parts=parts)

    def _refresh(self) -> None:
        """Brings the keys that the renderer sees up to now."""
        if self.timeline.advance(self.now_s):
            self._motion.replace(*self.timeline.keys())


def _distance(scene: Scene) -> float:
    """To what the camera looks at, at the start of the animation."""
    track = getattr(scene.camera, "track", None)
    pose = product(np.eye(4) if track is None else pose_at(track, 0.0), scene.camera.to_world)
    back = pose[:3, 2] / norm(pose[:3, 2])
    found = looked_at_distance(scene, pose[:3, 3], -back)
    return found if math.isfinite(found) and found > 0.0 else 1.0


def _from(folder: Path, file: Path) -> str:
    """The path of a file from a folder, with forward slashes; its whole path if it lies on another drive of Windows."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:
        return file.as_posix()
