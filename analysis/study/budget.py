"""Division of the error of a run at every reference time."""

from __future__ import annotations

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

from analysis.metrics.budget import budget
from analysis.metrics.quality import DisplayedImages
from analysis.study.sight import first_hits, places
from tsar.types import Trace, Viewpoint


class Budgeting:
    """A viewer that divides the error of one run. Changes in place.

    Surfaces that came into sight, and places where the light changed, are found between the time that an image shows
    and ``before_s`` earlier.

    Attributes:
        rows: a line for each reference time: the entries of :func:`analysis.metrics.budget.budget`, and ``late_s``, the
            age of the time that the image shows, seconds.
    """

    def __init__(
        self,
        name: str,
        side: int,
        trace: Trace,
        view: Callable[[float], Viewpoint],
        picture: Callable[[float], Float[Tensor, "side side 3"]],
        before_s: float,
    ) -> None:
        """Takes the sources of the truth.

        Args:
            name: name of the run.
            side: pixels along its picture's side.
            trace, view: give first hits, and poses at a time.
            picture: gives the truth at a time, linear.
            before_s: see the class.
        """
        self.rows: list[dict[str, float]] = []
        self._name, self._side, self._trace, self._view = name, side, trace, view
        self._picture, self._before_s = picture, before_s

    def __call__(self, view: DisplayedImages) -> None:
        display = view.shown[self._name][1]
        at_s = display.sample_time_s
        late = self._picture(at_s)
        carried = late if display.carried is None else display.carried(late)
        hits, earlier = (first_hits(self._trace, self._side, time_s) for time_s in (at_s, at_s - self._before_s))
        differing = places(hits, earlier, self._view(at_s - self._before_s))
        found = budget(display.image, carried, late, view.reference, differing)
        self.rows.append({**found, "late_s": view.time_s - at_s})


def averaged(image: Float[Tensor, "h h 3"], side: int) -> Float[Tensor, "side side 3"]:
    """A square picture with ``side`` pixels along its side, each the mean of the pixels that it covers."""
    factor = image.shape[0] // side
    if factor == 1:
        return image
    return torch.nn.functional.avg_pool2d(image.permute(2, 0, 1)[None], factor)[0].permute(1, 2, 0).contiguous()
