"""Stills of a sequence on disk: finished stills of an interrupted rendering are kept, and foreign files are left alone.

Stills that the same command made of something else, such as another scene or with other settings, are replaced one by
one and removed when the new ones are there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from torch import Tensor

from analysis.command.progress import Task
from analysis.storage.store import Store
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
    """Renders the stills that are not on disk as they were made under this key.

    Args:
        picture: linear radiance ``(h, w, 3)`` of the still of a number, at a time.
        times_s: animation time of each still by its number, seconds.
        folder, ending: where stills go, and their format.
        key: hash of everything that decides a still but its number and time.
        task: of which a step is a still.
        write: writes a picture to a file, and says how many values were not finite.

    Returns:
        How many were rendered now, and how many values of all of them, whenever rendered, were not finite.

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
            with store.make(names[number]) as found:
                found.facts["nonfinite"] = write(found.path, picture(number, time_s))
            rendered += 1
        nonfinite += found.facts["nonfinite"]
        task.advance()
    store.discard_outdated("frame*")
    return rendered, nonfinite
