"""Losses of a conversion: parts that could not be kept, and their replacements."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from scenes.canonical import Scene, SceneError

SAME_PICTURE = frozenset(
    "path volpath volpath_simple bdpt bidirectional mlt pssmlt erpt metropolis photonmapper photonmap ppm sppm "
    "exphotonmap ptracer adaptive irrcache vpl distributedpath igi".split()
)
"""Integrators of files that compute the same picture; they differ only in convergence."""


HINTS = frozenset(
    "rrDepth rrstrategy rrcontinueprob rrthreshold eyerrthreshold lightrrthreshold lightsamplestrategy strategy "
    "lightpathstrategy lightstrategy shadowraycount strictNormals samplesPerPass directsamples indirectsamples "
    "usevariance largemutationprob maxconsecrejects scramble diagonal".split()
)
"""Parameters that affect how a renderer computes its picture, but not the picture."""


_LISTED = 10  # places of equal losses in the report of a conversion


@dataclass(frozen=True)
class Loss:
    """A part of a scene that the target format cannot represent.

    Attributes:
        where: file and line, or the name of the part of the scene.
        what: part that could not be kept.
        became: its replacement; ``left out`` if there is none.
        picture: whether the converged picture changes; otherwise the part was only a hint to the renderer.
    """

    where: str
    what: str
    became: str
    picture: bool = True

    def __str__(self) -> str:
        return f"{self.where}: {self.what}: {self.became}"


class LossReport:
    """Collects losses; equal losses at one place count once."""

    def __init__(self) -> None:
        self._losses: dict[Loss, None] = {}

    def add(self, where: str, what: str, became: str = "left out", picture: bool = True) -> None:
        """Adds a loss."""
        self._losses.setdefault(Loss(where, what, became, picture))

    def include(self, losses: Iterable[Loss]) -> None:
        """Adds losses of another report."""
        for loss in losses:
            self._losses.setdefault(loss)

    def hint(self, where: str, what: str, became: str = "left out") -> None:
        """Adds the loss of a hint to a renderer, which does not change the picture."""
        self.add(where, what, became, picture=False)

    def kind(self, table: Mapping[str, str], wanted: str, what: str, where: object, picture: bool = True) -> str:
        """The canonical kind for a file's kind; ``picture`` is whether the loss of a known one changes the picture.

        Several kinds in files may map to one canonical kind; all but the first of them are reported. An unknown kind
        becomes the first canonical kind and is reported.
        """
        if wanted not in table:
            found = next(iter(table.values()))
            self.unknown(where, what, wanted, found)
            return found
        found = table[wanted]
        if first_of(table)[found] != wanted:
            self.add(str(where), f"{what} {wanted!r}", found, picture)
        return found

    def unknown(self, where: object, what: str, wanted: str, became: str = "left out") -> None:
        """Reports an unknown kind and its replacement."""
        self.add(str(where), f"{what} {wanted!r}, which is not known", became)

    @property
    def losses(self) -> tuple[Loss, ...]:
        """All losses, in the order in which they were added."""
        return tuple(self._losses)

    def _alike(self) -> list[list[Loss]]:
        """Losses in the order of their kinds, equal ones at several places together."""
        kinds: dict[tuple[str, str, bool], list[Loss]] = {}
        for loss in self._losses:
            kinds.setdefault((loss.what, loss.became, loss.picture), []).append(loss)
        return list(kinds.values())

    def rows(self) -> list[dict[str, Any]]:
        """The losses as JSON objects: of equal losses the first ten places, the last of them with the number of all
        others, ``more``."""
        made: list[dict[str, Any]] = []
        for alike in self._alike():
            made += map(asdict, alike[:_LISTED])
            if len(alike) > _LISTED:
                made[-1]["more"] = len(alike) - _LISTED
        return made

    def lines(self) -> list[str]:
        """Lines of the losses that change the picture, then of the hints; equal losses at several places share a
        line."""
        made = []
        for picture, title in ((True, "changes the picture"), (False, "hints to the renderer, which it does not need")):
            kinds = [alike for alike in self._alike() if alike[0].picture == picture]
            made += [f"{title}:"] if kinds else []
            for first, *others in kinds:
                more = f" (and {len(others)} more)" if others else ""
                made.append(f"  {first.where}{more}: {first.what}: {first.became}")
        return made

    def text(self) -> str:
        """The losses, one per line."""
        return "\n".join(map(str, self._losses))

    def refuse_any(self) -> None:
        """Raises SceneError if there is a loss that changes the picture."""
        found = [loss for loss in self._losses if loss.picture]
        if found:
            rest = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
            raise SceneError(f"expected a conversion without losses, got {found[0]}{rest}")


def first_of(table: Mapping[str, str]) -> dict[str, str]:
    """For each canonical kind, the first kind of files that maps to it."""
    return {ours: theirs for theirs, ours in reversed(list(table.items()))}


def without_settings(scene: Scene, report: LossReport) -> None:
    """Reports what formats without settings of rendering leave out, and light that no surface or lamp sends."""
    where = scene.name or "scene"
    if scene.background is not None:
        report.add(where, "a background that lights nothing")
    if scene.ambient != (0.0, 0.0, 0.0):
        report.add(where, "constant ambient light")
    report.hint("integrator", scene.integrator.kind, "that of the renderer")
    report.hint("sampler", f"{scene.sampler.kind}, {scene.sampler.samples_per_pixel} samples a pixel")
    report.hint("film", f"{scene.film.width_px} x {scene.film.height_px} pixels", "their ratio")
    if scene.film.filter != "box":
        report.hint("film", f"a filter ({scene.film.filter})", "that of the renderer")
