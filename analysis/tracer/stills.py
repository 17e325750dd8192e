"""Stills of a sequence on disk: finished stills of an interrupted rendering are kept, and foreign files are left alone.

Stills that the same command made of another scene or with other settings are replaced one by one. Those that remain
are removed once the new ones are complete.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from torch import Tensor

from analysis.command.progress import Task
from analysis.storage.store import Making, Store
from renderer.film.files import write_image
from renderer.film.sequence import still_path


def render_stills(
    picture: Callable[[int, float], Tensor],
    times_s: Mapping[int, float],
    folder: Path,
    ending: str,
    key: str,
    task: Task | None = None,
    write: Callable[[Path, Tensor], int] = write_image,
) -> tuple[int, int]:
    """Renders the stills that are not intact on disk under this key.

    Args:
        picture: function of a still's number and time that gives its linear radiance ``(h, w, 3)``.
        times_s: animation time of each still by its number, seconds.
        folder, ending: folder of the stills, and their format.
        key: hash of everything that decides a still except its number and time.
        task: progress, one step a still.
        write: writes a picture to a file, and returns the number of its non-finite values.

    Returns:
        The number of stills rendered now, and the number of non-finite values in all stills, whenever rendered.

    Raises:
        ValueError: a file of another origin lies where a still belongs.
        FilmError: a still cannot be written.
    """
    store, rendered, nonfinite = Store(folder, key), 0, 0
    names = {number: still_path(folder, number, ending).name for number in times_s}
    store.require_own(names.values())
    task = task or Task()
    for number, time_s in times_s.items():
        found = store.find(names[number])
        if found is None:
            found = render_still(store, names[number], partial(picture, number, time_s), write)
            rendered += 1
        nonfinite += found.facts["nonfinite"]
        task.advance()
    store.discard_outdated("frame*")
    return rendered, nonfinite


def render_still(
    store: Store, name: str, picture: Callable[[], Tensor], write: Callable[[Path, Tensor], int] = write_image
) -> Making:
    """Renders a still and lists it in a store; returns it with the number of its non-finite values."""
    with store.make(name) as made:
        made.facts["nonfinite"] = write(made.path, picture())
    return made
