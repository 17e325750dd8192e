"""Prediction of future poses from known ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import torch
from jaxtyping import Float64
from torch import Tensor

from tsar.types import Viewpoint

STEADY = 0.5
"""Greatest change between successive steps of a motion, as a share of the step, up to which it is extrapolated."""


def predicted(known: Sequence[Viewpoint], time_s: float) -> Viewpoint:
    """The poses of a later time, by linear extrapolation of steady motions.

    Let ``T``, ``T'`` and ``T''`` be the newest pose and the two before it. The predicted pose is ``T + a (T - T')``,
    where ``a`` is the time to the prediction over the time between the newest two. The rotation and the translation of
    the camera and of each rigid motion are extrapolated separately, and only where they are steady: no entry of
    ``(T - T') - (T' - T'')`` is beyond half of the greatest of ``T - T'``. A motion that starts, stops or jumps keeps
    its last known pose.

    Args:
        known: poses at equal steps of time, the newest last; fewer than three are not extrapolated.
        time_s: time of the prediction, seconds.

    Returns:
        The newest view with the poses of ``time_s``. Matrices are extrapolated entry by entry, so they are rotations up
        to the square of the angle between views.
    """
    now = known[-1]
    if len(known) < 3 or not now.time_s > known[-2].time_s:
        return now
    ahead = (time_s - now.time_s) / (now.time_s - known[-2].time_s)
    tracks = [view.rotation.flatten(1) for view in known[-3:]]
    places = [view.translation for view in known[-3:]]
    camera = [view.to_camera.reshape(1, -1) for view in known[-3:]]
    offset = [view.to_camera_offset[None] for view in known[-3:]]
    return replace(
        now,
        time_s=time_s,
        rotation=_continued(tracks, ahead).reshape(now.rotation.shape),
        translation=_continued(places, ahead),
        to_camera=_continued(camera, ahead).reshape(3, 3),
        to_camera_offset=_continued(offset, ahead)[0],
    )


def mid_display_s(now_s: float, cycle_s: float, latency_cycles: int = 1) -> float:
    """The middle of the time for which a picture is displayed, seconds.

    A picture made in a cycle is displayed from ``latency_cycles`` after the cycle's start for one cycle. Poses of the
    middle are off by at most half a cycle's motion, those of either end by a whole one.

    Args:
        now_s: start of the cycle, seconds.
        cycle_s: its length, seconds.
        latency_cycles: cycles from the start of a cycle to the display of its picture.
    """
    return now_s + (latency_cycles + 0.5) * cycle_s


def foretold(view: Callable[[float], Viewpoint], now_s: float, cycle_s: float) -> Viewpoint:
    """The poses of the middle of the next cycle, :func:`predicted` from those of this one and of the two before.

    Args:
        view: gives the poses of a time.
        now_s: start of the cycle, seconds.
        cycle_s: its length, seconds.
    """
    return predicted([view(now_s - back * cycle_s) for back in (2, 1, 0)], mid_display_s(now_s, cycle_s))


def _continued(values: list[Float64[Tensor, "n entries"]], ahead: float) -> Float64[Tensor, "n entries"]:
    before, newest = values[1] - values[0], values[2] - values[1]
    steady = (newest - before).abs().amax(1, keepdim=True) <= STEADY * newest.abs().amax(1, keepdim=True)
    return torch.where(steady, values[2] + ahead * newest, values[2])
