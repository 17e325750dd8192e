"""Streaming Haar wavelet transform of square tiles in Morton order. Knows nothing of rendering.

Normalisation: ``h = (a + b) / 2`` and ``g = a - b`` along every axis, so approximations keep the signal's scale and a
detail coefficient is the plain difference of two means. An orthonormal Haar step gives ours times ``sqrt 2`` for
every ``h`` and ``1 / sqrt 2`` for every ``g`` in their names.

Octants are named in the order x, y, t: ``hgh`` is low in x, high in y, low in time.

Source: Stephens 2011, sec. 5.3.4, eq. 5.15–5.16 and fig. 5.15.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor


@dataclass(frozen=True)
class Octave:
    """Power-relevant detail octants of one octave, each ``(n, positions)`` in Morton order."""

    ghh: Float[Tensor, "n p"]
    hgh: Float[Tensor, "n p"]
    ggh: Float[Tensor, "n p"]
    hhg: Float[Tensor, "n p"]
    ghg: Float[Tensor, "n p"]
    hgg: Float[Tensor, "n p"]
    ggg: Float[Tensor, "n p"]


def octave_count(samples: int) -> int:
    """Octaves until one coefficient remains: 4 for a 16 x 16 tile."""
    return (samples.bit_length() - 1) // 2


def state_size(samples: int) -> int:
    """Coefficients kept per tile between transforms: one full field per octave (340 for 16 x 16)."""
    return sum(samples >> (2 * o) for o in range(octave_count(samples)))


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
        state: coefficients returned by the previous update of the same tile; ignored where ``has_state`` is false.
        has_state: false for tiles without a past; their temporal details come out as exactly zero.

    Returns:
        Octaves from fine to coarse, and the state that replaces the cached one.

    Source: Stephens 2011, sec. 5.3.4 and fig. 5.9.
    """
    octaves, kept, first = [], [], 0
    approximation = signal
    for _ in range(octave_count(signal.shape[1])):
        now = spatial_step(approximation)
        width = now.shape[1]
        before = torch.where(has_state[:, None], state[:, first : first + width], now)
        low, high = temporal_step(now, before)
        hhh, hgh, ghh, ggh = low.chunk(4, dim=1)
        hhg, hgg, ghg, ggg = high.chunk(4, dim=1)
        octaves.append(Octave(ghh, hgh, ggh, hhg, ghg, hgg, ggg))
        kept.append(now)
        approximation, first = hhh, first + width
    return octaves, torch.cat(kept, dim=1)
