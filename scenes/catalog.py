"""Built-in scenes by name."""

from __future__ import annotations

from scenes.canonical import Scene, SceneError
from scenes.driving import ANIMATIONS
from scenes.driving import load as load_driving

NAMES: tuple[str, ...] = tuple(ANIMATIONS)
"""Names of the built-in scenes; the driving inputs also go by their number."""


def load(name: str, phase: float = 0.0) -> Scene:
    """A built-in scene.

    Args:
        name: one of :data:`NAMES`, or its place among them.
        phase: of the animation, for repetitions; see :func:`scenes.driving.load`.

    Raises:
        SceneError: there is none of that name, or the phase is not in [0, 1).
    """
    found = NAMES[int(name)] if name.isdecimal() and int(name) < len(NAMES) else name
    if found not in NAMES:
        raise SceneError(f"scene: expected one of {', '.join(NAMES)} or 0 to {len(NAMES) - 1}, got {name!r}")
    if not 0.0 <= phase < 1.0:
        raise SceneError(f"phase: expected a fraction of a wheel's turn in [0, 1), got {phase}")
    return load_driving(found, phase)
