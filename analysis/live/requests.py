"""What a page of a live view can ask for: a table of handlers by name."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.live import camera as cameras
from analysis.live.engine import SIDES, Engine
from analysis.live.freeze import VIEWS, held
from analysis.live.options import Controls
from analysis.live.overlays import PLAIN
from scenes.sessions import ENDING
from tsar.checks import require

if TYPE_CHECKING:
    from analysis.live.hub import Hub

FASTEST = 16.0
"""Greatest speed of the animation, and of the camera in distances to what it looks at a second."""
OF_THESIS = ("spatial_slope", "temporal_slope", "bias", "solver")
"""Controls that a replay needs where they are not the defaults."""
LABEL_MOST = 100
"""Letters of the name of an overlay."""
Given = Mapping[str, Any]
"""Fields of a message."""


def turn(hub: Hub, given: Given) -> None:
    """Turns the camera, or takes it round what it looks at."""
    left, up = number_of(given, "left", 100.0), number_of(given, "up", 100.0)
    distance = hub.engine.distance if given.get("orbit") else 0.0
    hub.engine.timeline.change(lambda drive: cameras.turned(drive, left, up, distance))


def step(hub: Hub, given: Given) -> None:
    """Moves the camera ahead at once."""
    ahead = number_of(given, "ahead", 100.0) * hub.engine.distance
    hub.engine.timeline.change(lambda drive: cameras.moved(drive, (0.0, 0.0, ahead)))


def go(hub: Hub, given: Given) -> None:
    """Sets the velocity of the camera."""
    x, y, z = (number_of(given, name, FASTEST) * hub.engine.distance for name in ("right", "up", "ahead"))
    turning = number_of(given, "turn_left", 10.0), number_of(given, "turn_up", 10.0)
    hub.engine.timeline.change(lambda drive: replace(drive, velocity=(x, y, z), turning=turning))


def change(hub: Hub, given: Given) -> None:
    """Changes a control."""
    hub.engine.change(given["name"], given["value"])


def overlay(hub: Hub, given: Given) -> None:
    """Chooses what lies over a side."""
    side, label = given["side"], given["label"]
    require(side in SIDES, "side", " or ".join(SIDES), side)
    require(isinstance(label, str) and len(label) <= LABEL_MOST, "label", f"at most {LABEL_MOST} letters", label)
    hub.display.overlay[side] = label


def strength(hub: Hub, given: Given) -> None:
    """Sets the strength of overlays."""
    hub.display.strength = min(max(number_of(given, "value", 1.0), 0.0), 1.0)


def playing(hub: Hub, given: Given) -> None:
    """Stops the animation, or plays it."""
    hub.engine.timeline.animation.playing = bool(given["value"])


def repeats(hub: Hub, given: Given) -> None:
    """Sets whether the animation begins again."""
    hub.engine.timeline.animation.repeats = bool(given["value"])


def speed(hub: Hub, given: Given) -> None:
    """Sets the speed of the animation."""
    hub.engine.timeline.animation.speed = abs(number_of(given, "value", FASTEST))


def scrub(hub: Hub, given: Given) -> None:
    """Takes the animation to a time."""
    hub.engine.timeline.scrub(number_of(given, "at_s", 1e9))


def ride(hub: Hub, given: Given) -> None:
    """Sets whether the camera rides with the scene's own."""
    hub.engine.timeline.ride(bool(given["value"]))


def reset(hub: Hub, given: Given) -> None:
    """Puts the camera back."""
    hub.engine.timeline.reset()


def record(hub: Hub, given: Given) -> None:
    """Keeps what happens from now on."""
    hub.engine.record()


def save(hub: Hub, given: Given) -> str:
    """Writes the session under a name that is free."""
    engine, folder, number = hub.engine, hub.engine.options.out, 1
    while (path := folder / f"drive-{number}{ENDING}").exists():
        number += 1
    seconds = engine.save(path)
    return f"{seconds:.1f} s written to {path}; replay: {replay(engine, path, seconds)}"


def freeze(hub: Hub, given: Given) -> None:
    """Holds the moment; where that fails the view goes on."""
    try:
        hub.frozen = hub.frozen or held(hub.engine)
    except Exception:
        hub.engine.wake()
        raise


def go_on(hub: Hub, given: Given) -> None:
    """Lets the view go on."""
    hub.frozen = None
    hub.display.overlay = {side: PLAIN if label in VIEWS else label for side, label in hub.display.overlay.items()}
    hub.engine.wake()


REQUESTS: Mapping[str, Callable[[Hub, Given], str | None]] = {
    "set": change,
    **{
        one.__name__: one
        for one in (
            turn, step, go, overlay, strength, playing, repeats, speed, scrub, ride, reset, record, save, freeze, go_on
        )
    },
}  # fmt: skip
"""Handlers by the name that a page sends; each returns what the page is told of it."""


def replay(engine: Engine, path: Path, seconds: float) -> str:
    """The command that measures a session as it was seen."""
    c = engine.controls
    named = f"--policy {c.sides[-1]}" + (f" --rivals {c.sides[0]}" if len(c.sides) > 1 else "") if c.sides else ""
    changed = [
        f"--{name.replace('_', '-')} {getattr(c, name)}"
        for name in OF_THESIS
        if getattr(c, name) != getattr(Controls, name)
    ]
    rest = " ".join([f"--batch-size {c.batch_size} --resolution-px {c.resolution_px}", *changed])
    return f"python scripts/run.py {shlex.quote(str(path))} --seconds {max(seconds - 0.05, 0.05):.2f} {named} {rest}"


def standing(drive: cameras.Drive) -> cameras.Drive:
    """The drive without its velocity."""
    return replace(drive, velocity=(0.0, 0.0, 0.0), turning=(0.0, 0.0))


def number_of(given: Given, name: str, most: float) -> float:
    """A number of a message, 0 where it is not there.

    Raises:
        ConfigError: it is no number, or its magnitude exceeds ``most``.
    """
    value = given.get(name, 0.0)
    fits = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= most
    require(fits, name, f"a number of at most {most:g}", value)
    return float(value)
