"""Job files of the motion-blur perception thesis: the sampling methods with which a sequence is rendered.

A file has seven lines: a name; the number of sampling levels, and these; the number of point sets, and these; the
number of time filters, and these.

A point set's name may end in ``+blue``: pixels then shift it by spatiotemporal blue noise.

Source: motion-blur perception thesis, chapter 3, fig. 12.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from scenes.arithmetic import power
from scenes.canonical import SceneError
from scenes.formats.blocks.settings import POINT_SET_NAMES, TIME_FILTERS

BLUE = "+blue"

_LINES = ("a name", "how many sampling levels", "the sampling levels", "how many point sets", "the point sets",
          "how many time filters", "the time filters")  # fmt: skip


@dataclass(frozen=True)
class Combination:
    """One sampling method of a sequence."""

    samples: int
    point_set: str
    time_filter: str

    @property
    def points(self) -> str:
        """The point set without its shift."""
        return self.point_set.removesuffix(BLUE)

    @property
    def shift(self) -> str:
        """Shift of the point set in pixels: ``white`` or ``blue``."""
        return "blue" if self.point_set.endswith(BLUE) else "white"

    @property
    def name(self) -> str:
        """Name of the combination for folders and tables."""
        return f"{self.point_set}-{self.time_filter}-{self.samples:04d}"


@dataclass(frozen=True)
class Job:
    """A job: all combinations of levels, point sets and time filters."""

    name: str
    levels: tuple[int, ...]
    point_sets: tuple[str, ...]
    time_filters: tuple[str, ...]

    @property
    def combinations(self) -> tuple[Combination, ...]:
        """All combinations, in order of increasing level."""
        return tuple(
            Combination(level, points, time)
            for level, points, time in product(sorted(self.levels), self.point_sets, self.time_filters)
        )


def read_job(path: Path) -> Job:
    """Reads a job file; empty lines and comments after ``#`` are ignored.

    Raises:
        SceneError: the file is missing, or a line is invalid; the message gives file and line, the expected and the
            actual value.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: expected UTF-8 text, byte {error.start} is invalid") from None
    numbered = [(number, line.split("#")[0].split()) for number, line in enumerate(text.splitlines(), 1)]
    lines = [(number, words) for number, words in numbered if words]
    if len(lines) != len(_LINES):
        after = f"{path}:{lines[-1][0] if lines else 1}"
        raise SceneError(f"{after}: expected seven lines ({', '.join(_LINES)}), got {len(lines)}")
    levels = [_whole(word, f"{path}:{lines[2][0]}: sampling level") for word in _counted(path, lines, 1)]
    point_sets = [_point_set(word, f"{path}:{lines[4][0]}: point set") for word in _counted(path, lines, 3)]
    filters = [_one_of(word, {name: name for name in TIME_FILTERS}, f"{path}:{lines[6][0]}: time filter")
               for word in _counted(path, lines, 5)]  # fmt: skip
    job = Job(" ".join(lines[0][1]), tuple(levels), tuple(point_sets), tuple(filters))
    if any(combination.points == "stratified" for combination in job.combinations):
        for level in job.levels:
            if math.prod((round(power(level, 1.0 / 3.0)),) * 3) != level:
                raise SceneError(f"{path}:{lines[2][0]}: sampling level: expected cubes for stratifiedmc, got {level}")
    return job


def _counted(path: Path, lines: list[tuple[int, list[str]]], at: int) -> list[str]:
    """The words of a line, whose number the line before it gives."""
    (number, words), (next_number, values) = lines[at : at + 2]
    count = _whole(words[0] if len(words) == 1 else " ".join(words), f"{path}:{number}: {_LINES[at]}")
    if len(values) != count:
        raise SceneError(f"{path}:{next_number}: {_LINES[at + 1]}: expected {count}, got {len(values)}")
    if len(set(values)) != count:
        raise SceneError(f"{path}:{next_number}: {_LINES[at + 1]}: expected each once, got {' '.join(values)}")
    return values


def _whole(word: str, what: str) -> int:
    if not word.isdecimal() or int(word) < 1:
        raise SceneError(f"{what}: expected a whole number of at least 1, got {word!r}")
    return int(word)


def _point_set(word: str, what: str) -> str:
    name = word.removesuffix(BLUE)
    return _one_of(name, POINT_SET_NAMES, what) + word[len(name) :]


def _one_of(word: str, known: dict[str, str], what: str) -> str:
    if word not in known:
        raise SceneError(f"{what}: expected one of {', '.join(known)}, got {word!r}")
    return known[word]
