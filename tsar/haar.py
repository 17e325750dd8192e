"""Streaming Haar wavelet transform of square tiles in Morton order. Knows nothing of rendering.

Normalisation: ``h = (a + b) / 2`` and ``g = a - b`` along every axis, so approximations keep the signal's scale and a
detail coefficient is the plain difference of two means. The coefficients of an orthonormal Haar step are these times
``sqrt 2`` for every ``h`` and ``1 / sqrt 2`` for every ``g`` in their names.

Octants are named in the order x, y, t: ``hgh`` is low in x, high in y, low in time.

Time is dyadic, as space is: octave ``o`` pairs fields that are ``2^o`` updates apart and so spans ``2^(o + 1)`` updates
(fig. 5.9). At the leading edge an octave is evaluated at every update, not only at every ``2^o``-th; for that it keeps
its last ``2^o`` fields.

Deviation: sec. 5.3.1.3 keeps one field per octave, which would be correct only if an octave were evaluated when both of
its fields are complete.

Source: Stephens 2011, sec. 5.3.4, eq. 5.15–5.16, fig. 5.9 and 5.15.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor


@dataclass(frozen=True)
class Octave:
    """Detail octants of one octave, each ``(n, positions)`` in Morton order.

    Attributes:
        known: whether the tile has had enough updates for the octave's temporal octants; before that they are exactly
            zero.
    """

    ghh: Float[Tensor, "n p"]
    hgh: Float[Tensor, "n p"]
    ggh: Float[Tensor, "n p"]
    hhg: Float[Tensor, "n p"]
    ghg: Float[Tensor, "n p"]
    hgg: Float[Tensor, "n p"]
    ggg: Float[Tensor, "n p"]
    known: Bool[Tensor, " n"]


def octave_count(samples: int) -> int:
    """Number of octaves until one coefficient remains: 4 for a 16 x 16 tile."""
    return (samples.bit_length() - 1) // 2


def state_size(samples: int) -> int:
    """Count of the numbers kept per tile between updates (481 for 16 x 16): the last ``2^o`` fields of octave ``o``,
    newest first, octaves from fine to coarse, and the number of updates."""
    return sum(samples >> o for o in range(octave_count(samples))) + 1


def updates_needed(octave: int) -> int:
    """Number of earlier updates of a tile that an octave needs for its temporal octants: ``2^(o + 1) - 1``."""
    return (2 << octave) - 1


def spatial_step(field: Float[Tensor, "n samples"]) -> Float[Tensor, "n samples"]:
    """Both spatial convolutions of one octave on 2 x 2 Morton neighbourhoods.

    Returns the four quadrants ``hh, hg, gh, gg`` one after the other, each in Morton order, so that the next octave
    reads the first quarter. Source: Stephens 2011, fig. 5.15 (interleaved, then uninterleaved packing).
    """
    a, b, c, d = field.reshape(field.shape[0], -1, 4).unbind(-1)
    h_upper, h_lower = (a + b) / 2, (c + d) / 2
    g_upper, g_lower = a - b, c - d
    return torch.cat(((h_upper + h_lower) / 2, h_upper - h_lower, (g_upper + g_lower) / 2, g_upper - g_lower), dim=1)


def temporal_step(
    now: Float[Tensor, "n m"], before: Float[Tensor, "n m"]
) -> tuple[Float[Tensor, "n m"], Float[Tensor, "n m"]]:
    """Low and high pass along time: ``((now + before) / 2, now - before)``."""
    return (now + before) / 2, now - before


def transform(
    signal: Float[Tensor, "n samples"], state: Float[Tensor, "n state"], has_state: Bool[Tensor, " n"]
) -> tuple[list[Octave], Float[Tensor, "n state"]]:
    """One update at the leading edge of time.

    Args:
        signal: new tiles, a power of four values each, Morton order.
        state: what the previous update of the same tile returned; ignored where ``has_state`` is false.
        has_state: false for tiles without a past.

    Returns:
        Octaves from fine to coarse, and the state for the tile's next update.

    Source: Stephens 2011, sec. 5.3.4 and fig. 5.9.
    """
    state = torch.where(has_state[:, None], state, 0.0)
    updates, octaves, kept, first = state[:, -1], [], [], 0
    approximation, count = signal, octave_count(signal.shape[1])
    for number in range(count):
        now = spatial_step(approximation)
        width, lag = now.shape[1], 1 << number
        fields = state[:, first : first + lag * width]
        known = updates >= updates_needed(number)
        before = torch.where(known[:, None], fields[:, -width:], now)
        low, high = temporal_step(now, before)
        hhh, hgh, ghh, ggh = low.chunk(4, dim=1)
        hhg, hgg, ghg, ggg = high.chunk(4, dim=1)
        octaves.append(Octave(ghh, hgh, ggh, hhg, ghg, hgg, ggg, known))
        kept += [now, fields[:, :-width]]
        approximation, first = hhh, first + lag * width
    # the count stops once the coarsest octave is known
    kept.append((updates + 1.0).clamp(max=updates_needed(count - 1))[:, None])
    return octaves, torch.cat(kept, dim=1)
