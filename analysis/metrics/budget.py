"""Division of the squared error of an image into shares that add up to it, and the floor that its latency sets.

With D the image on the display, R the picture now, R' the picture at the time that the image shows, and S(R') what the
image's own blends of pixels would show of R', all display-encoded,

    e = D - R = (D - S(R')) + (S(R') - R') + (R' - R)
              =  estimates  +      blur    +  latency.

The share of a term is the mean of ``term * e`` over pixels and channels. Shares add up to the mean of ``e²``, and each
is the reduction of the error when the term is removed, averaged over all orders in which the three can be removed (its
Shapley value). A share is negative if the term offsets the others. The share of the estimates is divided by pixels,
which is exact too: pixels that came into sight, else pixels where the light changed, else the rest. In the rest only
too few samples, or samples off the pixel's centre, can be the cause: aliasing.

:mod:`analysis.metrics.causes` divides the error in another way, by the age of each place's samples, into mean squares
with a remainder.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from analysis.metrics.quality import encode

SHARES = ("latency", "blur", "disocclusion", "shadows", "aliasing")
"""Parts of the error, by name."""


@dataclass(frozen=True)
class Places:
    """Pixels whose recent past differs; no pixel is in both sets.

    Attributes:
        uncovered: pixels whose surface was hidden, or outside the picture, shortly before.
        relit: pixels whose surface was visible then, and which the first light reaches at one of the two times only.
    """

    uncovered: Bool[Tensor, "h w"]
    relit: Bool[Tensor, "h w"]


def budget(
    shown: Float[Tensor, "h w 3"],
    carried: Float[Tensor, "h w 3"],
    late: Float[Tensor, "h w 3"],
    now: Float[Tensor, "h w 3"],
    places: Places,
) -> dict[str, float]:
    """Shares of one image's error.

    Args:
        shown: the image on the display, linear; non-finite values count as 0.
        carried: ``late`` after the image's blends of pixels, S(R'), linear.
        late: the truth at the time that the image shows, R', linear.
        now: the truth now, R, linear.
        places: pixels whose past differs, at the time that the image shows.

    Returns:
        Each of :data:`SHARES`, squared display-encoded values, which add up to the mean squared error; ``floor``, the
        mean squared error of ``late``; and ``uncovered`` and ``relit``, shares of the pixels.
    """
    display, kept, old, wanted = (
        encode(image).to(torch.float64) for image in (shown.nan_to_num(0.0, 0.0, 0.0), carried, late, now)
    )
    error = display - wanted

    def share(term: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w"]:
        return (term * error).mean(2)

    estimates = share(display - kept)
    count = estimates.numel()
    rest = ~(places.uncovered | places.relit)
    parts = {"disocclusion": places.uncovered, "shadows": places.relit, "aliasing": rest}
    return {
        "latency": float(share(old - wanted).mean()),
        "blur": float(share(kept - old).mean()),
        **{name: float(estimates[place].sum()) / count for name, place in parts.items()},
        "floor": float((old - wanted).square().mean()),
        "uncovered": int(places.uncovered.sum()) / count,
        "relit": int(places.relit.sum()) / count,
    }
